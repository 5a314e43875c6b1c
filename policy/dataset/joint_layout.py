"""What the columns of a joint-space vector are, from the names that a dataset or a robot gives them.

Columns are mapped by name, never by position (`policy.dataset.naming.meaning`). A Dex1 gripper is one column, an
Inspire or BrainCo hand six; what is no joint is left out, and why is said.

Source:
    unitree_lerobot ``utils/constants.py`` (G1_DEX3_CONFIG, G1_DEX1_CONFIG) and ``convert_unitree_json_to_lerobot.py``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.action_spec.builtin import LAYOUTS, builtin
from policy.action_spec.parts import fingers, joints, scalar, stack
from policy.action_spec.public import BRAINCO, INSPIRE
from policy.action_spec.slot import FOREIGN_HANDS, SHORT_ARM, SHORT_WAIST
from policy.action_spec.spec import ActionSpec
from policy.dataset.naming.meaning import (
    FOREIGN_FINGERS,
    GRASPS,
    SIDES,
    UNITREE_DEX3,
    Meaning,
    meaning,
    parted_names,
    says_nothing,
)
from policy.dataset.naming.vouched import column_names, require_same_names
from policy.errors import DatasetError, did_you_mean
from policy.joints import joints_of
from policy.reading import listed

LEGS = ("left_leg", "right_leg")
_CLOSINGS = {"inspire": INSPIRE, "brainco": BRAINCO}


@dataclass(frozen=True)
class JointLayout:
    """Columns of a joint-space vector, each a joint, a gripper, a finger of another hand, or left out.

    Attributes:
        names: Canonical name of each column: a joint of the G1, ``left_grasp``, ``left_hand_pinky``; empty if it is
            left out.
        given: Names as the source spells them.
        unit: Unit of the joint columns, ``rad`` or ``deg``; grippers are Dex1 motor angles [rad], fingers of other
            hands closing numbers.
        reasons: Why each column is left out; empty texts where it is not, nothing if none is.
        robot: The robot; the G1 with Dex3 hands if not given.
    """

    names: tuple[str, ...]
    given: tuple[str, ...]
    unit: str = "rad"
    reasons: tuple[str, ...] = ()
    robot: RobotSpec = field(default_factory=g1, repr=False)

    @property
    def dim(self) -> int:
        """Number of columns."""
        return len(self.names)

    @property
    def has_waist(self) -> bool:
        """Whether the waist is there: all its joints, or the one that a G1 with 23 joints has."""
        waist = joints_of(self.robot, "waist")
        return bool(waist) and waist[0] in self.names

    @property
    def has_legs(self) -> bool:
        """Whether both legs are there."""
        return all(name in self.names for leg in LEGS for name in joints_of(self.robot, leg))

    @property
    def dex1(self) -> bool:
        """Whether the hands are grippers, one number each."""
        return GRASPS[0] in self.names

    @property
    def hand(self) -> str:
        """``own`` of the robot, as Dex3 of the G1, ``dex1``, ``inspire``, ``brainco``, or nothing without hands."""
        if self.dex1:
            return "dex1"
        if any(name in self.names for name in fingers_of(self.robot)):
            return "own"
        return next((hand for hand in FOREIGN_HANDS if f"left_hand_{FOREIGN_HANDS[hand][4]}" in self.names), "")

    @property
    def spec(self) -> ActionSpec:
        """Layout of the vector without legs, in the order arms, hands, waist; joints in the layout's unit."""
        parts = self._parts()
        name = f"joint{sum(part['size'] for part in parts)}"
        return ActionSpec(name=name, slots=stack(*parts), robot=self.robot)

    @property
    def whole_spec(self) -> ActionSpec:
        """Layout of the vector with its legs, if it has them, behind the rest."""
        legs = [joints(self.robot, leg) | {"unit": self.unit} for leg in LEGS] if self.has_legs else []
        parts = [*self._parts(), *legs]
        name = f"joint{sum(part['size'] for part in parts)}"
        return ActionSpec(name=name, slots=stack(*parts), robot=self.robot)

    @property
    def columns(self) -> np.ndarray:
        """Indices such that ``x_spec = x_source[..., columns]``, shape (spec.dim,)."""
        return self.columns_of(self.spec)

    def columns_of(self, spec: ActionSpec) -> np.ndarray:
        """Indices such that ``x_spec = x_source[..., columns]`` for `spec` or `whole_spec`, shape (dim,)."""
        wanted = []
        for slot in spec.slots:
            if slot.kind == "fingers":
                wanted += [f"{slot.name}_{finger}" for finger in slot.joint_names]
            else:
                wanted += slot.joint_names or (slot.name,)
        return np.array([self.names.index(name) for name in wanted], dtype=int)

    @property
    def left_out(self) -> dict[str, list[str]]:
        """Names of columns that are left out, as the source spells them, by the reason."""
        found: dict[str, list[str]] = {}
        for name, reason in zip(self.given, self.reasons, strict=False):
            if reason:
                found.setdefault(reason, []).append(name)
        return found

    def _parts(self) -> list[dict]:
        present = {
            part: sum(name in self.names for name in joints_of(self.robot, part))
            for part in ("left_arm", "right_arm", "waist")
        }
        arms = [joints(self.robot, part, first=present[part]) for part in ("left_arm", "right_arm")]
        hands: list[dict] = []
        if self.dex1:
            hands = [scalar("left_grasp", "dex1 rad"), scalar("right_grasp", "dex1 rad")]
        elif self.hand == "own":
            hands = [joints(self.robot, "left_hand"), joints(self.robot, "right_hand")]
        elif self.hand:
            hands = [fingers(side, self.hand, *_CLOSINGS[self.hand]) for side in SIDES]
        parts = [*arms, *hands, *([joints(self.robot, "waist", first=present["waist"])] if self.has_waist else [])]
        return [part | {"unit": self.unit} if part["kind"] == "joint" else part for part in parts]


