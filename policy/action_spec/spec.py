"""Action specs: what every number of a raw action vector means, as a versioned, hashed contract.

Equal dimension is never compatibility. Two layouts of 32 numbers can differ in frame, in tool point, in finger order,
or by a transpose of the rotation, and nothing in the numbers says so; `require_same` compares hashes.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from models import g1
from models.spec import RobotSpec
from policy.action_spec.slot import SLOTS_MAX, Slot, one_of
from policy.errors import SpecError, printable
from policy.joints import joints_of
from policy.reading import FPS_MAX, FPS_MIN, HORIZON_MAX, ReadingError, parse_json, require_depth

NAME_MAX = 100
"""Most characters of a name."""
VERSION_MAX = 1_000_000
_KEYS = ("name", "version", "fps", "horizon", "masked")


@dataclass(frozen=True, kw_only=True)
class ActionSpec:
    """The layout of a raw action ``(H, A)``.

    Attributes:
        name: What people call it; not part of the hash.
        version: Version of the layout.
        fps: Steps per second of a chunk [Hz].
        horizon: Steps of a chunk.
        slots: In the order of the numbers, without gap or overlap; what is not used is a slot of the kind ``ignored``.
        masked: Whether a mask comes with each chunk that says which of the numbers are there, as UnifoLM-WLA has it.
        robot: The robot whose joints they are, the G1 with Dex3 hands if not given; not part of JSON and hash, which
            have the joints by name.
    """

    name: str
    version: int = 1
    fps: float = 30.0
    horizon: int = 50
    slots: tuple[Slot, ...]
    masked: bool = False
    robot: RobotSpec = field(default_factory=g1, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or len(self.name) > NAME_MAX or not self.name.isprintable():
            raise SpecError(f"a spec's name is {self.name!r:.90}; up to {NAME_MAX} printable characters are expected")
        if isinstance(self.fps, bool) or not FPS_MIN <= self.fps <= FPS_MAX:
            text = f"fps {self.fps}; a positive rate in Hz is expected, {FPS_MIN:g} to {FPS_MAX:g}"
            raise SpecError(f"spec '{self.name}': {text}")
        for name, most in (("horizon", HORIZON_MAX), ("version", VERSION_MAX)):
            if type(getattr(self, name)) is not int or not 1 <= getattr(self, name) <= most:
                sentence = f"{name} {getattr(self, name)!r:.40} must be at least 1 and at most {most}, a whole number"
                raise SpecError(f"spec '{self.name}': {sentence}")
        if not isinstance(self.masked, bool):
            raise SpecError(f"spec '{self.name}': masked is {self.masked!r:.40}; true or false is expected")
        names = [slot.name for slot in self.slots]
        doubled = sorted({name for name in names if names.count(name) > 1})
        if doubled:
            raise SpecError(f"spec '{self.name}': slots {doubled} occur twice")
        at = 0
        for slot in self.slots:
            if slot.start != at:
                raise SpecError(
                    f"spec '{self.name}': slot '{slot.name}' starts at {slot.start}; {at} is next. Numbers that are "
                    'not used are a slot of the kind "ignored", with a "reason"'
                )
            at += slot.size
            if slot.kind in ("joint", "fingers"):
                slot.check_joints(joints_of(self.robot, slot.name))
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

    @property
    def said_ignored(self) -> tuple[str, ...]:
        """A sentence for each slot whose numbers are not used."""
        ignored = (slot for slot in self.slots if slot.kind == "ignored")
        return tuple(f"{slot.name.removeprefix('no_')} is ignored: {slot.reason}" for slot in ignored)

    def without(self, names: Iterable[str], reason: str) -> ActionSpec:
        """Layout with some slots ignored, for a reason.

        Raises:
            SpecError: If there is no such slot, or a hand would have no place to go.
        """
        names = set(names)
        for name in names:
            one_of(f"spec '{self.name}': slot", name, [slot.name for slot in self.slots])
        slots = tuple(
            Slot(name=f"no_{slot.name}", kind="ignored", start=slot.start, size=slot.size, unit="", reason=reason)
            if slot.name in names
            else slot
            for slot in self.slots
        )
        return dataclasses.replace(self, slots=slots)

    @property
    def orientation_free(self) -> tuple[bool, bool]:
        """Whether the left and the right wrist may be turned as is convenient; also where no slot says how."""
        return self._is_free("left"), self._is_free("right")

    def _is_free(self, side: str) -> bool:
        slot = self.slot(f"{side}_wrist_rotation")
        return (slot is None or slot.orientation == "free") and self.slot(f"{side}_arm") is None

    def with_free_orientation(self) -> ActionSpec:
        """Layout for tasks that do not depend on the orientations of the wrists."""
        slots = (
            dataclasses.replace(slot, orientation="free") if slot.name.endswith("_wrist_rotation") else slot
            for slot in self.slots
        )
        return dataclasses.replace(self, slots=tuple(slots))

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; `from_dict` gives the same spec back."""
        data = {name: getattr(self, name) for name in _KEYS} | {"slots": [dataclasses.asdict(s) for s in self.slots]}
        data = json.loads(json.dumps(data))
        for slot in data["slots"]:
            # Specs from before there were such fields keep their JSON and their hash.
            for key, default in (("orientation", "given"), ("closing", None), ("reason", "")):
                if slot[key] == default:
                    del slot[key]
        if not data["masked"]:
            del data["masked"]
        return data

    def to_json(self) -> str:
        """JSON text, indented, with the hash beside the content so that an edited file is noticed."""
        return json.dumps({**self.to_dict(), "hash": self.hash}, indent=2)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], robot: RobotSpec | None = None) -> ActionSpec:
        """Spec of a robot, the G1 with Dex3 hands if not given, from plain data.

        Raises:
            SpecError: If a key is unknown or missing, a value impossible, or the hash beside it another.
        """
        data = dict(data)
        stated = data.pop("hash", None)
        slots = data.pop("slots", None)
        if not isinstance(slots, list) or not all(isinstance(slot, Mapping) for slot in slots):
            raise SpecError("a spec needs 'slots', a list of objects")
        if len(slots) > SLOTS_MAX:
            raise SpecError(f"a spec has {len(slots)} slots; at most {SLOTS_MAX} are read")
        try:
            require_depth([*slots, data])
        except ReadingError as error:
            raise SpecError(f"the spec {error}") from error
        slots = tuple(_build(Slot, slot, [known.name for known in dataclasses.fields(Slot)]) for slot in slots)
        spec = _build(cls, {**data, "slots": slots}, [*_KEYS, "slots"], "spec", robot=robot or g1())
        if stated is not None and stated != spec.hash:
            raise SpecError(
                f"spec '{spec.name}' says hash {stated}, its content has {spec.hash}: it was edited; "
                "remove the hash if the change is meant"
            )
        return spec

    @classmethod
    def from_json(cls, text: str, robot: RobotSpec | None = None) -> ActionSpec:
        """Spec of a robot, the G1 with Dex3 hands if not given, from JSON text.

        Raises:
            SpecError: If the text is no JSON object, or as in `from_dict`.
        """
        try:
            data = parse_json(text)
        except ReadingError as error:
            raise SpecError(f"the spec {error}") from error
        if not isinstance(data, dict):
            raise SpecError(f"the spec is a JSON {type(data).__name__}; an object is expected")
        return cls.from_dict(data, robot)

    def _check_sides(self) -> None:
        for side in ("left", "right"):
            if self.masked:
                continue  # which of a side's slots are there, the mask of each chunk says
            if self.slot(f"{side}_wrist_position") is None and self.slot(f"{side}_arm") is None:
                raise SpecError(
                    f"spec '{self.name}' does not say where the {side} hand goes: it needs a slot "
                    f"'{side}_wrist_position' or '{side}_arm'"
                )
            position, rotation = self.slot(f"{side}_wrist_position"), self.slot(f"{side}_wrist_rotation")
            if rotation and not position:
                raise SpecError(f"spec '{self.name}' gives a rotation but no position for the {side} wrist")
            if rotation and position and rotation.frame != position.frame:
                raise SpecError(
                    f"spec '{self.name}': the {side} wrist's position is in the frame '{position.frame}', "
                    f"its rotation in '{rotation.frame}'; both must be in one"
                )
            if self.slot(f"{side}_hand") and self.slot(f"{side}_grasp"):
                raise SpecError(f"spec '{self.name}' gives both '{side}_hand' and '{side}_grasp'")


