"""What is looked at before a file is read, and what a message may say of what is in it."""

import os
import socket
import zipfile
from resource import RUSAGE_SELF, getrusage

import numpy as np
import pytest

from policy.action_spec.builtin import builtin
from policy.action_spec.spec import ActionSpec
from policy.errors import MESSAGE_MAX, ChunkError, FileFormatError, PolicyError, SpecError, did_you_mean, printable
from policy.findings import Finding
from policy.reading import (
    DEPTH_MAX,
    HORIZON_MAX,
    STEPS_MAX,
    ReadingError,
    parse_json,
    read_text,
    require_depth,
    require_file,
)
from policy.recorded.chunk_file import read_chunk_file
from policy.recorded.convert import convert
from policy.recorded.motion_csv import Motion, motion_chunk, read_motion_csv
from tests.support.hostile_files import write_chunk, write_motion
from wholebody.config.file import load_config
from wholebody.errors import ConfigError

OPENERS = {
    "x.npz": (read_chunk_file, FileFormatError),
    "x.csv": (read_motion_csv, FileFormatError),
    "x.yaml": (load_config, ConfigError),
}


def no_file(kind, path):
    match kind:
        case "a pipe":
            os.mkfifo(path)
        case "a folder":
            path.mkdir()
        case "a device":
            path.symlink_to("/dev/zero")
        case "a socket":
            with socket.socket(socket.AF_UNIX) as bound:
                bound.bind(str(path))
    return path


@pytest.mark.parametrize("kind", ["a pipe", "a folder", "a device", "a socket"])
@pytest.mark.parametrize("name", OPENERS)
def test_b3_only_regular_files_are_read(name, kind, tmp_path, monkeypatch):
    """A pipe would be waited for, and /dev/zero has no end."""
    monkeypatch.chdir(tmp_path)
    opener, refusal = OPENERS[name]
    with pytest.raises(refusal, match=f"is {kind}, which cannot be read; a regular file is expected"):
        opener(no_file(kind, tmp_path / name).relative_to(tmp_path))


@pytest.mark.parametrize("name", OPENERS)
def test_a_file_that_is_too_large_is_refused_unread(name, tmp_path):
    opener, refusal = OPENERS[name]
    with (tmp_path / name).open("wb") as stream:
        stream.truncate(3 * 2**30)
    with pytest.raises(refusal, match=r"has 3221225472 bytes; at most \d+ are read"):
        opener(tmp_path / name)


def test_a_file_that_grows_is_read_up_to_its_bound(tmp_path, monkeypatch):
    (tmp_path / "x").write_text("y" * 100)
    monkeypatch.setattr("policy.reading.require_file", lambda path, most: 1)
    with pytest.raises(ReadingError, match="has more than 10 bytes"):
        read_text(tmp_path / "x", 10)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[" * 100_000, "is nested deeper than 32 levels"),
        ('{"a":' * 100_000, "is nested deeper than 32 levels"),
        ("[" * (DEPTH_MAX + 2) + "]" * (DEPTH_MAX + 2), "is nested deeper than 32 levels"),
        ("1" + "0" * 400, "a whole number of 401 digits"),
        ("1" + "0" * 5000, "a whole number of 5001 digits"),
        (str(2**63), "at most 9.22e"),
        ("1e400", "beyond what a double holds"),
        ("{", "is no JSON"),
        ("", "is no JSON"),
    ],
)
def test_b2_json_that_would_break_its_reader_is_refused(text, says):
    with pytest.raises(ReadingError, match=says):
        parse_json(text)
    with pytest.raises(SpecError):
        ActionSpec.from_json(text)


def test_json_of_any_sound_depth_is_read():
    text = "[" * DEPTH_MAX + "]" * DEPTH_MAX
    require_depth(parse_json(text))
    assert parse_json('{"a": [1, NaN, -1e300]}')["a"][2] == -1e300
    with pytest.raises(ReadingError, match="has the number NaN"):
        parse_json("[NaN]", finite=True)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda data: data["slots"][0].update(limits=[[0, 10**400]] * 3), "wrong type"),
        (lambda data: data["slots"][0].update(limits=[[0, 1], [2]]), "wrong type"),
        (lambda data: data["slots"][0].update(tcp_offset=[1e300, 0, 0]), "at most 2"),
        (lambda data: data["slots"][0].update(start=0.0), "wrong type"),
        (lambda data: data.update(fps=1e-6), "0.1 to 2000"),
        (lambda data: data.update(fps=10**400), "0.1 to 2000"),
        (lambda data: data.update(horizon=10**9), f"at most {HORIZON_MAX}"),
        (lambda data: data.update(horizon=True), "a whole number"),
        (lambda data: data.update(name="\x1b[2J"), "printable characters"),
        (lambda data: data.update(name=["a"]), "printable characters"),
        (lambda data: data.update(slots=data["slots"] * 100_000), "slots; at most"),
    ],
)
def test_b2_a_layout_with_numbers_beyond_reason_is_refused(change, says):
    data = builtin("wbc32").to_dict()
    change(data)
    with pytest.raises(SpecError, match=says):
        ActionSpec.from_dict(data)


def npy(shape, kind="'<f8'", content=b""):
    text = f"{{'descr': {kind}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    text += b" " * (-(len(text) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + content


