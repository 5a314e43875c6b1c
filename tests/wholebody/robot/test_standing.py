"""Strategy: pelvis poses around the two bounds, and one that is no number."""

import numpy as np
import pytest

from wholebody.robot.standing import HEIGHT_MIN, TILT_MAX, has_lost_standing, pelvis_tilt
from wholebody.types import RobotState


def tilted(angle, height=0.7):
    q = np.array([0.0, 0.0, height, 0.0, np.sin(0.5 * angle), 0.0, np.cos(0.5 * angle)])
    return RobotState(0.0, q, np.zeros(6))


@pytest.mark.parametrize(
    ("state", "lost"),
    [
        (tilted(TILT_MAX - 1e-6), False),
        (tilted(TILT_MAX + 1e-6), True),
        (tilted(0.0, HEIGHT_MIN), False),
        (tilted(0.0, HEIGHT_MIN - 1e-9), True),
        (tilted(0.0, np.nan), True),
        (tilted(np.nan), True),
    ],
)
def test_standing_is_lost_past_either_bound_and_where_the_state_is_no_number(state, lost):
    assert has_lost_standing(state) == lost


def test_the_tilt_is_the_angle_to_the_vertical():
    assert pelvis_tilt(tilted(0.3)) == pytest.approx(0.3)
    assert pelvis_tilt(tilted(np.pi)) == pytest.approx(np.pi)
