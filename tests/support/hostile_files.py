"""Good inputs of every reader, and what a hostile or broken one looks like: for property tests and `make fuzz-readers`.

A reader is a function of a folder that reads what lies in it; `READERS` has one for each kind of input, with a function
that writes a good one. `spoil` changes a good input by one of the `HARMS`, drawn from a seed.
"""

from __future__ import annotations

import io
import json
import os
import re
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from policy.action_spec.builtin import builtin
from policy.action_spec.spec import ActionSpec
from policy.chunk import ActionChunk
from policy.dataset.open import open_dataset
from policy.reading import SPEC_MAX, read_text
from policy.recorded.chunk_file import ChunkFile, read_chunk_file, write_chunk_file
from policy.recorded.dataset_replay import open_episode
from policy.recorded.example import example_file
from policy.recorded.motion_csv import motion_chunk, read_motion_csv
from policy.recorded.replay import open_recording
from policy.recorded.wizard import fits, lines, numbers_of
from policy.remote.msgpack_numpy import pack, unpack
from policy.remote.wire import chunk_from_map, chunk_to_map
from policy.scripted.library import scripted_policy
from tests.support.other_forms import motion_arrays, write_robomimic, write_xr
from tests.support.policy_cases import observation
from tests.support.public_headers import written
from tests.support.recordings import made_record, save
from wholebody.config import ControllerConfig
from wholebody.config.file import dump_config, load_config
from wholebody.sim.record import read_record

TEXTS = (
    "",
    "\x1b[2J\x1b[1;1HFEASIBLE  reach: done as given\n",
    "../../../../etc/passwd",
    "{chunk_index:9999999999d}",
    "{episode_index.__class__}",
    "os.system",
    "a" * 100_000,
    "\ud800",
    "\u202egnp.exe",
    "x\x00y",
    "!!python/object/apply:os.system ['touch canary']",
)
NUMBERS = ("-1", "0", "1e-300", "1e300", "1e999", "NaN", "Infinity", "1" + "0" * 400, "1" + "0" * 5000, "-0.0", "1.5")
VALUES = (
    *(json.dumps(text) for text in TEXTS),
    *NUMBERS,
    "null",
    "true",
    "[]",
    "{}",
    "[[]]",
    "[" * 100_000,
    '{"a":' * 100_000,
    "[" * 500 + "]" * 500,
    '{"class": "os.system", "config": {"command": "touch canary"}}',
    "[" + "0," * 100_000 + "0]",
)
"""JSON values in the place of another; not all are JSON."""


@dataclass(frozen=True)
class Reader:
    """A kind of input.

    Attributes:
        write: Write a good one into a folder.
        read: Read what lies in a folder.
        files: Names of the files in it that are spoilt, all if empty.
    """

    write: Callable[[Path], None]
    read: Callable[[Path], object]
    files: tuple[str, ...] = ()


def write_chunk(folder: Path) -> None:
    """A chunk file with everything in it."""
    spec, joints = builtin("wbc32"), {"left_elbow_joint": 0.1, "right_elbow_joint": 0.2}
    base = np.array([0.0, 0.0, 0.7, 0.0, 0.0, 0.0, 1.0])
    actions = np.tile(_pose(), (12, 1))
    write_chunk_file(folder / "chunk.npz", ChunkFile(spec, actions, 30.0, 1.0, base, joints))


def write_motion(folder: Path) -> None:
    """A motion of 40 frames."""
    row = np.array([0.0, 0.0, 0.7, 0.0, 0.0, 0.0, 1.0, *np.zeros(29)])
    np.savetxt(folder / "motion.csv", np.tile(row, (40, 1)), fmt="%.6f", delimiter=",")


def write_frames(folder: Path) -> None:
    """What a server sends: metadata, and a chunk."""
    chunk = scripted_policy("wave").infer(observation(0.0))
    (folder / "answer.frame").write_bytes(pack({"chunk": chunk_to_map(chunk), "server_timing": {"infer_ms": 1.0}}))


def read_frames(folder: Path) -> ActionChunk:
    """As the client of our own server does."""
    from policy.reading import require_file
    from policy.remote.channel import FRAME_MAX

    file = folder / "answer.frame"
    require_file(file, FRAME_MAX)
    data = unpack(file.read_bytes())
    return chunk_from_map(data.get("chunk") if isinstance(data, dict) else data)


