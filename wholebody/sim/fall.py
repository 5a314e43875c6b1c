"""When a robot counts as fallen: the one definition that tests, benchmarks and reports share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wholebody.robot.plant import Plant
from wholebody.robot.standing import TILT_MAX, has_lost_standing, pelvis_tilt
from wholebody.types import RobotState, Status


@dataclass(frozen=True)
class Fall:
    """A fall: simulated time [s] and cause."""

    time: float
    cause: str


def detect_fall(plant: Plant, state: RobotState, status: Status) -> Fall | None:
    """A fall at this instant, or None.

    Args:
        plant: For contacts with the floor.
        state: True state.
        status: What the supervisor says.
    """
    if has_lost_standing(state):
        tilt = pelvis_tilt(state)
        tilted = f"pelvis tilted by {np.rad2deg(tilt):.0f} deg"
        return Fall(state.time, tilted if tilt > TILT_MAX else f"pelvis at {state.q[2]:.2f} m")
    if status is Status.DAMPING:
        return Fall(state.time, "the supervisor gave up standing")
    body = plant.touches_floor()
    return Fall(state.time, f"{body} touches the floor") if body else None