def arms_of(robot: RobotSpec) -> tuple[str, ...]:
    """Names of the joints of both arms."""
    return (*joints_of(robot, "left_arm"), *joints_of(robot, "right_arm"))


def fingers_of(robot: RobotSpec) -> tuple[str, ...]:
    """Names of the joints of both hands."""
    return (*joints_of(robot, "left_hand"), *joints_of(robot, "right_hand"))


def joint_layout(
    names: object, dim: int, *, feature: str = "action", assume: ActionSpec | None = None, unit: str = "rad",
    parts: Sequence[str] = (), robot: RobotSpec | None = None,
) -> JointLayout:  # fmt: skip
    """Layout of a feature from its names.

    Args:
        names: As in ``meta/info.json``, in any form of `policy.dataset.naming.meaning.flat_names`.
        dim: Number of columns that the feature says it has.
        feature: Its name, for messages.
        assume: Joint layout that the user vouches for (``--assume-spec joint28``); needed where there are no names.
        unit: Unit of the joint columns, ``rad`` or ``deg``.
        parts: Part of the body that each column is in, where the names are a flat list.
        robot: The robot; the G1 with Dex3 hands if None.

    Raises:
        DatasetError: If a name is unknown, missing or occurs twice, or the order or number contradicts what is said.
    """
    if unit not in ("rad", "deg"):
        raise DatasetError(f"unit '{unit}' is unknown; it is 'rad' or 'deg'")
    named = tuple(zip(parts, names, strict=True)) if parts else parted_names(names)
    given, robot = tuple(name for _, name in named), robot or g1()
    if assume is not None:
        return _assumed(named, dim, feature, assume, unit, robot)
    if says_nothing(given, dim):
        raise DatasetError(
            f"'{feature}' has {dim} columns without names; equal size does not say which joints they are. "
            f"If you know the layout, {_by_width(dim, robot)}",
            feature=feature,
        )
    if len(given) != dim:
        raise DatasetError(
            f"'{feature}' has {dim} columns but {len(given)} names; there must be one name a column", feature=feature
        )
    found = [_known(name, part, feature, robot, dim) for part, name in named]
    layout = JointLayout(tuple(one.name for one in found), given, unit, tuple(one.reason for one in found), robot)
    _check_complete(layout, feature)
    return layout