def read_dataset(folder: Path) -> object:
    """Every check of a dataset, and an episode of it as a policy."""
    from policy.dataset.checks import check_times, check_videos, column_layout
    from policy.dataset.naming.sources import find_source
    from policy.dataset.open import open_dataset
    from policy.recorded.dataset_replay import open_episode

    dataset = open_dataset(folder)
    check_times(dataset)
    check_videos(dataset)
    column_layout(dataset, find_source(dataset, "action"))
    return open_episode(folder, 0).episode


def read_checkpoint(folder: Path) -> object:
    """Configuration, layouts and processors, without weights."""
    from policy.lerobot.checkpoint import LoadOptions, read_config, read_processors
    from policy.lerobot.spec import read_action_spec, read_state_spec

    options = LoadOptions(device="cpu")
    config = read_config(folder, options)
    spec = read_action_spec(folder, None, None)
    return config, read_state_spec(folder, spec), read_processors(folder, config, options)


def read_spec(folder: Path) -> ActionSpec:
    """A layout in a file of its own."""
    return ActionSpec.from_json(read_text(folder / "spec.json", SPEC_MAX))


SCENE = """<mujoco>
  <compiler angle="degree" meshdir="meshes"/>
  <asset>
    <mesh name="wedge" file="wedge.obj"/>
    <texture name="grid" type="2d" builtin="checker" width="64" height="64" rgb1="1 1 1" rgb2="0 0 0"/>
    <material name="grid" texture="grid"/>
  </asset>
  <worldbody>
    <geom name="ground" type="plane" size="0 0 1"/>
    <geom name="wall" type="box" size="0.02 1 0.5" pos="0.6 0 0.5" material="grid"/>
    <geom type="mesh" mesh="wedge" pos="1 1 0"/>
    <body name="ball" pos="0.5 0.3 1.1" euler="0 0 90"><freejoint/><geom type="sphere" size="0.05" mass="0.2"/></body>
    <body name="door" pos="4 -3 0"><joint name="hinge" axis="0 0 1" ref="10"/><geom type="box" size="1 1 1"/></body>
    <body name="lamp" pos="1 -2 1.5"><joint type="ball"/><geom type="box" size="0.02 0.3 0.4"/></body>
  </worldbody>
</mujoco>
"""
WEDGE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def write_scene(folder: Path) -> None:
    _write(folder / "scene.xml", SCENE)
    (folder / "meshes").mkdir(exist_ok=True)
    _write(folder / "meshes" / "wedge.obj", WEDGE)


def read_scene(folder: Path) -> object:
    """A file that a robot is to stand in, compiled without the robot."""
    import mujoco

    from models.scenes import add_scene
    from wholebody.sim.scene_file import scene_of

    mj = mujoco.MjSpec()
    add_scene(mj, scene_of(str(folder / "scene.xml")), 0.8)
    return mj.compile()


def read_split(folder: Path) -> object:
    """A dataset whose columns ``modality.json`` names: played, and looked at for layouts that fit."""
    numbers = numbers_of(folder / "set")
    return open_episode(folder / "set", 0).episode, lines(numbers, fits(numbers))


def write_looked_at(folder: Path) -> None:
    """A chunk with a mask, and a motion: what is looked at before it is played."""
    write_chunk_file(folder / "chunk.npz", example_file(builtin("unifolm_wla54")))
    write_motion(folder)


def read_looked_at(folder: Path) -> object:
    """Both, as the commands read them."""
    return [open_recording(folder / name).episode for name in ("chunk.npz", "motion.csv")]


def read_other_form(place: Path) -> object:
    """Every episode of a dataset in another form than LeRobot's."""
    return [open_episode(place, episode.index).episode for episode in open_dataset(place).episodes]


def write_retargeted(folder: Path) -> None:
    """The same motion by each tool."""
    for tool, arrays in motion_arrays(8)[0].items():
        np.savez(folder / f"{tool}.npz", **arrays)


