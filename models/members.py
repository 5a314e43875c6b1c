"""Joints, feet, tools and stances: what a `models.spec.RobotSpec` is made of, with units and sources."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

Vector3 = tuple[float, float, float]

PARTS = ("knee", "elbow", "wrist")
"""Roles of joints in their limb: those that straighten it (knee, elbow), and the light ones of a hand (wrist)."""


class RobotSpecError(ValueError):
    """A robot description was asked for something it does not contain, or was given values that make no sense."""


@dataclass(frozen=True, kw_only=True)
class JointSpec:
    """One actuated revolute joint."""

    name: str
    """Name in the URDF."""
    group: str
    """Limb it belongs to, such as ``left_leg``; see `RobotSpec.group_indices`."""
    position_min: float
    """Lower bound [rad]."""
    position_max: float
    """Upper bound [rad]."""
    velocity_max: float
    """Practical speed bound [rad/s]."""
    acceleration_max: float
    """Practical acceleration bound [rad/s^2]."""
    effort_max: float
    """Torque bound [N m]."""
    armature: float
    """Rotor inertia reflected to the joint [kg m^2]."""
    kp: float
    """Position gain of the motor driver [N m/rad]."""
    kd: float
    """Velocity gain of the motor driver [N m s/rad]."""
    part: str = ""
    """Role in its limb: one of `PARTS`, or empty."""
    damping: float = 0.0
    """Viscous friction [N m s/rad]."""
    friction_loss: float = 0.0
    """Dry friction [N m]."""

    def __post_init__(self) -> None:
        if not self.position_min < self.position_max:
            raise RobotSpecError(
                f"joint '{self.name}': position_min {self.position_min} rad is not below "
                f"position_max {self.position_max} rad; swap them or widen the range"
            )
        if self.part not in ("", *PARTS):
            raise RobotSpecError(
                f"joint '{self.name}': part is '{self.part}'; it is one of {', '.join(PARTS)}, or empty"
            )
        for field in ("velocity_max", "acceleration_max", "effort_max"):
            if not 0.0 < getattr(self, field) < np.inf:
                raise RobotSpecError(f"joint '{self.name}': {field} is {getattr(self, field)}, must be finite and > 0")
        for field in ("armature", "kp", "kd", "damping", "friction_loss"):
            if not 0.0 <= getattr(self, field) < np.inf:
                raise RobotSpecError(f"joint '{self.name}': {field} is {getattr(self, field)}, must be finite and >= 0")


@dataclass(frozen=True, kw_only=True)
class FootSpec:
    """A foot: the points where it may touch the floor."""

    side: str
    """``left`` or ``right``."""
    frame: str
    """Body the foot is part of; its axes are parallel to the sole."""
    contact_points: tuple[Vector3, ...]
    """Points on the sole in `frame` [m], in order around the sole."""

    @cached_property
    def points(self) -> np.ndarray:
        """Contact points in `frame`, shape (n_points, 3), [m]."""
        return frozen(self.contact_points)

    @cached_property
    def sole_center(self) -> np.ndarray:
        """Middle of the contact points in `frame`, shape (3,), [m]."""
        return frozen(0.5 * (self.points.min(axis=0) + self.points.max(axis=0)))


@dataclass(frozen=True, kw_only=True)
class ToolSpec:
    """A hand: the frame that policies command and the point that is judged."""

    side: str
    """``left`` or ``right``."""
    wrist_frame: str
    """Body whose pose an action chunk commands."""
    palm_body: str
    """Body of the palm, fixed to the wrist."""
    palm_frame: str
    """Name of the frame at the palm point, axes parallel to the wrist's."""
    palm_body_offset: Vector3
    """Origin of `palm_body` in `wrist_frame` [m]."""
    palm_offset: Vector3
    """Palm point in `wrist_frame` [m]."""
    finger_joints: tuple[str, ...]
    """Finger joints in motor order; empty for a rubber hand."""


@dataclass(frozen=True, kw_only=True)
class Stance:
    """A posture with the base pose that puts the soles on the floor."""

    base_position: Vector3
    """Base origin in world [m]; world: midpoint of the soles, x forward, z up."""
    base_quat_xyzw: tuple[float, float, float, float]
    """Orientation of the base in world."""
    joint_positions: tuple[float, ...]
    """Joint angles in motor order [rad]."""

    @cached_property
    def joints(self) -> np.ndarray:
        """Joint angles in motor order, shape (n_joints,), [rad]."""
        return frozen(self.joint_positions)

    @cached_property
    def base(self) -> np.ndarray:
        """``[x y z qx qy qz qw]`` of the base in world, shape (7,)."""
        return frozen((*self.base_position, *self.base_quat_xyzw))


def frozen(values: Sequence) -> np.ndarray:
    """Numbers as a read-only array."""
    array = np.array(values, dtype=float)
    array.flags.writeable = False
    return array
