"""Strategy: fingers that close while their hand is told anew where it is, a fraction of a millimetre off each time."""

import numpy as np
import pytest

from wholebody.reference import HandMotion, HandPath, rest_row

CLOSED = np.array([0.0, 0.6, 1.7, 1.5, 1.7, 1.5, 1.7])
TIMES = np.arange(90) / 30.0


def told(p):
    T = np.tile(np.eye(4), (len(TIMES), 1, 1))
    T[:, :3, 3] = p
    return HandPath.from_knots(TIMES, T, np.tile(CLOSED, (len(TIMES), 1)))


@pytest.mark.parametrize("every", [1.0 / 30.0, 0.1])
@pytest.mark.parametrize("scatter", [1e-6, 3e-4])
def test_fingers_of_a_hand_that_stays_close_as_soon_however_often_it_is_told(every, scatter):
    """They crept for many seconds where the hand, which was there, did not move straight towards where it was."""
    rng = np.random.default_rng(0)
    once = told(np.zeros(3)).joined(HandMotion(rest_row(np.eye(4))), 0.0)
    off = np.abs(once.sample(TIMES).q_finger - CLOSED).max(axis=1)
    motion, s = HandMotion(rest_row(np.eye(4))), 0.0
    while np.abs(motion.q_finger - CLOSED).max() > 0.05 and s < 5.0:
        path = told(scatter * rng.standard_normal(3)).joined(motion, 0.0)
        motion, s = HandMotion(path.sample(np.array([every])).rows[0]), s + every
        assert np.linalg.norm(motion.p) <= 10.0 * scatter
    assert s <= 1.2 * TIMES[off <= 0.05][0] + every
