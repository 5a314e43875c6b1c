"""A slot of an action spec: a run of numbers with one meaning."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from policy.errors import SpecError, did_you_mean
from policy.geometry.rotations import QuaternionOrder, Rot6dLayout

SlotKind = Literal[
    "position", "rot6d", "quaternion", "rotvec", "rpy", "joint", "fingers",
    "scalar", "velocity", "planar", "tilt", "force", "axes", "ignored",
]  # fmt: skip
Mode = Literal["absolute", "relative_se3", "relative_add", "delta", "delta_se3"]
Frame = Literal["pelvis", "pelvis_yaw", "torso", "stance", "world"]
Orientation = Literal["given", "free"]

ROTATIONS: tuple[SlotKind, ...] = ("rot6d", "quaternion", "rotvec", "rpy")
SIZES: dict[SlotKind, int] = {
    "position": 3, "rot6d": 6, "quaternion": 4, "rotvec": 3, "rpy": 3,
    "scalar": 1, "velocity": 3, "planar": 2, "tilt": 2, "force": 3, "axes": 3,
}  # fmt: skip
"""Width of each kind; a slot of joints or fingers is as wide as its list of names, an ignored one as it says."""

SHORT_WAIST, SHORT_ARM = 1, 5
"""Joints of the waist and of an arm that a G1 with 23 joints has, the first ones of a group in motor order."""
FOREIGN_HANDS: dict[str, tuple[str, ...]] = {
    "inspire": ("pinky", "ring", "middle", "index", "thumb_bend", "thumb_rotation"),
    "brainco": ("thumb", "thumb_aux", "index", "middle", "ring", "pinky"),
}
"""Fingers of other hands of the G1 in the order of their messages, a closing number each.

Source:
    unitree_lerobot ``constants.py``: G1_INSPIRE_CONFIG, G1_BRAINCO_CONFIG.