READERS = {
    "chunk": Reader(write_chunk, lambda folder: read_chunk_file(folder / "chunk.npz").chunk()),
    "motion": Reader(write_motion, lambda folder: motion_chunk(read_motion_csv(folder / "motion.csv"))),
    "spec": Reader(lambda folder: _write(folder / "spec.json", builtin("wbc32").to_json()), read_spec),
    "config": Reader(
        lambda folder: _write(folder / "config.yaml", dump_config(ControllerConfig())),
        lambda folder: load_config(folder / "config.yaml"),
    ),
    "frame": Reader(write_frames, read_frames),
    "recording": Reader(
        lambda folder: _write_recording(folder / "run.npz"), lambda folder: read_record(folder / "run.npz")
    ),
    "scene": Reader(write_scene, read_scene),
    "split": Reader(lambda folder: written(folder / "set", "43 without names, modality.json"), read_split),
    "looked_at": Reader(write_looked_at, read_looked_at),
    "xr_json": Reader(
        lambda folder: write_xr(folder / "set", frames=3), lambda folder: read_other_form(folder / "set")
    ),
    "retargeted": Reader(
        write_retargeted, lambda folder: [open_recording(file).episode for file in sorted(folder.glob("*.npz"))]
    ),
}
if find_spec("h5py"):
    READERS["hdf5"] = Reader(
        lambda folder: write_robomimic(folder / "demo.hdf5", frames=3),
        lambda folder: read_other_form(folder / "demo.hdf5"),
    )
"""Readers whose good inputs are made here; those of LeRobot's folders are given a folder to copy (`folder_reader`)."""


def folder_reader(kind: str, copy: Callable[[Path], None]) -> Reader:
    """Reader of a folder of LeRobot's.

    Args:
        kind: ``dataset`` or ``checkpoint``.
        copy: Writes a good one into a folder.
    """
    return Reader(copy, {"dataset": read_dataset, "checkpoint": read_checkpoint}[kind])


def spoil(folder: Path, rng: np.random.Generator) -> str:
    """Change one file of a folder by one harm; says which."""
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    file = files[rng.integers(len(files))]
    # What says what the others are is the best place for lies.
    if rng.random() < 0.6:
        small = [one for one in files if one.suffix in (".json", ".jsonl", ".yaml", ".npz", ".csv", ".frame", ".xml")]
        file = small[rng.integers(len(small))] if small else file
    fitting = [harm for suffixes, harm in HARMS if not suffixes or file.suffix in suffixes]
    harm = fitting[rng.integers(len(fitting))]
    harm(file, rng)
    return f"{harm.__name__} of {file.relative_to(folder)}"


def truncation(file: Path, rng: np.random.Generator) -> None:
    content = file.read_bytes()
    file.write_bytes(content[: rng.integers(len(content) + 1)])


def bit_flips(file: Path, rng: np.random.Generator) -> None:
    content = bytearray(file.read_bytes())
    for _ in range(int(rng.integers(1, 17)) if content else 0):
        content[rng.integers(len(content))] ^= 1 << int(rng.integers(8))
    file.write_bytes(content)


def splice(file: Path, rng: np.random.Generator) -> None:
    content = file.read_bytes()
    start, end = sorted(int(i) for i in rng.integers(0, len(content) + 1, 2))
    middle = [b"", bytes(1000), rng.bytes(200), content[start:end] * 3, b"\xff" * 8][rng.integers(5)]
    file.write_bytes(content[:start] + middle + content[end:])


def no_regular_file(file: Path, rng: np.random.Generator) -> None:
    file.unlink()
    [
        lambda: os.mkfifo(file),
        file.mkdir,
        lambda: file.symlink_to("/dev/zero"),
        lambda: file.symlink_to("/dev/null"),
        lambda: file.symlink_to(file),
        lambda: file.symlink_to(file.parent),
        lambda: None,
    ][rng.integers(7)]()


def endless_file(file: Path, rng: np.random.Generator) -> None:
    """A file that takes no room on disk and three gigabytes in memory."""
    with file.open("r+b") as stream:
        stream.truncate(int(rng.choice([2**20, 2**27, 3 * 2**30])))


def hostile_value(file: Path, rng: np.random.Generator) -> None:
    """A JSON text with another value in the place of one of its own, or under a new name."""
    lines = file.read_text().splitlines() if file.suffix == ".jsonl" else [file.read_text()]
    at = int(rng.integers(len(lines))) if lines else 0
    mark, data = "@@@", json.loads(lines[at])
    places = list(_places(data))
    owner, key = places[rng.integers(len(places))]
    match rng.integers(4):
        case 0 if isinstance(owner, dict):
            owner[str(TEXTS[rng.integers(len(TEXTS))])] = owner.pop(key)
        case 1 if isinstance(owner, list):
            owner *= 3
        case 2 if isinstance(owner, dict):
            owner.pop(key)
        case _:
            owner[key] = mark
    lines[at] = json.dumps(data).replace(f'"{mark}"', VALUES[rng.integers(len(VALUES))], 1)
    file.write_text("\n".join(lines))


