"""Chunk files: what the format says is read, what is malformed or hostile is refused before numpy allocates it."""

import dataclasses
import io
import pickle
import zipfile

import numpy as np
import pytest

from models import g1
from policy import Anchor, ChunkFile, FileFormatError, builtin, encode, read_chunk_file, write_chunk_file
from tests.support.policy_cases import anchor_somewhere, wandering_chunk

STEPS = 8


def actions(spec="wbc32"):
    return encode(builtin(spec), wandering_chunk(Anchor.nominal(), steps=STEPS), Anchor.nominal())


@pytest.fixture
def path(tmp_path):
    return tmp_path / "chunk.npz"


def save(path, **changes):
    arrays = {"actions": actions(), "fps": 30.0, "spec": "wbc32"} | changes
    np.savez(path, **{key: value for key, value in arrays.items() if value is not None})
    return path


def test_the_least_file_is_anchored_at_the_nominal_stance(path):
    chunk = read_chunk_file(save(path)).chunk()
    expected = wandering_chunk(Anchor.nominal(), steps=STEPS)
    assert np.abs(chunk.T_world_lhand - expected.T_world_lhand).max() < 1e-9
    assert (chunk.t_obs, chunk.fps) == (0.0, 30.0)


def test_writing_and_reading_gives_the_same_file(path):
    spec = dataclasses.replace(builtin("wbc32"), name="mine", fps=50.0)
    q0 = {"left_elbow_joint": 0.4, "right_hand_index_0_joint": 0.2}
    base = np.array([0.1, 0.2, 0.7, 0.0, 0.0, np.sin(0.2), np.cos(0.2)])
    file = ChunkFile(spec, actions(), 50.0, 3.25, base, q0)
    write_chunk_file(path, file)
    again = read_chunk_file(path)
    assert (again.spec, again.fps, again.t_obs, again.q0_joints) == (spec, 50.0, 3.25, q0)
    assert (again.actions == file.actions).all()
    assert np.allclose(again.q0_base, base)


def test_the_files_name_is_kept(tmp_path):
    write_chunk_file(tmp_path / "chunk.bin", ChunkFile(builtin("wbc32"), actions(), 30.0))
    assert read_chunk_file(tmp_path / "chunk.bin").fps == 30.0


def test_the_start_is_the_anchor(path):
    base = np.array([0.3, -0.1, 0.7, 0.0, np.sin(0.1), 0.0, np.cos(0.1)])
    save(path, q0_base=base, q0_names=np.array(["left_elbow_joint"]), q0_joints=np.array([0.9]))
    anchor = read_chunk_file(path).anchor()
    assert np.allclose(anchor.T_world_base[:3, 3], base[:3])
    assert anchor.q_body[g1().limbs["left_arm"]][3] == 0.9
    assert np.allclose(anchor.q_body[:12], Anchor.nominal().q_body[:12])


def test_relative_actions_find_their_reference_in_the_file(path):
    anchor = anchor_somewhere()
    spec = builtin("gr00t_g1")
    chunk = wandering_chunk(anchor, steps=3)
    quat_base = np.concatenate([anchor.T_world_base[:3, 3], _quat(anchor.T_world_base)])
    names = dict(zip(_names(), np.concatenate([anchor.q_body, anchor.q_lhand, anchor.q_rhand]), strict=True))
    write_chunk_file(path, ChunkFile(spec, encode(spec, chunk, anchor), 30.0, 0.0, quat_base, names))
    again = read_chunk_file(path).chunk()
    assert np.abs(again.T_world_rhand - chunk.T_world_rhand).max() < 1e-9


def _quat(T):
    from policy.geometry.rotations import matrix_to_quaternion

    return matrix_to_quaternion(T[:3, :3], "xyzw")


def _names():
    from models import g1

    return g1().joint_names


def test_integers_float32_and_arrays_of_one_are_numbers(path):
    save(path, actions=actions().astype(np.float32), fps=np.array([30]), t_obs=np.array(2))
    file = read_chunk_file(path)
    assert (file.fps, file.t_obs) == (30.0, 2.0)
    file.chunk()


def test_a_file_without_spec_needs_the_users_word(path):
    save(path, spec=None)
    with pytest.raises(FileFormatError, match="--assume-spec"):
        read_chunk_file(path)
    assert read_chunk_file(path, assume=builtin("wbc32")).spec == builtin("wbc32")


