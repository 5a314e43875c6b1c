"""Action specs: what every number of a raw action vector means, as a versioned, hashed contract.

Equal dimension is never compatibility. Two layouts of 32 numbers can differ in frame, in tool point, in finger order,
or by a transpose of the rotation, and nothing in the numbers says so; `require_same` compares hashes.
"""

from __future__ import annotations

import dataclasses
import difflib
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np

from policy.errors import SpecError
from policy.joints import (
    LEFT_ARM_JOINTS,
    LEFT_HAND_JOINTS,
    RIGHT_ARM_JOINTS,
    RIGHT_HAND_JOINTS,
    WAIST_JOINTS,
)
from policy.rotations import QuaternionOrder, Rot6dLayout

Kind = Literal["position", "rot6d", "quaternion", "rotvec", "rpy", "joint", "scalar", "velocity"]
Mode = Literal["absolute", "relative_se3", "relative_add", "delta"]
Frame = Literal["pelvis", "pelvis_yaw", "torso", "world"]

ROTATIONS: tuple[Kind, ...] = ("rot6d", "quaternion", "rotvec", "rpy")
SIZES: dict[Kind, int] = {"position": 3, "rot6d": 6, "quaternion": 4, "rotvec": 3, "rpy": 3, "scalar": 1, "velocity": 3}
"""Width of each kind; a joint slot is as wide as its list of joints."""