def hostile_yaml(file: Path, rng: np.random.Generator) -> None:
    lines = file.read_text().splitlines()
    values = (*NUMBERS, "2020-01-01", "9999999-99-99", "*a", "&a [1]", "!!python/object/apply:os.system [x]", "0x10")
    values += ("[" * 3000, "{" * 3000, "[1, 2", '"\\x1b[2J"', "1:30", "yes", "~", "[]", "{}", "? [a]")
    for _ in range(int(rng.integers(1, 3))):
        at = [i for i, line in enumerate(lines) if ": " in line and "#" not in line]
        i = at[rng.integers(len(at))]
        lines[i] = f"{lines[i].partition(':')[0]}: {values[rng.integers(len(values))]}"
    if rng.random() < 0.2:
        lines = [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9) if i else '1'}]" for i in range(12)] + lines
    file.write_text("\n".join(lines))


def hostile_xml(file: Path, rng: np.random.Generator) -> None:
    """One attribute has another value, or an element another name; or a declaration comes first."""
    text = file.read_text()
    values = (*TEXTS, *NUMBERS, "1e9 1e9", "/dev/zero", "free", "mesh", "plane", "\U0001f600")
    at = [found.span(1) for found in re.finditer(r'="([^"]*)"', text)]
    names = [
        "include",
        "plugin",
        "replicate",
        "composite",
        "extension",
        "option",
        "size",
        "flexcomp",
        "attach",
        "model",
        "keyframe",
        "hfield",
        "skin",
    ]
    match rng.integers(4):
        case 0:
            bomb = "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 9 if i else "x" * 99}">' for i in range(12))
            text = f"<!DOCTYPE m [{bomb}]>{text.replace('wall', '&a11;')}"
        case 1:
            text = text.replace(
                "<worldbody>", f'<worldbody><{names[rng.integers(len(names))]} file="x.xml" count="1e9"/>'
            )
        case 2:
            text = text.replace("<worldbody>", "<worldbody>" + "<body>" * 50_000)
        case _:
            start, end = at[rng.integers(len(at))]
            value = str(values[rng.integers(len(values))]).replace("<", "&lt;").replace('"', "&quot;")
            text = text[:start] + value + text[end:]
    file.write_bytes(text.encode("utf-8", "surrogatepass"))


def hostile_row(file: Path, rng: np.random.Generator) -> None:
    rows = [line.split(",") for line in file.read_text().splitlines()]
    row = rows[rng.integers(len(rows))]
    values = (
        "nan",
        "inf",
        "1e308",
        "",
        "x",
        "1" * 10_000,
        "0x1",
        "\x1b[2J",
        "1_000",
        "," * 100_000,
        "1e-320",
        "\u0663",
    )
    row[rng.integers(len(row))] = values[rng.integers(len(values))]
    if rng.random() < 0.02 and sum(map(len, rows)) < 10_000:
        rows = [["0"] * 36] * 240_000
    file.write_text("\n".join(",".join(row) for row in rows))


def hostile_archive(file: Path, rng: np.random.Generator) -> None:
    """Members of other names, sizes, shapes and types than arrays of actions have."""
    with np.load(file) as stored:
        arrays = {name: stored[name] for name in stored.files}
    name = list(arrays)[rng.integers(len(arrays))]
    match rng.integers(6):
        case 0:
            arrays[name] = _odd_arrays()[rng.integers(len(_odd_arrays()))]
        case 1:
            arrays[TEXTS[rng.integers(3)] or "x"] = np.zeros(3)
        case 2:
            arrays["actions"] = np.full((12, 32), float(NUMBERS[rng.integers(6)]))
        case 3:
            arrays["spec"] = np.array(VALUES[rng.integers(len(VALUES))].replace("\x00", "0"))
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for key, value in arrays.items():
            stream = io.BytesIO()
            np.lib.format.write_array(stream, value)
            content = stream.getvalue()
            if key == name and rng.random() < 0.4:
                content = _header(rng) + content[-200:]
            archive.writestr(f"{key}.npy", content)
        if rng.random() < 0.03:
            archive.writestr(
                ["bomb.npy", "fps.npy", "../out.npy", "a.py"][rng.integers(4)], bytes(70 * 2**20), compresslevel=1
            )