"""
CLOSING = "closing"
"""Unit of a closing number whose slot says what it is where the hand is open, and where it is closed."""

DEX1_OPEN = 5.4
"""Motor angle of the open Dex1 gripper [rad]; 0 is closed. Source: xr_teleoperate ``Dex1_1_Gripper_Controller``."""

UNITS: dict[SlotKind, dict[str, tuple[float, float]]] = {
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
        CLOSING: (1.0, 0.0),
        "m": (1.0, 0.0),
        "cm": (1e-2, 0.0),
        "mm": (1e-3, 0.0),
        "rad/s": (1.0, 0.0),
        "deg/s": (np.pi / 180.0, 0.0),
        "N": (1.0, 0.0),
        "N/m": (1.0, 0.0),
    },
    "force": {"N": (1.0, 0.0)},
    "axes": {"N": (1.0, 0.0), "N/m": (1.0, 0.0)},
    "velocity": {"m/s, rad/s": (1.0, 0.0)},
    "planar": {"m/s": (1.0, 0.0)},
    "tilt": {"rad": (1.0, 0.0), "deg": (np.pi / 180.0, 0.0)},
    "fingers": {CLOSING: (1.0, 0.0)},
    "ignored": {"": (1.0, 0.0)},
}
"""Units of each kind as (scale, offset): SI value = scale * number + offset. A grasp is 0 open, 1 closed."""

TCP_OFFSET_MAX = 2.0
"""Largest distance of a tool point from the wrist, per axis [m]."""
_SCALAR_UNITS = {"base_height": ("m", "cm", "mm"), "base_yaw_rate": ("rad/s", "deg/s")}
OF_TOUCH = ("left_force", "right_force", "left_force_max", "right_force_max", "left_stiffness", "right_stiffness")
"""What slots say of hands that touch something; no state has them."""
_SCALAR_UNITS |= dict.fromkeys(OF_TOUCH[2:4], ("N",)) | dict.fromkeys(OF_TOUCH[4:], ("N/m",))
_MOMENTARY = ("base_yaw_rate", *OF_TOUCH)
_GRASP_UNITS = ("1", "percent", "dex1 rad", CLOSING)

TARGETS: dict[str, tuple[SlotKind, ...]] = {
    "left_wrist_position": ("position",),
    "left_wrist_rotation": ROTATIONS,
    "right_wrist_position": ("position",),
    "right_wrist_rotation": ROTATIONS,
    "left_arm": ("joint",),
    "right_arm": ("joint",),
    "left_hand": ("joint", "fingers"),
    "right_hand": ("joint", "fingers"),
    "left_grasp": ("scalar",),
    "right_grasp": ("scalar",),
    "waist": ("joint",),
    "base_height": ("scalar",),
    "base_velocity": ("velocity", "planar"),
    "base_yaw_rate": ("scalar",),
    "base_tilt": ("tilt",),
    "left_leg": ("joint",),
    "right_leg": ("joint",),
    **dict.fromkeys(OF_TOUCH[:2], ("force",)),
    **dict.fromkeys(OF_TOUCH[2:], ("scalar", "axes")),
}
"""What a slot may drive, with the kinds it may have; joints are those of that part of the robot, in any order."""
SLOTS_MAX = 200
"""Most slots of a spec: every number of the widest known one by itself."""

_SUFFIXES: dict[SlotKind, tuple[str, ...]] = {
    "position": ("x", "y", "z"),
    "rot6d": tuple(f"r6_{i}" for i in range(6)),
    "rotvec": ("rx", "ry", "rz"),
    "rpy": ("roll", "pitch", "yaw"),
    "velocity": ("vx", "vy", "wz"),
    "planar": ("vx", "vy"),
    "tilt": ("roll", "pitch"),
    "force": ("x", "y", "z"),
    "axes": ("x", "y", "z"),
}


@dataclass(frozen=True, kw_only=True)
class Slot:
    """A run of numbers in the action vector.

    Attributes:
        name: What it drives, a key of `TARGETS`; of an ignored slot, any name.
        kind: How the numbers are to be read.
        start: Index of its first number.
        size: How many numbers.
        unit: Unit of the numbers, a key of ``UNITS[kind]``.
        frame: Frame that wrist poses and forces are in: the pelvis, the pelvis's upright yaw frame, the torso, the
            stance (between the soles, level, heading along the feet), or world. A base height in the stance is above
            the soles. Limits and stiffnesses along axes are along those of the stance.
        tcp_offset: Tool point in the wrist frame (axes of ``*_wrist_yaw_link``) whose position is given, [m].
        rot6d_layout: ``rows``, ``cols`` or ``interleaved``; needed for rot6d, forbidden elsewhere.
        quaternion_order: ``xyzw`` or ``wxyz``; needed for quaternions, forbidden elsewhere.
        mode: What the numbers are relative to; see `policy.action_spec.codec`.
        joint_names: Joints in the order of the numbers, or fingers of another hand (`FOREIGN_HANDS`); forbidden
            elsewhere. A G1 with 23 joints has the first of the waist, and the first five of an arm.
        limits: (least, largest) of each number as given, in its unit; None where unlimited. Values are clipped.
        orientation: Of a wrist's rotation: ``given``, or ``free`` where the task does not depend on it, so that what
            is lost of it is no fault.
        closing: Numbers of a hand that is open, and of one that is closed; needed with the unit ``closing``.
        reason: Why the numbers are ignored; needed of an ignored slot.

    What has the default of `orientation`, `closing` or `reason` is not in the JSON: a spec without it has the hash that
    it had before there was such a field.
    """

    name: str
    kind: SlotKind
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
    closing: tuple[float, float] | None = None
    reason: str = ""

    def __post_init__(self) -> None:
        if self.kind == "ignored":
            self._check_ignored()
            return
        for name, allowed in {"name": TARGETS, "kind": get_args(SlotKind), "frame": get_args(Frame)}.items():
            one_of(f"slot '{self.name}': {name}", getattr(self, name), allowed)
        if self.reason:
            raise SpecError(f"slot '{self.name}': a reason only goes with the kind 'ignored', not '{self.kind}'")
        one_of(f"slot '{self.name}': mode", self.mode, get_args(Mode))
        one_of(f"slot '{self.name}': orientation", self.orientation, get_args(Orientation))
        one_of(f"slot '{self.name}': kind", self.kind, TARGETS[self.name])
        units = _SCALAR_UNITS.get(self.name, _GRASP_UNITS) if self.kind in ("scalar", "axes") else UNITS[self.kind]
        one_of(f"slot '{self.name}': unit", self.unit, units)
        if self.kind == "axes":
            one_of(f"slot '{self.name}': of the kind 'axes', frame", self.frame, ("stance",))
        self._check_size()
        self._check_convention("rot6d_layout", "rot6d", get_args(Rot6dLayout))
        self._check_convention("quaternion_order", "quaternion", get_args(QuaternionOrder))
        self._check_closing()
        self._check_numbers()

    @property
    def indices(self) -> slice:
        """Where the slot is in the action vector."""
        return slice(self.start, self.start + self.size)

    def to_si(self, numbers: np.ndarray) -> np.ndarray:
        """Numbers as they are in the action vector, in SI."""
        scale, offset = self._scale
        return scale * numbers + offset

    def from_si(self, values: np.ndarray) -> np.ndarray:
        """Inverse of `to_si`."""
        scale, offset = self._scale
        return (values - offset) / scale

    @property
    def _scale(self) -> tuple[float, float]:
        if self.closing is None:
            return UNITS[self.kind][self.unit]
        is_open, closed = self.closing
        return 1.0 / (closed - is_open), -is_open / (closed - is_open)

    @property
    def feature_names(self) -> tuple[str, ...]:
        """LeRobot feature of each number; they end in ``.pos`` or ``.vel``, without which LeRobot drops them."""
        ending = "vel" if self.kind in ("velocity", "planar") or self.name == "base_yaw_rate" else "pos"
        if self.kind == "joint":
            return tuple(f"{name.removesuffix('_joint')}.{ending}" for name in self.joint_names)
        if self.kind == "fingers":
            return tuple(f"{self.name}_{finger}.{ending}" for finger in self.joint_names)
        if self.kind == "ignored":
            return tuple(f"{self.name}_{i}.{ending}" for i in range(self.size))
        if self.kind == "scalar":
            return (f"{self.name}.{ending}",)
        owner = self.name.removesuffix("_position").removesuffix("_rotation")
        suffixes = [f"q{c}" for c in self.quaternion_order] if self.quaternion_order else _SUFFIXES[self.kind]
        return tuple(f"{owner}_{suffix}.{ending}" for suffix in suffixes)

    def check_joints(self, joints: tuple[str, ...]) -> None:
        """Refuse a slot of joints, or of fingers, that does not list these, or those of a known hand, once each.

        Raises:
            SpecError: If it does not.
        """
        if self.kind in ("joint", "fingers"):
            self._check_names(joints)

    def _check_size(self) -> None:
        if self.kind not in ("joint", "fingers") and self.joint_names:
            raise SpecError(f"slot '{self.name}': joint_names only go with the kind 'joint', not '{self.kind}'")
        expected = len(self.joint_names) if self.kind in ("joint", "fingers") else SIZES[self.kind]
        if self.size != expected:
            raise SpecError(f"slot '{self.name}': size {self.size}; the kind '{self.kind}' has {expected} numbers")
        if type(self.start) is not int or type(self.size) is not int or self.start < 0:
            text = f"start {self.start!r:.40} is negative or of the wrong type; start and size are whole numbers"
            raise SpecError(f"slot '{self.name}': {text}")

    def _check_names(self, joints: tuple[str, ...]) -> None:
        short = {"waist": SHORT_WAIST, "left_arm": SHORT_ARM, "right_arm": SHORT_ARM}.get(self.name, len(joints))
        possible = [joints, joints[:short]] if self.kind == "joint" else list(FOREIGN_HANDS.values())
        if sorted(self.joint_names) not in map(sorted, possible):
            known = list(joints) if self.kind == "joint" else " or of ".join(str(list(names)) for names in possible)
            raise SpecError(
                f"slot '{self.name}': joint_names {list(self.joint_names)}; "
                f"each of {known} is expected once, in the order of the numbers"
            )

    def _check_ignored(self) -> None:
        if self.name in TARGETS or not isinstance(self.name, str) or not self.name.isidentifier():
            raise SpecError(f"slot '{self.name}': an ignored slot has a name of its own, of letters, digits and _")
        if not isinstance(self.reason, str) or not self.reason.strip() or not self.reason.isprintable():
            raise SpecError(f"slot '{self.name}': what is ignored needs a 'reason', which every answer repeats")
        if self.unit:
            raise SpecError(f"slot '{self.name}': ignored numbers have no unit, so unit is ''")
        if type(self.start) is not int or type(self.size) is not int or self.start < 0 or self.size < 1:
            raise SpecError(f"slot '{self.name}': start {self.start!r:.40}, size {self.size!r:.40} are no place")

    def _check_closing(self) -> None:
        if (self.closing is not None) != (self.unit == CLOSING):
            raise SpecError(f"slot '{self.name}': the unit '{CLOSING}' and 'closing' [open, closed] only go together")
        if self.closing is not None:
            ends = np.array(self.closing, dtype=float)
            if ends.shape != (2,) or not np.isfinite(ends).all() or abs(ends[1] - ends[0]) < 1e-6:
                raise SpecError(f"slot '{self.name}': closing {self.closing}; two numbers, open and closed, are meant")

    def _check_convention(self, field: str, kind: SlotKind, allowed: tuple[str, ...]) -> None:
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
        if self.mode in ("relative_se3", "delta_se3") and self.kind != "position" and self.kind not in ROTATIONS:
            other = "relative_add" if self.mode == "relative_se3" else "delta"
            raise SpecError(
                f"slot '{self.name}': mode {self.mode} is for poses; use {other} for the kind '{self.kind}'"
            )
        if self.mode != "absolute" and (self.kind in ("velocity", "planar", "tilt") or self.name in _MOMENTARY):
            raise SpecError(f"slot '{self.name}': a {self.kind} is absolute, not '{self.mode}'")
        if self.limits is None:
            return
        if self.kind in ROTATIONS:
            raise SpecError(f"slot '{self.name}': limits on the numbers of a rotation would bend it")
        limits = np.array(self.limits, dtype=float)
        if limits.shape != (self.size, 2) or not (limits[:, 0] <= limits[:, 1]).all():
            raise SpecError(
                f"slot '{self.name}': limits {self.limits}; {self.size} pairs (least, largest) are expected"
            )


def one_of(what: str, value: object, allowed: Collection[str]) -> None:
    """Refuse a value that is not among those allowed, with the nearest one.

    Raises:
        SpecError: If it is not.
    """
    if value not in allowed:
        raise SpecError(
            f"{what} {value!r:.80} is unknown; {did_you_mean(value, allowed)}possible: {', '.join(allowed)}"
        )
