"""When a robot counts as fallen: the one definition that tests, benchmarks and reports share."""

from __future__ import annotations

from dataclasses import dataclass

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


def detect_fall(plant: MujocoPlant, state: RobotState, status: Status) -> Fall | None:
    """A fall at this instant, or None.

    Args:
        plant: For contacts with the floor.
        state: True state.
        status: What the supervisor says.
    """
    x, y = state.q[3], state.q[4]
    tilt = float(np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0)))
    if tilt > TILT_MAX:
        return Fall(state.time, f"pelvis tilted by {np.rad2deg(tilt):.0f} deg")
    if state.q[2] < HEIGHT_MIN:
        return Fall(state.time, f"pelvis at {state.q[2]:.2f} m")
    if status is Status.DAMPING:
        return Fall(state.time, "the supervisor gave up standing")
    body = plant.touches_floor()
    return Fall(state.time, f"{body} touches the floor") if body else None