def hostile_frame(file: Path, rng: np.random.Generator) -> None:
    """A MessagePack frame with another value in the place of one of its own, or one that unpacks to a thousandfold."""
    import msgpack

    data = msgpack.unpackb(file.read_bytes())
    places = _places(data)
    owner, key = places[rng.integers(len(places))]
    values = (
        None,
        -1,
        2**64 - 1,
        1e300,
        float("nan"),
        "\x1b[2J",
        "|O",
        "<f8",
        "O8",
        b"x" * 1000,
        [],
        {},
        [[[[]]]],
        True,
    )
    values += ([10_000, 4, 4], [-1], [0, 2**62], "a" * 10**6, [0] * 50_000, {str(i): i for i in range(30_000)})
    match rng.integers(8):
        case 0 if isinstance(owner, dict):
            owner[values[rng.integers(7)]] = owner.pop(key)
        case 1:
            file.write_bytes(
                [b"\x91" * 10**6, b"\xdd\x00\x98\x96\x80" + b"\x80" * 10**7, b"\xc7\xff\x05"][rng.integers(3)]
            )
            return
        case 2:
            rows = np.tile(np.eye(4), (10_000, 1, 1))
            data = {"chunk": {**data["chunk"], "T_world_lhand": _plain(rows), "T_world_rhand": _plain(rows)}}
        case _:
            owner[key] = values[rng.integers(len(values))]
    file.write_bytes(msgpack.packb(data))


HARMS: tuple[tuple[tuple[str, ...], Callable[[Path, np.random.Generator], None]], ...] = (
    ((), truncation),
    ((), bit_flips),
    ((), splice),
    ((), no_regular_file),
    ((), endless_file),
    *[((".json", ".jsonl"), hostile_value)] * 6,
    *[((".yaml",), hostile_yaml)] * 6,
    *[((".csv",), hostile_row)] * 4,
    *[((".xml",), hostile_xml)] * 6,
    *[((".npz",), hostile_archive)] * 6,
    *[((".frame",), hostile_frame)] * 6,
)
"""Harms with the suffixes of the files that they fit, all if none; what knows the format comes more often."""


def _plain(array: np.ndarray) -> dict[bytes, object]:
    about = {b"data": array.tobytes(), b"dtype": array.dtype.str, b"shape": list(array.shape)}
    return {b"__ndarray__": True, **about}


def _pose() -> np.ndarray:
    rotation = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    return np.array([0.3, 0.2, 0.1, *rotation, 0.3, -0.2, 0.1, *rotation, *np.zeros(14)])


def _write(file: Path, text: str) -> None:
    file.write_text(text)


def _write_recording(file: Path) -> None:
    save(made_record(12), file)


def _places(data: object) -> list[tuple[object, object]]:
    """Every value of plain data, as what it is in and its name or number there."""
    keys = list(data) if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ()
    found = [(data, key) for key in keys]
    for key in keys:
        found += _places(data[key])
    return found


def _odd_arrays() -> list[np.ndarray]:
    objects = np.empty(1, dtype=object)
    return [
        objects,
        np.zeros((3, 0)),
        np.zeros((0, 32)),
        np.array("x" * 1000),
        np.zeros(3, dtype=complex),
        np.zeros(3, dtype=[("a", float)]),
        np.array(["NaT"], dtype="datetime64[s]"),
        np.full((12, 32), 1e4000, dtype=np.longdouble),
        np.zeros((200_001, 32), dtype=np.uint8),
        np.zeros((1,) * 20),
        np.array(1e-300),
        np.array(1e300),
        np.array(-0.0),
        np.zeros((12, 33)),
    ]


def _header(rng: np.random.Generator) -> bytes:
    """The beginning of an npy file, with a shape or type that numpy does not write."""
    shapes = [
        "(-1, 32)",
        "(True,)",
        "(10**9, 32)",
        "(0, 1" + "0" * 400 + ")",
        "(" * 500,
        "(1.5,)",
        "()",
        "(2**63,)",
        "3",
    ]
    types = ["'<f8'", "'|O'", "'<U1000000000'", "[('a', '<f8')]", "'(1000000,)f8'", "'V100000000'", "1", "'<f16'"]
    shape, kind = shapes[rng.integers(len(shapes))], types[rng.integers(len(types))]
    text = f"{{'descr': {kind}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    text += b" " * (-(len(text) + 11) % 64) + b"\n"
    return b"\x93NUMPY" + bytes([1 + int(rng.integers(3)), 0]) + len(text).to_bytes(2, "little") + text
