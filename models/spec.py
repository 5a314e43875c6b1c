"""What a robot is, before any physics library sees it: joints, feet, tools and a stance, with units and sources.

Every joint array outside Pinocchio is in *motor order*: the order of `RobotSpec.joints`.
"""

from __future__ import annotations

import dataclasses
import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

Vector3 = tuple[float, float, float]

FLOOR_FRICTION = 0.8
"""Coulomb coefficient of rubber on a dry floor: what simulated floors have unless told otherwise."""

PAYLOAD_AHEAD = 0.10
"""A payload is a solid ball fixed this far ahead of the palm body's origin, along its x axis [m]."""

PAYLOAD_RADIUS = 0.04
"""Radius of the payload ball, for its inertia only [m]."""


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
        return _frozen(self.contact_points)

    @cached_property
    def sole_center(self) -> np.ndarray:
        """Middle of the contact points in `frame`, shape (3,), [m]."""
        return _frozen(0.5 * (self.points.min(axis=0) + self.points.max(axis=0)))


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
        return _frozen(self.joint_positions)

    @cached_property
    def base(self) -> np.ndarray:
        """``[x y z qx qy qz qw]`` of the base in world, shape (7,)."""
        return _frozen((*self.base_position, *self.base_quat_xyzw))


@dataclass(frozen=True, kw_only=True)
class RobotSpec:
    """A robot from which Pinocchio, placo and MuJoCo models are made that are the same robot."""

    name: str
    """Short name, also used for cache entries."""
    urdf: Path
    """URDF the physics comes from."""
    base_body: str
    """Root body, free in space."""
    torso_body: str
    """Body above the waist."""
    imu_frame: str
    """Frame of the IMU that measures the base."""
    joints: tuple[JointSpec, ...]
    """Actuated joints in motor order."""
    feet: tuple[FootSpec, ...]
    """Left, then right."""
    tools: tuple[ToolSpec, ...]
    """Left, then right."""
    stance: Stance
    """Default stance."""
    hand_neutral: tuple[float, ...]
    """Relaxed fingers, left then right, in motor order [rad]; empty without fingers."""
    hand_open: tuple[float, ...] = ()
    """Fingers spread to receive an object, like `hand_neutral`."""
    hand_closed: tuple[float, ...] = ()
    """Command that wraps the fingers around an object and presses on it, like `hand_neutral`."""

    def __post_init__(self) -> None:
        names = [joint.name for joint in self.joints]
        doubled = sorted({name for name in names if names.count(name) > 1})
        if doubled:
            raise RobotSpecError(f"robot '{self.name}': joints {doubled} appear more than once")
        if len(self.stance.joint_positions) != len(names):
            raise RobotSpecError(
                f"robot '{self.name}': the stance has {len(self.stance.joint_positions)} joint angles, "
                f"the robot {len(names)} joints"
            )

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Joint names in motor order."""
        return tuple(joint.name for joint in self.joints)

    @property
    def n_joints(self) -> int:
        """Number of actuated joints."""
        return len(self.joints)

    @cached_property
    def position_min(self) -> np.ndarray:
        """Lower position bounds, shape (n_joints,), [rad]."""
        return self._array("position_min")

    @cached_property
    def position_max(self) -> np.ndarray:
        """Upper position bounds, shape (n_joints,), [rad]."""
        return self._array("position_max")

    @cached_property
    def velocity_max(self) -> np.ndarray:
        """Speed bounds, shape (n_joints,), [rad/s]."""
        return self._array("velocity_max")

    @cached_property
    def acceleration_max(self) -> np.ndarray:
        """Acceleration bounds, shape (n_joints,), [rad/s^2]."""
        return self._array("acceleration_max")

    @cached_property
    def effort_max(self) -> np.ndarray:
        """Torque bounds, shape (n_joints,), [N m]."""
        return self._array("effort_max")

    @cached_property
    def armature(self) -> np.ndarray:
        """Reflected rotor inertias, shape (n_joints,), [kg m^2]."""
        return self._array("armature")

    @cached_property
    def kp(self) -> np.ndarray:
        """Driver position gains, shape (n_joints,), [N m/rad]."""
        return self._array("kp")

    @cached_property
    def kd(self) -> np.ndarray:
        """Driver velocity gains, shape (n_joints,), [N m s/rad]."""
        return self._array("kd")

    def index(self, name: str) -> int:
        """Position of a joint in motor order.

        Raises:
            RobotSpecError: If there is no such joint.
        """
        try:
            return self.joint_names.index(name)
        except ValueError:
            near = difflib.get_close_matches(name, self.joint_names, n=3)
            hint = f"did you mean {near}?" if near else f"joints: {', '.join(self.joint_names)}"
            raise RobotSpecError(f"robot '{self.name}' has no joint '{name}'; {hint}") from None

    def indices(self, names: Sequence[str]) -> np.ndarray:
        """Positions of joints in motor order, shape (len(names),).

        Raises:
            RobotSpecError: If a joint does not exist.
        """
        return np.array([self.index(name) for name in names], dtype=int)

    def group_indices(self, group: str) -> np.ndarray:
        """Positions of the joints of a limb in motor order.

        Raises:
            RobotSpecError: If there is no such group.
        """
        found = [i for i, joint in enumerate(self.joints) if joint.group == group]
        if not found:
            groups = sorted({joint.group for joint in self.joints})
            raise RobotSpecError(f"robot '{self.name}' has no joint group '{group}'; groups: {', '.join(groups)}")
        return np.array(found, dtype=int)

    def foot(self, side: str) -> FootSpec:
        """The foot of a side.

        Raises:
            RobotSpecError: If there is no such side.
        """
        return _by_side(self.feet, side, "foot")

    def tool(self, side: str) -> ToolSpec:
        """The hand of a side.

        Raises:
            RobotSpecError: If there is no such side.
        """
        return _by_side(self.tools, side, "tool")

    def with_joints(self, changes: dict[str, dict[str, float]]) -> RobotSpec:
        """A copy in which joints matched by a pattern have other numbers.

        Args:
            changes: ``{regular expression of the whole joint name: {field of JointSpec: value}}``, later ones win.

        Raises:
            RobotSpecError: If a pattern matches no joint, or a field does not exist or may not change.
        """
        fields = {field.name for field in dataclasses.fields(JointSpec)} - {"name", "group"}
        joints = list(self.joints)
        for pattern, values in changes.items():
            unknown = sorted(set(values) - fields)
            if unknown:
                raise RobotSpecError(f"joint fields {unknown} do not exist; fields: {', '.join(sorted(fields))}")
            matched = [i for i, joint in enumerate(joints) if re.fullmatch(pattern, joint.name)]
            if not matched:
                raise RobotSpecError(
                    f"pattern '{pattern}' matches no joint of '{self.name}': {', '.join(self.joint_names)}"
                )
            for i in matched:
                joints[i] = dataclasses.replace(joints[i], **values)
        return dataclasses.replace(self, joints=tuple(joints))

    def _array(self, field: str) -> np.ndarray:
        return _frozen([getattr(joint, field) for joint in self.joints])


def _frozen(values: Sequence) -> np.ndarray:
    array = np.array(values, dtype=float)
    array.flags.writeable = False
    return array


def _by_side[T: (FootSpec, ToolSpec)](items: tuple[T, ...], side: str, what: str) -> T:
    for item in items:
        if item.side == side:
            return item
    raise RobotSpecError(f"no {what} on side '{side}'; sides: {', '.join(item.side for item in items)}")
