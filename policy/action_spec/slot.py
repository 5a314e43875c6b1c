"""A slot of an action spec: a run of numbers with one meaning."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from policy.errors import SpecError, did_you_mean
from policy.geometry.rotations import QuaternionOrder, Rot6dLayout
from policy.joints import (
    LEFT_ARM_JOINTS,
    LEFT_HAND_JOINTS,
    RIGHT_ARM_JOINTS,
    RIGHT_HAND_JOINTS,
    WAIST_JOINTS,
)

Kind = Literal["position", "rot6d", "quaternion", "rotvec", "rpy", "joint", "scalar", "velocity"]
Mode = Literal["absolute", "relative_se3", "relative_add", "delta"]
Frame = Literal["pelvis", "pelvis_yaw", "torso", "world"]
Orientation = Literal["given", "free"]

ROTATIONS: tuple[Kind, ...] = ("rot6d", "quaternion", "rotvec", "rpy")
SIZES: dict[Kind, int] = {"position": 3, "rot6d": 6, "quaternion": 4, "rotvec": 3, "rpy": 3, "scalar": 1, "velocity": 3}
"""Width of each kind; a joint slot is as wide as its list of joints."""

DEX1_OPEN = 5.4
"""Motor angle of the open Dex1 gripper [rad]; 0 is closed. Source: xr_teleoperate ``Dex1_1_Gripper_Controller``."""

UNITS: dict[Kind, dict[str, tuple[float, float]]] = {
    "position": {"m": (1.0, 0.0), "cm": (1e-2, 0.0), "mm": (1e-3, 0.0)},
    "rot6d": {"1": (1.0, 0.0)},
    "quaternion": {"1": (1.0, 0.0)},
    "rotvec": {"rad": (1.0, 0.0), "deg": (np.pi / 180.0, 0.0)},
    "rpy": {"rad": (1.0, 0.0), "deg": (np.pi / 180.0, 0.0)},
    "joint": {"rad": (1.0, 0.0), "deg": (np.pi / 180.0, 0.0)},
    "scalar": {
        "1": (1.0, 0.0),
        "percent": (1e-2, 0.0),
        "dex1 rad": (-1.0 / DEX1_OPEN, 1.0),
        "m": (1.0, 0.0),
        "cm": (1e-2, 0.0),
        "mm": (1e-3, 0.0),
    },
    "velocity": {"m/s, rad/s": (1.0, 0.0)},
}
"""Units of each kind as (scale, offset): SI value = scale * number + offset. A grasp is 0 open, 1 closed."""

TCP_OFFSET_MAX = 2.0
"""Largest distance of a tool point from the wrist, per axis [m]."""
_GRASP_UNITS, _HEIGHT_UNITS = ("1", "percent", "dex1 rad"), ("m", "cm", "mm")

TARGETS: dict[str, tuple[tuple[Kind, ...], tuple[str, ...]]] = {
    "left_wrist_position": (("position",), ()),
    "left_wrist_rotation": (ROTATIONS, ()),
    "right_wrist_position": (("position",), ()),
    "right_wrist_rotation": (ROTATIONS, ()),
    "left_arm": (("joint",), LEFT_ARM_JOINTS),
    "right_arm": (("joint",), RIGHT_ARM_JOINTS),
    "left_hand": (("joint",), LEFT_HAND_JOINTS),
    "right_hand": (("joint",), RIGHT_HAND_JOINTS),
    "left_grasp": (("scalar",), ()),
    "right_grasp": (("scalar",), ()),
    "waist": (("joint",), WAIST_JOINTS),
    "base_height": (("scalar",), ()),
    "base_velocity": (("velocity",), ()),
}
"""What a slot may drive, with the kinds it may have and the joints it must list (in any order)."""

_SUFFIXES: dict[Kind, tuple[str, ...]] = {
    "position": ("x", "y", "z"),
    "rot6d": tuple(f"r6_{i}" for i in range(6)),
    "rotvec": ("rx", "ry", "rz"),
    "rpy": ("roll", "pitch", "yaw"),
    "velocity": ("vx", "vy", "wz"),
}


@dataclass(frozen=True, kw_only=True)
class Slot:
    """A run of numbers in the action vector.

    Attributes:
        name: What it drives, a key of `TARGETS`.
        kind: How the numbers are to be read.
        start: Index of its first number.
        size: How many numbers.
        unit: Unit of the numbers, a key of ``UNITS[kind]``.
        frame: Frame that wrist poses are in: the pelvis, the pelvis's upright yaw frame, the torso, or world.
        tcp_offset: Tool point in the wrist frame (axes of ``*_wrist_yaw_link``) whose position is given, [m].
        rot6d_layout: ``rows`` or ``cols``; needed for rot6d, forbidden elsewhere.
        quaternion_order: ``xyzw`` or ``wxyz``; needed for quaternions, forbidden elsewhere.
        mode: What the numbers are relative to; see `policy.action_spec.codec`.
        joint_names: Joints in the order of the numbers; needed for joints, forbidden elsewhere.
        limits: (least, largest) of each number as given, in its unit; None where unlimited. Values are clipped.
        orientation: Of a wrist's rotation: ``given``, or ``free`` where the task does not depend on it, so that what
            is lost of it is no fault. A spec without a free one has the JSON and the hash that it had before.
    """

    name: str
    kind: Kind
    start: int
    size: int
    unit: str
    frame: Frame = "pelvis"
    tcp_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rot6d_layout: Rot6dLayout | None = None
    quaternion_order: QuaternionOrder | None = None
    mode: Mode = "absolute"
    joint_names: tuple[str, ...] = ()
    limits: tuple[tuple[float, float], ...] | None = None
    orientation: Orientation = "given"

    def __post_init__(self) -> None:
        for name, allowed in {"name": TARGETS, "kind": get_args(Kind), "frame": get_args(Frame)}.items():
            one_of(f"slot '{self.name}': {name}", getattr(self, name), allowed)
        one_of(f"slot '{self.name}': mode", self.mode, get_args(Mode))
        one_of(f"slot '{self.name}': orientation", self.orientation, get_args(Orientation))
        kinds, joints = TARGETS[self.name]
        one_of(f"slot '{self.name}': kind", self.kind, kinds)
        units = UNITS[self.kind]
        if self.kind == "scalar":
            units = _HEIGHT_UNITS if self.name == "base_height" else _GRASP_UNITS
        one_of(f"slot '{self.name}': unit", self.unit, units)
        self._check_size(joints)
        self._check_convention("rot6d_layout", "rot6d", get_args(Rot6dLayout))
        self._check_convention("quaternion_order", "quaternion", get_args(QuaternionOrder))
        self._check_numbers()

    @property
    def indices(self) -> slice:
        """Where the slot is in the action vector."""
        return slice(self.start, self.start + self.size)

    def to_si(self, numbers: np.ndarray) -> np.ndarray:
        """Numbers as they are in the action vector, in SI."""
        scale, offset = UNITS[self.kind][self.unit]
        return scale * numbers + offset

    def from_si(self, values: np.ndarray) -> np.ndarray:
        """Inverse of `to_si`."""
        scale, offset = UNITS[self.kind][self.unit]
        return (values - offset) / scale

    @property
    def feature_names(self) -> tuple[str, ...]:
        """LeRobot feature of each number; they end in ``.pos`` or ``.vel``, without which LeRobot drops them."""
        ending = "vel" if self.kind == "velocity" else "pos"
        if self.kind == "joint":
            return tuple(f"{name.removesuffix('_joint')}.{ending}" for name in self.joint_names)
        if self.kind == "scalar":
            return (f"{self.name}.{ending}",)
        owner = self.name.removesuffix("_position").removesuffix("_rotation")
        suffixes = [f"q{c}" for c in self.quaternion_order] if self.quaternion_order else _SUFFIXES[self.kind]
        return tuple(f"{owner}_{suffix}.{ending}" for suffix in suffixes)

    def _check_size(self, joints: tuple[str, ...]) -> None:
        if self.kind == "joint":
            if sorted(self.joint_names) != sorted(joints):
                raise SpecError(
                    f"slot '{self.name}': joint_names {list(self.joint_names)}; "
                    f"each of {list(joints)} is expected once, in the order of the numbers"
                )
        elif self.joint_names:
            raise SpecError(f"slot '{self.name}': joint_names only go with the kind 'joint', not '{self.kind}'")
        expected = len(joints) if self.kind == "joint" else SIZES[self.kind]
        if self.size != expected:
            raise SpecError(f"slot '{self.name}': size {self.size}; the kind '{self.kind}' has {expected} numbers")
        if type(self.start) is not int or type(self.size) is not int or self.start < 0:
            said = f"start {self.start!r:.40} is negative or of the wrong type; start and size are whole numbers"
            raise SpecError(f"slot '{self.name}': {said}")

    def _check_convention(self, field: str, kind: Kind, allowed: tuple[str, ...]) -> None:
        value = getattr(self, field)
        if self.kind == kind:
            one_of(f"slot '{self.name}': {field}", value, allowed)
        elif value is not None:
            raise SpecError(f"slot '{self.name}': {field} only goes with the kind '{kind}', not '{self.kind}'")

    def _check_numbers(self) -> None:
        if len(self.tcp_offset) != 3 or not np.isfinite(self.tcp_offset).all():
            raise SpecError(f"slot '{self.name}': tcp_offset {self.tcp_offset}; three finite metres are expected")
        if np.abs(self.tcp_offset).max() > TCP_OFFSET_MAX:
            raise SpecError(f"slot '{self.name}': tcp_offset {self.tcp_offset} m; at most {TCP_OFFSET_MAX} m are taken")
        if any(self.tcp_offset) and self.kind != "position":
            raise SpecError(f"slot '{self.name}': tcp_offset only goes with a position")
        if self.orientation == "free" and self.kind not in ROTATIONS:
            raise SpecError(f"slot '{self.name}': orientation only goes with a rotation, not with '{self.kind}'")
        if self.mode == "relative_se3" and self.kind != "position" and self.kind not in ROTATIONS:
            raise SpecError(
                f"slot '{self.name}': mode relative_se3 is for poses; use relative_add for the kind '{self.kind}'"
            )
        if self.kind == "velocity" and self.mode != "absolute":
            raise SpecError(f"slot '{self.name}': a velocity is absolute, not '{self.mode}'")
        if self.limits is None:
            return
        if self.kind in ROTATIONS:
            raise SpecError(f"slot '{self.name}': limits on the numbers of a rotation would bend it")
        limits = np.array(self.limits, dtype=float)
        if limits.shape != (self.size, 2) or not (limits[:, 0] <= limits[:, 1]).all():
            raise SpecError(
                f"slot '{self.name}': limits {self.limits}; {self.size} pairs (least, largest) are expected"
            )


def one_of(what: str, value: object, allowed: Iterable[str]) -> None:
    """Refuse a value that is not among those allowed, with the nearest one.

    Raises:
        SpecError: If it is not.
    """
    if value not in allowed:
        raise SpecError(
            f"{what} {value!r:.80} is unknown; {did_you_mean(value, allowed)}possible: {', '.join(allowed)}"
        )
