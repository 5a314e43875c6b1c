"""When standing is lost: the one definition, for the supervisor and for what watches the robot."""

from __future__ import annotations

from math import acos, cos, radians

from wholebody.types import RobotState

TILT_MAX = radians(60.0)
"""Largest angle between the pelvis axis and the vertical [rad]; chosen: nothing brings a robot back from there."""
HEIGHT_MIN = 0.20
"""Least height of the pelvis [m]; chosen: below any squat."""

_COSINE_MIN = cos(TILT_MAX)


def has_lost_standing(state: RobotState) -> bool:
    """Whether the pelvis is tilted too far or too low; a state that is not a number does not stand either."""
    z, x, y = state.q[2:5].tolist()
    return not (1.0 - 2.0 * (x * x + y * y) >= _COSINE_MIN and z >= HEIGHT_MIN)


def pelvis_tilt(state: RobotState) -> float:
    """Angle between the pelvis axis and the vertical [rad]."""
    x, y = state.q[3:5].tolist()
    return acos(min(max(1.0 - 2.0 * (x * x + y * y), -1.0), 1.0))