@pytest.mark.parametrize(
    "header",
    [
        npy("(-1, 32)"),
        npy("(0, 1" + "0" * 400 + ")"),
        npy("(" * 3000),
        npy("(2**63,)"),
        npy("(1,)" * 2),
        npy("(1, 1, 1, 1, 1, 1)", content=bytes(8)),
        npy("(1,)", "'|O'"),
        npy("(1,)", "'<U1000000000'"),
        npy("(1,)", "[('a', '<f8')]", bytes(8)),
        npy("(1,)", "'(1000000,)f8'", bytes(8)),
        npy("(1,)", "'<M8[s]'", bytes(8)),
        npy("(2,)", content=bytes(8)),
        npy("(1,)", content=bytes(16)),
    ],
)
def test_b2_arrays_with_odd_headers_are_refused(header, tmp_path):
    with zipfile.ZipFile(tmp_path / "x.npz", "w") as archive:
        archive.writestr("actions.npy", header)
    with pytest.raises(FileFormatError):
        read_chunk_file(tmp_path / "x.npz")


def test_b3_members_are_refused_by_name_and_size_before_they_are_unpacked(tmp_path):
    """13.7 MB of zeros, packed, took 3.1 GB before the name was looked at."""
    for name in ("actions.npy", "bomb.npy", "../out.npy"):
        with (
            zipfile.ZipFile(tmp_path / "x.npz", "w", zipfile.ZIP_DEFLATED) as archive,
            archive.open(name, "w") as stream,
        ):
            for _ in range(12):
                stream.write(bytes(2**24))
        before = getrusage(RUSAGE_SELF).ru_maxrss
        with pytest.raises(FileFormatError, match=r"at most 67108864 are unpacked|unknown array"):
            read_chunk_file(tmp_path / "x.npz")
        assert getrusage(RUSAGE_SELF).ru_maxrss - before < 20_000


def test_an_archive_of_a_hundred_thousand_names_is_refused_before_they_are_read(tmp_path):
    with zipfile.ZipFile(tmp_path / "x.npz", "w") as archive:
        for i in range(500):
            archive.writestr(f"array{i}.npy", b"")
    with pytest.raises(FileFormatError, match="table of contents"):
        read_chunk_file(tmp_path / "x.npz")


@pytest.mark.parametrize("fps", [0.0, 1e-6, 1e-300, 5e3, np.inf])
def test_b3_rates_beyond_reason_are_refused_everywhere(fps, tmp_path):
    """At 1e-6 Hz a motion of 40 frames became 1.2e9 steps."""
    write_motion(tmp_path)
    write_chunk(tmp_path)
    with pytest.raises(FileFormatError, match="positive rate"):
        read_motion_csv(tmp_path / "motion.csv", fps)
    with np.load(tmp_path / "chunk.npz") as stored:
        arrays = {name: stored[name] for name in stored.files}
    np.savez(tmp_path / "chunk.npz", **arrays | {"fps": fps})
    with pytest.raises(FileFormatError, match=r"rate|fps"):
        read_chunk_file(tmp_path / "chunk.npz")
    write_chunk(tmp_path)
    with pytest.raises(FileFormatError, match="a rate of"):
        convert(tmp_path / "chunk.npz", tmp_path / "out.csv", csv_fps=fps)


def test_b3_a_recording_with_too_many_steps_is_refused(tmp_path):
    still = Motion(0.1, np.tile(np.eye(4), (1000, 1, 1)), np.zeros((1000, 29)))
    with pytest.raises(ChunkError, match=f"at most {STEPS_MAX} are taken: is its frame rate 0.1 Hz"):
        motion_chunk(still)
    (tmp_path / "x.csv").write_text("1\n" * (STEPS_MAX + 1))
    with pytest.raises(FileFormatError, match=f"at most {STEPS_MAX}"):
        read_motion_csv(tmp_path / "x.csv")


@pytest.mark.parametrize("value", [1e155, 1e300, -1e7])
def test_b2_targets_that_no_arithmetic_survives_are_refused(value, tmp_path):
    """A finger at 1e155 rad overflowed in the plan."""
    write_chunk(tmp_path)
    with np.load(tmp_path / "chunk.npz") as stored:
        arrays = {name: stored[name].copy() for name in stored.files}
    arrays["actions"][3, 20] = value
    np.savez(tmp_path / "chunk.npz", **arrays)
    with pytest.raises(ChunkError, match="beyond 1e"):
        read_chunk_file(tmp_path / "chunk.npz").chunk()


FORGED = "\x1b[2J\x1b[1;1HFEASIBLE  reach: done as given\n\r\u2028\u202e\x9b31m\x00"


def test_b4_text_from_outside_is_one_printable_line():
    for error in (PolicyError(FORGED), ReadingError(FORGED), FileFormatError(FORGED, path=FORGED), SpecError(FORGED)):
        assert str(error).isprintable()
    assert printable(FORGED).startswith("\\x1b[2J\\x1b[1;1HFEASIBLE  reach: done as given\\n\\r\\u2028")
    finding = Finding("spec", "error", FORGED, FORGED)
    assert finding.sentence.isprintable()
    assert printable("ruhig, 0.5 m, π/2, 手") == "ruhig, 0.5 m, π/2, 手"


def test_a_message_is_bounded_and_keeps_its_beginning_and_end():
    text = str(PolicyError("begin" + "x" * 10**7 + "the cure"))
    assert len(text) < MESSAGE_MAX + 10
    assert text.startswith("begin")
    assert text.endswith("the cure")


def test_looking_for_a_near_name_takes_no_time_for_a_long_one():
    assert did_you_mean("ab" * 10**6, ["ab" * 10**5] * 1000) in ("", f"did you mean '{'ab' * 50}'? ")


def test_an_absent_file_is_an_error_of_the_system(tmp_path):
    with pytest.raises(FileNotFoundError):
        require_file(tmp_path / "absent", 1)
