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
from typing import Any

import numpy as np

from models.members import FootSpec, JointSpec, RobotSpecError, Stance, ToolSpec, frozen

FLOOR_FRICTION = 0.8
"""Coulomb coefficient of rubber on a dry floor: what simulated floors have unless told otherwise."""

PAYLOAD_AHEAD = 0.10
"""A payload is a solid ball fixed this far ahead of the palm body's origin, along its x axis [m]."""

PAYLOAD_RADIUS = 0.04
"""Radius of the payload ball, for its inertia only [m]."""


LIMBS = ("left_leg", "right_leg", "waist", "left_arm", "right_arm")
"""Groups of joints that a humanoid may have; a robot whose waist is locked has no joints in that one."""


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
    locked: tuple[str, ...] = ()
    """Joints of the URDF that are fixed at zero, and so are not among `joints`."""
    without_collision: tuple[str, ...] = ()
    """Links whose collision shapes are left out, such as fingertips that a palm covers."""
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
        fingers = tuple(name for tool in self.tools for name in tool.finger_joints)
        if tuple(names[len(names) - len(fingers) :]) != fingers:
            raise RobotSpecError(
                f"robot '{self.name}': its joints must end with the fingers of its tools, in order: {list(fingers)}"
            )
        for what in ("hand_neutral", "hand_open", "hand_closed"):
            angles = getattr(self, what)
            if len(angles) not in {len(fingers), 0 if what != "hand_neutral" else len(fingers)}:
                raise RobotSpecError(
                    f"robot '{self.name}': {what} has {len(angles)} angles, the tools have {len(fingers)} fingers"
                )

    def __hash__(self) -> int:
        """Computed once: a robot is a key of many caches."""
        return self._hash

    def __getstate__(self) -> dict[str, object]:
        """What was computed from the fields stays behind: hashes are those of one process."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}

    @cached_property
    def _hash(self) -> int:
        return hash(tuple(getattr(self, field.name) for field in dataclasses.fields(self)))

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Joint names in motor order."""
        return tuple(joint.name for joint in self.joints)

    @property
    def n_joints(self) -> int:
        """Number of actuated joints."""
        return len(self.joints)

    @cached_property
    def body_joints(self) -> tuple[str, ...]:
        """Names of the joints that are no fingers, in motor order, in which they come first."""
        return self.joint_names[: self.n_joints - sum(self.fingers)]

    @cached_property
    def fingers(self) -> tuple[int, ...]:
        """Number of finger joints of each tool, left then right."""
        return tuple(len(tool.finger_joints) for tool in self.tools)

    @cached_property
    def limbs(self) -> dict[str, np.ndarray]:
        """Positions of the joints of each of `LIMBS` in motor order; empty where the robot has no such joints."""
        found = {name: [i for i, joint in enumerate(self.joints) if joint.group == name] for name in LIMBS}
        return {name: np.array(indices, dtype=int) for name, indices in found.items()}

    @cached_property
    def is_finger(self) -> np.ndarray:
        """Which joints are fingers, shape (n_joints,), motor order."""
        return np.arange(self.n_joints) >= len(self.body_joints)

    def parts(self, part: str) -> np.ndarray:
        """Which joints are such a part of a limb, one of `PARTS`, shape (n_joints,), motor order."""
        return np.array([joint.part == part for joint in self.joints])

    def by_hand(self, fingers: Sequence[float] | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angles of all fingers, such as `hand_neutral`, as those of the left and of the right hand [rad]."""
        both = np.array(fingers, dtype=float)
        return both[: self.fingers[0]], both[self.fingers[0] :]

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
        fields = {field.name for field in dataclasses.fields(JointSpec)} - {"name", "group", "part"}
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
                joints[i] = dataclasses.replace(joints[i], **dict[str, Any](values))
        return dataclasses.replace(self, joints=tuple(joints))

    def _array(self, field: str) -> np.ndarray:
        return frozen([getattr(joint, field) for joint in self.joints])


def _by_side[T: (FootSpec, ToolSpec)](items: tuple[T, ...], side: str, what: str) -> T:
    for item in items:
        if item.side == side:
            return item
    raise RobotSpecError(f"no {what} on side '{side}'; sides: {', '.join(item.side for item in items)}")
