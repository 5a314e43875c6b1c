"""Strategy: hands that are turned about a palm that is where the chunk has it, or elsewhere; where the palm goes."""

import numpy as np
import pytest

from policy.chunk import ActionChunk
from policy.geometry.rotations import matrix_to_quaternion, rotvec_to_matrix
from wholebody.planning.preparation import prepare
from wholebody.reference import HandLimits, HandMotion, rest_row

OFFSET = np.array([0.1215, 0.003, 0.0])
PALMS = np.array([[0.3, 0.16, 1.2], [0.3, -0.16, 1.2]])
FINGERS = np.zeros(7)


def hands(turn, palms=PALMS):
    """Poses of both wrists (2, 4, 4) that are turned by a rotation vector [rad], palms where they are asked to be."""
    T = np.tile(np.eye(4), (2, 1, 1))
    T[:, :3, :3] = rotvec_to_matrix(np.array(turn))
    T[:, :3, 3] = palms - T[:, :3, :3] @ OFFSET
    return T


def joined(turn, palms=PALMS):
    """Paths of both hands to a chunk that keeps them straight, from where they are turned."""
    poses = np.repeat(hands((0.0, 0.0, 0.0))[:, None], 50, axis=1)
    chunk = ActionChunk("test", 0, 0.0, 30.0, *poses, *np.zeros((2, 50, 7)))
    commanded = HandMotion(np.stack([rest_row(T, FINGERS) for T in hands(turn, palms)]))
    paths, _ = prepare(chunk, (HandLimits(), HandLimits())).paths(0.0, commanded, 1.0, np.tile(OFFSET, (2, 1)))
    return paths, commanded


def palms_along(path, s):
    motion = path.sample(s)
    return motion.p + motion.T_world_hand[:, :3, :3] @ OFFSET


@pytest.mark.parametrize("turn", [(0.0, 0.5, 0.0), (0.3, 0.0, -0.4)])
def test_a_palm_that_is_where_it_should_be_stays_there_while_the_hand_turns_back(turn):
    paths, commanded = joined(turn)
    for path, palm, row in zip(paths, PALMS, commanded.rows, strict=True):
        s = np.linspace(0.0, path.span[1], 500)
        assert path.join.angle == pytest.approx(np.linalg.norm(turn), rel=1e-6)
        assert np.abs(palms_along(path, s) - palm).max() < 1e-4
        assert np.allclose(path.sample(0.0).rows, row, atol=1e-9)
        end = path.sample(path.span[1])
        assert np.allclose(matrix_to_quaternion(np.eye(3), "xyzw"), end.quat, atol=1e-9)


def test_a_palm_that_is_nearly_there_goes_straight_while_the_hand_turns():
    off = np.array([0.006, 0.003, -0.006])
    paths, _ = joined((0.0, 0.5, 0.0), PALMS + off)
    for path, palm in zip(paths, PALMS, strict=True):
        along = palms_along(path, np.linspace(0.0, path.span[1], 500)) - palm
        across = along - np.outer(along @ off, off) / (off @ off)
        assert np.abs(across).max() < 1e-4
        assert np.all(np.diff(along @ off) < 1e-7)
        assert np.abs(along[-1]).max() < 1e-9


def test_the_path_of_a_palm_has_no_kinks():
    for path in joined((0.0, 0.5, 0.0))[0]:
        s = np.linspace(0.0, path.join.duration + 0.1, 2000)
        motion = path.sample(s)
        assert np.abs(np.gradient(motion.p, s, axis=0) - motion.v)[1:-1].max() < 1e-3
        assert np.abs(np.gradient(motion.v, s, axis=0) - motion.a)[1:-1].max() < 0.05 * np.abs(motion.a).max()