UNITS: dict[Kind, dict[str, float]] = {
    "position": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "rot6d": {"1": 1.0},
    "quaternion": {"1": 1.0},
    "rotvec": {"rad": 1.0, "deg": np.pi / 180.0},
    "rpy": {"rad": 1.0, "deg": np.pi / 180.0},
    "joint": {"rad": 1.0, "deg": np.pi / 180.0},
    "scalar": {"1": 1.0, "percent": 1e-2, "m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "velocity": {"m/s, rad/s": 1.0},
}
"""Units of each kind with their size in SI."""

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
        mode: What the numbers are relative to; see `policy.codec`.
        joint_names: Joints in the order of the numbers; needed for joints, forbidden elsewhere.
        limits: (least, largest) of each number as given, in its unit; None where unlimited. Values are clipped.
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

    def __post_init__(self) -> None:
        for name, allowed in {"name": TARGETS, "kind": get_args(Kind), "frame": get_args(Frame)}.items():
            _one_of(f"slot '{self.name}': {name}", getattr(self, name), allowed)
        _one_of(f"slot '{self.name}': mode", self.mode, get_args(Mode))
        kinds, joints = TARGETS[self.name]
        _one_of(f"slot '{self.name}': kind", self.kind, kinds)
        _one_of(f"slot '{self.name}': unit", self.unit, UNITS[self.kind])
        self._check_size(joints)
        self._check_convention("rot6d_layout", "rot6d", get_args(Rot6dLayout))
        self._check_convention("quaternion_order", "quaternion", get_args(QuaternionOrder))
        self._check_numbers()

    @property
    def indices(self) -> slice:
        """Where the slot is in the action vector."""
        return slice(self.start, self.start + self.size)

    @property
    def scale(self) -> float:
        """Size of the unit in SI."""
        return UNITS[self.kind][self.unit]

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
        if self.start < 0:
            raise SpecError(f"slot '{self.name}': start {self.start} is negative")

    def _check_convention(self, field: str, kind: Kind, allowed: tuple[str, ...]) -> None:
        value = getattr(self, field)
        if self.kind == kind:
            _one_of(f"slot '{self.name}': {field}", value, allowed)
        elif value is not None:
            raise SpecError(f"slot '{self.name}': {field} only goes with the kind '{kind}', not '{self.kind}'")

    def _check_numbers(self) -> None:
        if len(self.tcp_offset) != 3 or not np.isfinite(self.tcp_offset).all():
            raise SpecError(f"slot '{self.name}': tcp_offset {self.tcp_offset}; three finite metres are expected")
        if any(self.tcp_offset) and self.kind != "position":
            raise SpecError(f"slot '{self.name}': tcp_offset only goes with a position")
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


@dataclass(frozen=True, kw_only=True)
class ActionSpec:
    """The layout of a raw action ``(H, A)``.

    Attributes:
        name: What people call it; not part of the hash.
        version: Version of the layout.
        fps: Steps per second of a chunk [Hz].
        horizon: Steps of a chunk.
        slots: In the order of the numbers, without gap or overlap.
    """

    name: str
    version: int = 1
    fps: float = 30.0
    horizon: int = 50
    slots: tuple[Slot, ...]

    def __post_init__(self) -> None:
        if not self.fps > 0.0 or not np.isfinite(self.fps):
            raise SpecError(f"spec '{self.name}': fps {self.fps}; a positive rate in Hz is expected")
        if self.horizon < 1 or self.version < 1:
            raise SpecError(f"spec '{self.name}': horizon {self.horizon} and version {self.version} must be at least 1")
        names = [slot.name for slot in self.slots]
        doubled = sorted({name for name in names if names.count(name) > 1})
        if doubled:
            raise SpecError(f"spec '{self.name}': slots {doubled} occur twice")
        at = 0
        for slot in self.slots:
            if slot.start != at:
                raise SpecError(f"spec '{self.name}': slot '{slot.name}' starts at {slot.start}; {at} is next")
            at += slot.size
        self._check_sides()

    @property
    def dim(self) -> int:
        """Length A of the action vector."""
        return sum(slot.size for slot in self.slots)

    @property
    def feature_names(self) -> tuple[str, ...]:
        """LeRobot feature of each number, length A."""
        return tuple(name for slot in self.slots for name in slot.feature_names)

    @cached_property
    def hash(self) -> str:
        """SHA-256 of everything that gives the numbers a meaning (all but the name), 64 hexadecimal digits."""
        content = {key: value for key, value in self.to_dict().items() if key != "name"}
        canonical = json.dumps(content, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(canonical.encode()).hexdigest()

    @property
    def id(self) -> str:
        """Name, version and the first digits of the hash, as in ``wbc32-v1-0a1b2c3d4e5f``."""
        return f"{self.name}-v{self.version}-{self.hash[:12]}"

    def slot(self, name: str) -> Slot | None:
        """The slot that drives something, or None."""
        return next((slot for slot in self.slots if slot.name == name), None)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; `from_dict` gives the same spec back."""
        return json.loads(json.dumps(dataclasses.asdict(self)))

    def to_json(self) -> str:
        """JSON text, indented, with the hash beside the content so that an edited file is noticed."""
        return json.dumps({**self.to_dict(), "hash": self.hash}, indent=2)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> ActionSpec:
        """Spec from plain data.

        Raises:
            SpecError: If a key is unknown or missing, a value impossible, or the hash beside it another.
        """
        data = dict(data)
        stated = data.pop("hash", None)
        slots = data.pop("slots", None)
        if not isinstance(slots, list) or not all(isinstance(slot, Mapping) for slot in slots):
            raise SpecError("a spec needs 'slots', a list of objects")
        spec = _build(cls, {**data, "slots": tuple(_build(Slot, slot) for slot in slots)}, "spec")
        if stated is not None and stated != spec.hash:
            raise SpecError(
                f"spec '{spec.name}' says hash {stated}, its content has {spec.hash}: it was edited; "
                "remove the hash if the change is meant"
            )
        return spec

    @classmethod
    def from_json(cls, text: str) -> ActionSpec:
        """Spec from JSON text.

        Raises:
            SpecError: If the text is no JSON object, or as in `from_dict`.
        """
        try:
            data = json.loads(text)
        except json.JSONDecodeError as error:
            raise SpecError(f"the spec is no JSON: {error}") from error
        if not isinstance(data, dict):
            raise SpecError(f"the spec is a JSON {type(data).__name__}; an object is expected")
        return cls.from_dict(data)

    def _check_sides(self) -> None:
        for side in ("left", "right"):
            if self.slot(f"{side}_wrist_position") is None and self.slot(f"{side}_arm") is None:
                raise SpecError(
                    f"spec '{self.name}' does not say where the {side} hand goes: it needs a slot "
                    f"'{side}_wrist_position' or '{side}_arm'"
                )
            if self.slot(f"{side}_arm") and (
                self.slot(f"{side}_wrist_position") or self.slot(f"{side}_wrist_rotation")
            ):
                raise SpecError(f"spec '{self.name}' gives both joints and a wrist pose for the {side} arm")
            if self.slot(f"{side}_hand") and self.slot(f"{side}_grasp"):
                raise SpecError(f"spec '{self.name}' gives both '{side}_hand' and '{side}_grasp'")


def require_same(expected: ActionSpec, found: ActionSpec | str | None, *, assume: bool = False) -> None:
    """Handshake between a producer of actions and their consumer.

    Args:
        expected: What the consumer decodes.
        found: Spec or hash that comes with the actions, None if nothing does.
        assume: The user vouches that the actions are as expected (``--assume-spec``).

    Raises:
        SpecError: If the hash is missing or another, and the user does not vouch.
    """
    if assume:
        return
    if found is None:
        raise SpecError(
            f"the actions come without a spec; {expected.dim} numbers alone do not say what they mean. "
            f"If they are '{expected.name}', say --assume-spec {expected.name}"
        )
    if isinstance(found, ActionSpec):
        if found.hash == expected.hash:
            return
        raise SpecError(f"spec '{found.name}' is not '{expected.name}': {'; '.join(differences(expected, found))}")
    if found != expected.hash:
        raise SpecError(
            f"the actions have spec hash {found[:12]}, '{expected.name}' has {expected.hash[:12]}: the layouts differ "
            "even where the dimension does not; decode them with their own spec, or say --assume-spec"
        )


def differences(expected: ActionSpec, found: ActionSpec) -> list[str]:
    """What differs between two specs, one sentence for each field, in the order of the slots."""
    said = [
        f"{field} is {getattr(found, field)}, expected {getattr(expected, field)}"
        for field in ("version", "fps", "horizon", "dim")
        if getattr(found, field) != getattr(expected, field)
    ]
    for slot in expected.slots:
        other = found.slot(slot.name)
        if other is None:
            said.append(f"slot '{slot.name}' is missing")
            continue
        for field in dataclasses.fields(Slot):
            mine, theirs = getattr(slot, field.name), getattr(other, field.name)
            if mine != theirs:
                said.append(f"slot '{slot.name}' has {field.name} {theirs}, expected {mine}")
    known = [slot.name for slot in expected.slots]
    said += [f"slot '{slot.name}' is not expected" for slot in found.slots if slot.name not in known]
    return said


def _one_of(what: str, value: object, allowed: Any) -> None:
    if value not in allowed:
        near = difflib.get_close_matches(str(value), list(allowed), n=1)
        hint = f"did you mean '{near[0]}'? " if near else ""
        raise SpecError(f"{what} {value!r} is unknown; {hint}possible: {', '.join(allowed)}")


def _build[T: (ActionSpec, Slot)](kind: type[T], data: Mapping[str, Any], what: str = "slot") -> T:
    fields = {field.name: field for field in dataclasses.fields(kind)}
    for key in data:
        _one_of(f"{what}: key", key, fields)
    missing = [name for name, field in fields.items() if field.default is dataclasses.MISSING and name not in data]
    if missing:
        raise SpecError(f"{what}: keys {missing} are missing")
    try:
        return kind(**{key: _tuples(value) for key, value in data.items()})
    except TypeError as error:
        raise SpecError(f"{what} {data.get('name', '')!r}: a value has the wrong type ({error})") from error


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value