def _known(name: str, part: str, feature: str, robot: RobotSpec, dim: int) -> Meaning:
    found = meaning(name, part, robot)
    if found.name or found.reason:
        return found
    near = did_you_mean(name, (*UNITREE_DEX3, "kLeftGripper", "kRightGripper", *robot.joint_names))
    raise DatasetError(
        f"'{feature}' has a column '{name}', which is no joint of the G1 with Dex3 hands or Dex1 grippers, and no "
        f"finger of an Inspire or BrainCo hand; {near}correct it in meta/info.json; if the names say nothing, "
        f"{_by_width(dim, robot)}",
        feature=feature,
    )


def _by_width(dim: int, robot: RobotSpec) -> str:
    """What a user who knows the layout may say of so many numbers."""
    fitting = [name for name in LAYOUTS if builtin(name, robot).dim == dim]
    known = f"layouts with {dim} numbers: {', '.join(fitting)}" if fitting else f"no layout has {dim} numbers"
    named = f"--assume-spec {fitting[0]} or a JSON file" if fitting else "--assume-spec with a JSON file"
    return f"say {named} of your own ({known}; `wholebody layouts --from` looks which fit)"


def _check_complete(layout: JointLayout, feature: str) -> None:
    there = [name for name in layout.names if name]
    if not there:
        reasons = "; ".join(f"{listed(names, 4)}: {reason}" for reason, names in layout.left_out.items())
        raise DatasetError(
            f"'{feature}' has no joints ({reasons}). If you know the layout, {_by_width(layout.dim, layout.robot)}",
            feature=feature,
        )
    doubled = sorted({name for name in there if there.count(name) > 1})
    if doubled:
        raise DatasetError(
            f"'{feature}' has two columns for {', '.join(doubled)}: correct the names in meta/info.json",
            feature=feature,
        )
    robot, arms, own = layout.robot, arms_of(layout.robot), fingers_of(layout.robot)
    kinds = {"Dex3 fingers": own, "grippers": GRASPS, "fingers of another hand": FOREIGN_FINGERS}
    have = [kind for kind, names in kinds.items() if any(name in there for name in names)]
    if len(have) > 1:
        raise DatasetError(f"'{feature}' has both {have[0]} and {have[1]}; one of them is expected", feature=feature)
    if layout.hand in FOREIGN_HANDS:
        hands = tuple(f"{side}_hand_{finger}" for side in SIDES for finger in FOREIGN_HANDS[layout.hand])
    else:
        hands = kinds[have[0]] if have else ()
    short = [name for part in ("left_arm", "right_arm") for name in joints_of(robot, part)[SHORT_ARM:]]
    if not have and not any(name in there for name in short):
        arms = tuple(name for name in arms if name not in short)
    waist = [name for name in joints_of(robot, "waist") if name in there]
    missing = [name for name in (*arms, *hands) if name not in there]
    if waist not in ([], list(joints_of(robot, "waist")[:SHORT_WAIST])):
        missing += [name for name in joints_of(robot, "waist") if name not in there]
    if missing:
        raise DatasetError(
            f"'{feature}' has {layout.dim} columns, but none for {', '.join(missing)}; both arms ({len(arms)}) are "
            f"needed, and of both hands ({len(own)}), two Dex1 grippers or two other hands (12) all or none",
            feature=feature,
        )


def _assumed(
    named: Sequence[tuple[str, str]], dim: int, feature: str, assume: ActionSpec, unit: str, robot: RobotSpec
) -> JointLayout:
    if any(slot.kind not in ("joint", "fingers", "ignored") and slot.name not in GRASPS for slot in assume.slots):
        wrong = [
            slot.name for slot in assume.slots if slot.kind not in ("joint", "ignored") and slot.name not in GRASPS
        ]
        raise DatasetError(
            f"--assume-spec {assume.name} is no joint layout: it has {', '.join(wrong)}; joint28 and joint16 are",
            feature=feature,
        )
    if dim != assume.dim:
        raise DatasetError(f"'{feature}' has {dim} columns; '{assume.name}' has {assume.dim}", feature=feature)
    names, reasons = column_names(assume)
    given = tuple(name for _, name in named)
    layout = JointLayout(names, given if len(given) == dim else tuple(assume.feature_names), unit, reasons, robot)
    _check_complete(layout, feature)
    require_same_names(assume, named, feature)
    return layout