def spoil(value, index):
    array = actions()
    array[index] = value
    return array


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"actions": None}, r"lacks \['actions'\]"),
        ({"fps": None}, r"lacks \['fps'\]"),
        ({"actions": spoil(np.nan, (3, 5))}, r"actions\[3, 5\] is nan"),
        ({"actions": spoil(np.inf, (0, 0))}, r"actions\[0, 0\] is inf"),
        ({"actions": np.zeros((4, 31))}, r"'wbc32' needs \(steps, 32\)"),
        ({"actions": np.zeros((0, 32))}, "needs"),
        ({"actions": np.zeros((2, 3, 32))}, "needs"),
        ({"actions": np.full((2, 32), "x")}, "numbers are expected"),
        ({"actions": np.zeros((2, 32), dtype=complex)}, "numbers are expected"),
        ({"fps": 0.0}, "positive rate"),
        ({"fps": -1.0}, "positive rate"),
        ({"fps": np.nan}, "fps"),
        ({"fps": np.array([30.0, 30.0])}, "a single number"),
        ({"fps": "30"}, "numbers are expected"),
        ({"t_obs": np.inf}, "t_obs"),
        ({"spec": "wbc23"}, "did you mean"),
        ({"spec": "{"}, "is no JSON"),
        ({"spec": 32}, "one string"),
        ({"spec": np.array(["wbc32", "wbc32"])}, "one string"),
        ({"q0_base": np.zeros(6)}, "seven numbers"),
        ({"q0_base": np.array([0, 0, 0.7, 0, 0, 0, 2.0])}, "norm 2, not 1"),
        ({"q0_base": np.array([0, 0, np.nan, 0, 0, 0, 1.0])}, "q0_base"),
        ({"q0_names": np.array(["left_elbow_joint"])}, "only go together"),
        ({"q0_names": np.array(["left_elbo_joint"]), "q0_joints": np.zeros(1)}, "did you mean 'left_elbow_joint'"),
        ({"q0_names": np.array(["left_elbow_joint"] * 2), "q0_joints": np.zeros(2)}, "twice"),
        ({"q0_names": np.array(["left_elbow_joint"]), "q0_joints": np.zeros(2)}, "as many angles"),
        ({"q0_names": np.array([1.0]), "q0_joints": np.zeros(1)}, "list of joint names"),
        ({"action": np.zeros(3)}, "did you mean 'actions'"),
    ],
)
def test_a_malformed_file_is_refused(path, changes, complaint):
    with pytest.raises(FileFormatError, match=complaint) as refusal:
        read_chunk_file(save(path, **changes))
    assert str(path) in str(refusal.value)


class Bomb:
    """Would touch the file system when unpickled."""

    def __reduce__(self):
        return (open, ("/nonexistent/unpickled", "w"))


def test_pickled_objects_are_refused_and_never_run(path):
    np.savez(path, actions=actions(), fps=30.0, spec=np.array([Bomb()], dtype=object))
    with pytest.raises(FileFormatError, match="never unpickled"):
        read_chunk_file(path)


def test_a_bare_pickle_is_refused(path):
    path.write_bytes(pickle.dumps(Bomb()))
    with pytest.raises(FileFormatError, match=r"no \.npz file"):
        read_chunk_file(path)


def test_a_header_that_claims_more_than_the_file_holds_is_refused(path):
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": "<f8", "fortran_order": False, "shape": (10**12, 32)})
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("actions.npy", stream.getvalue() + bytes(64))
    with pytest.raises(FileFormatError, match="actions claims 256000000000000 bytes"):
        read_chunk_file(path)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"hello", bytes(1000)])
def test_files_that_are_no_archive_are_refused(path, content):
    path.write_bytes(content)
    with pytest.raises(FileFormatError):
        read_chunk_file(path)


def test_members_that_are_no_arrays_are_refused(path):
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("run.py", "import os")
    with pytest.raises(FileFormatError, match=r"contains 'run\.py'"):
        read_chunk_file(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("actions.npy", b"\x93NUMPY\x01\x00\x10\x00garbage header..")
    with pytest.raises(FileFormatError):
        read_chunk_file(path)


def test_every_truncation_of_a_good_file_is_refused(path):
    content = save(path).read_bytes()
    for cut in np.linspace(0, len(content) - 1, 40).astype(int):
        path.write_bytes(content[:cut])
        with pytest.raises(FileFormatError):
            read_chunk_file(path)


def test_an_absent_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(FileFormatError, match="cannot be read"):
        read_chunk_file(tmp_path / "absent.npz")
    with pytest.raises(FileFormatError, match="cannot be read"):
        read_chunk_file(tmp_path)


@pytest.mark.parametrize(("field", "value", "says"), [(0, 1, "password"), (2, 99, "compression")])
def test_an_archive_that_nobody_can_open_here_is_refused_with_the_reason(path, field, value, says):
    """Flags and compression are told twice: before the data of an entry, and in the list at the end of the archive."""
    np.savez(path, fps=30.0)
    content = bytearray(path.read_bytes())
    for mark, flags in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        content[content.index(mark) + flags + field] = value
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match=says):
        read_chunk_file(path)


def test_a_damaged_file_is_refused_wherever_the_damage_is(path):
    rng, refused = np.random.default_rng(1), 0
    # Numbers that compress badly: the stream has many places that a decompressor stumbles over.
    np.savez_compressed(path, actions=rng.normal(size=(50, 32)), fps=30.0, spec="wbc32")
    content = path.read_bytes()
    for _ in range(400):
        damaged = bytearray(content)
        for place in rng.integers(len(content), size=3):
            damaged[place] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            read_chunk_file(path)
        except FileFormatError:
            refused += 1
    assert refused > 300