def require_same(expected: ActionSpec, found: ActionSpec | str | None) -> None:
    """Handshake between a producer of actions and their consumer.

    Args:
        expected: What the consumer decodes.
        found: Spec or hash that comes with the actions, None if nothing does.

    Raises:
        SpecError: If the hash is missing or another.
    """
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
    text = [
        f"{field} is {getattr(found, field)}, expected {getattr(expected, field)}"
        for field in ("version", "fps", "horizon", "dim")
        if getattr(found, field) != getattr(expected, field)
    ]
    for slot in expected.slots:
        other = found.slot(slot.name)
        if other is None:
            text.append(f"slot '{slot.name}' is missing")
            continue
        for key in [known.name for known in dataclasses.fields(Slot)]:
            mine, theirs = getattr(slot, key), getattr(other, key)
            if mine != theirs:
                text.append(f"slot '{slot.name}' has {key} {theirs}, expected {mine}")
    known = [slot.name for slot in expected.slots]
    text += [f"slot '{slot.name}' is not expected" for slot in found.slots if slot.name not in known]
    return text


def _build[T: (ActionSpec, Slot)](
    kind: type[T], data: Mapping[str, Any], keys: list[str], what: str = "slot", **more: Any
) -> T:
    fields = {known.name: known for known in dataclasses.fields(kind) if known.name in keys}
    for key in data:
        one_of(f"{what}: key", key, fields)
    missing = [name for name, known in fields.items() if known.default is dataclasses.MISSING and name not in data]
    if missing:
        raise SpecError(f"{what}: keys {missing} are missing")
    values: dict[str, Any] = {key: _tuples(value) for key, value in data.items()}
    try:
        return kind(**values, **more)
    except SpecError:
        raise
    except (TypeError, ValueError, OverflowError) as error:
        name = printable(repr(data.get("name", "")), 80)
        raise SpecError(f"{what} {name}: a value has the wrong type ({error})") from error


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value
