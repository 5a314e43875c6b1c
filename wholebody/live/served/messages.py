"""What goes between a program and the robot that is served to it; only the program's own child is at the other end."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import Literal

import numpy as np

from policy.observation import Observation

Clocks = Literal["wall", "lockstep"]
"""Clock of the robot: that of the wall, or as much as the program lets pass."""


@dataclass(frozen=True)
class Served:
    """Which robot is served, where, and how.

    Attributes:
        scene: Name of a scene, or a MuJoCo file (.xml).
        robot: Name of the robot model; the default one if empty.
        config: YAML file with changed settings of the controller; none if empty.
        clock: Whose time passes.
        report: Where a summary of the run is written at its end, as JSON, also if the program was killed; nowhere if
            empty.
        gate: Whether what targets come to is judged by its plan, and rejected where it cannot be done nearly so.
        realistic: Whether the robot differs from its model, by the seed of its `Reset`, and its state is estimated; in
            lockstep.
    """

    scene: str = "floor"
    robot: str = ""
    config: str = ""
    clock: Clocks = "wall"
    report: str = ""
    gate: bool = False
    realistic: bool = False


@dataclass(frozen=True)
class Target:
    """Where hands are to be at a time.

    Attributes:
        stamp: On the wall clock an instant of `time.monotonic`, in lockstep simulated time [s].
        parts: As `policy.targets.stream.TargetStream.put` takes them, in world.
    """

    stamp: float
    parts: dict[str, np.ndarray]


@dataclass(frozen=True)
class Advance:
    """Let simulated time pass in lockstep, until an instant of it [s]."""

    until: float


@dataclass(frozen=True)
class Reset:
    """Wanted in lockstep: the robot in its stance again, at the time at which it was seen first; and what is seen.

    Attributes:
        seed: Of how a realistic robot differs from its model.
    """

    seed: int = 0


@dataclass(frozen=True)
class PlaceBodies:
    """Put the scene's bodies that move elsewhere in lockstep: their poses as in `Seen`."""

    objects: np.ndarray


@dataclass(frozen=True)
class Ask:
    """Request for the present view of robot and world."""


@dataclass(frozen=True)
class End:
    """Lower the robot, and tell how it went."""


@dataclass(frozen=True)
class Seen:
    """View of robot and world.

    Attributes:
        observation: State of the robot, and where things are; its time is the robot's own.
        status: What the controller says of itself, and why, in one word each.
        fallen: Whether standing was lost.
        forces: Force that each palm feels of what it touches, in world axes, shape (2, 3), [N]; zeros: it does not.
        followed: Time of the robot up to which the targets are followed: what was said later is under way, or held [s].
    """

    observation: Observation
    status: tuple[str, str] = ("", "")
    fallen: bool = False
    followed: float = -inf
    forces: np.ndarray = field(default_factory=lambda: np.zeros((2, 3)))

    @property
    def objects(self) -> np.ndarray:
        """Position and quaternion wxyz of the scene's bodies that move, shape (k, 7)."""
        return self.observation.objects
