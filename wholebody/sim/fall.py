"""When a robot counts as fallen: the one definition that tests, benchmarks and reports share."""

from __future__ import annotations

from dataclasses import dataclass
from math import acos

import numpy as np

from wholebody.sim.plant import MujocoPlant
from wholebody.types import RobotState, Status

TILT_MAX = np.deg2rad(60.0)
"""Pelvis axis from vertical [rad]."""
HEIGHT_MIN = 0.20
"""Pelvis height [m]."""


@dataclass(frozen=True)
class Fall:
    """A fall: simulated time [s] and cause."""

    time: float
    cause: str


def pelvis_tilt(state: RobotState) -> float:
    """Angle between the pelvis axis and the vertical [rad]."""
    x, y = state.q[3:5].tolist()
    return acos(min(max(1.0 - 2.0 * (x * x + y * y), -1.0), 1.0))


def detect_fall(plant: MujocoPlant, state: RobotState, status: Status) -> Fall | None:
    """A fall at this instant, or None.

    Args:
        plant: For contacts with the floor.
        state: True state.
        status: What the supervisor says.
    """
    tilt, height = pelvis_tilt(state), float(state.q[2])
    if tilt > TILT_MAX:
        return Fall(state.time, f"pelvis tilted by {np.rad2deg(tilt):.0f} deg")
    if height < HEIGHT_MIN:
        return Fall(state.time, f"pelvis at {height:.2f} m")
    if status is Status.DAMPING:
        return Fall(state.time, "the supervisor gave up standing")
    body = plant.touches_floor()
    return Fall(state.time, f"{body} touches the floor") if body else None
