"""What the columns of a joint-space vector are, from the names that a dataset or a robot gives them.

Columns are mapped by name, never by position: Unitree writes ``kLeftShoulderPitch``, a URDF
``left_shoulder_pitch_joint``, LeRobot robots ``left_shoulder_pitch.pos`` or ``.q``. A Dex1 gripper is one column.

Source:
    unitree_lerobot ``utils/constants.py`` (G1_DEX3_CONFIG, G1_DEX1_CONFIG) and ``convert_unitree_json_to_lerobot.py``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.action_spec.builtin import joints, scalar, stack
from policy.action_spec.slot import DEX1_OPEN
from policy.action_spec.spec import ActionSpec
from policy.errors import DatasetError, did_you_mean
from policy.joints import joints_of

GRASPS = ("left_grasp", "right_grasp")
"""Canonical names of the two gripper columns."""

_UNITREE_ARM = ("ShoulderPitch", "ShoulderRoll", "ShoulderYaw", "Elbow", "WristRoll", "WristPitch", "WristYaw")
_UNITREE_ARMS = tuple(f"k{side}{joint}" for side in ("Left", "Right") for joint in _UNITREE_ARM)
_UNITREE_LEFT_HAND = ("Thumb0", "Thumb1", "Thumb2", "Middle0", "Middle1", "Index0", "Index1")
_UNITREE_RIGHT_HAND = ("Thumb0", "Thumb1", "Thumb2", "Index0", "Index1", "Middle0", "Middle1")
UNITREE_DEX3 = (
    *_UNITREE_ARMS,
    *(f"kLeftHand{joint}" for joint in _UNITREE_LEFT_HAND),
    *(f"kRightHand{joint}" for joint in _UNITREE_RIGHT_HAND),
)
"""The 28 columns of the datasets ``unitreerobotics/G1_Dex3_*``: the layout joint28."""
UNITREE_DEX1 = (*_UNITREE_ARMS, "kLeftGripper", "kRightGripper")
"""The 16 columns of the datasets ``unitreerobotics/G1_Dex1_*``: the layout joint16."""

DEGREES_FROM = 2.0 * np.pi
"""No joint of the G1 turns a whole circle [rad]; the widest reaches 3.1."""
ORDER_MARGIN = 0.3
"""Commands and encoder offsets overshoot limits by less [rad]; published sets do overshoot (unitree_lerobot #104)."""
ORDER_SHARE = 0.5
"""Share of frames beyond the margin from which a column cannot be the joint it is called."""


@dataclass(frozen=True)
class JointLayout:
    """Columns of a joint-space vector, each a joint or a gripper.

    Attributes:
        names: Canonical name of each column: a joint of the robot, ``left_grasp`` or ``right_grasp``.
        given: Names as the source spells them.
        unit: Unit of the joint columns, ``rad`` or ``deg``; grippers are Dex1 motor angles [rad].
        robot: The robot; the G1 with Dex3 hands if not given.
    """

    names: tuple[str, ...]
    given: tuple[str, ...]
    unit: str = "rad"
    robot: RobotSpec = field(default_factory=g1, repr=False)

    @property
    def dim(self) -> int:
        """Number of columns."""
        return len(self.names)

    @property
    def has_waist(self) -> bool:
        """Whether all joints of the waist are there; a robot whose waist is locked has none."""
        waist = joints_of(self.robot, "waist")
        return bool(waist) and all(name in self.names for name in waist)

    @property
    def dex1(self) -> bool:
        """Whether the hands are grippers, one number each."""
        return GRASPS[0] in self.names

    @property
    def spec(self) -> ActionSpec:
        """The same vector without legs, in the order arms, hands, waist; joints in the layout's unit."""
        hands = (
            (scalar("left_grasp", "dex1 rad"), scalar("right_grasp", "dex1 rad"))
            if self.dex1
            else (joints(self.robot, "left_hand"), joints(self.robot, "right_hand"))
        )
        parts = [joints(self.robot, "left_arm"), joints(self.robot, "right_arm"), *hands]
        if self.has_waist:
            parts.append(joints(self.robot, "waist"))
        parts = [part | {"unit": self.unit} if part["kind"] == "joint" else part for part in parts]
        name = f"joint{sum(part['size'] for part in parts)}"
        return ActionSpec(name=name, slots=stack(*parts), robot=self.robot)

    @property
    def columns(self) -> np.ndarray:
        """Indices such that ``x_spec = x_source[..., columns]``, shape (spec.dim,)."""
        robot = self.robot
        waist = joints_of(robot, "waist") if self.has_waist else ()
        wanted = [*arms_of(robot), *(GRASPS if self.dex1 else fingers_of(robot)), *waist]
        return np.array([self.names.index(name) for name in wanted], dtype=int)


def arms_of(robot: RobotSpec) -> tuple[str, ...]:
    """Names of the joints of both arms."""
    return (*joints_of(robot, "left_arm"), *joints_of(robot, "right_arm"))


def fingers_of(robot: RobotSpec) -> tuple[str, ...]:
    """Names of the joints of both hands."""
    return (*joints_of(robot, "left_hand"), *joints_of(robot, "right_hand"))


def joint_layout(
    names: object,
    dim: int,
    *,
    feature: str = "action",
    assume: ActionSpec | None = None,
    unit: str = "rad",
    robot: RobotSpec | None = None,
) -> JointLayout:
    """Layout of a feature from its names.

    Args:
        names: As in ``meta/info.json``: a list, a list in a list, or an object with one list (Unitree: ``motors``).
        dim: Number of columns that the feature says it has.
        feature: Its name, for messages.
        assume: Joint layout that the user vouches for (``--assume-spec joint28``); needed where there are no names.
        unit: Unit of the joint columns, ``rad`` or ``deg``.
        robot: The robot; the G1 with Dex3 hands if None.

    Raises:
        DatasetError: If a name is unknown, missing or occurs twice, or the order or number contradicts what is said.
    """
    if unit not in ("rad", "deg"):
        raise DatasetError(f"unit '{unit}' is unknown; it is 'rad' or 'deg'")
    given, robot = flat_names(names), robot or g1()
    if assume is not None:
        return _assumed(given, dim, feature, assume, unit, robot)
    if not given:
        raise DatasetError(
            f"'{feature}' has {dim} columns without names; equal size does not say which joints they are. "
            "If they are as Unitree writes them, say --assume-spec joint28 (Dex3) or joint16 (Dex1)",
            feature=feature,
        )
    if len(given) != dim:
        raise DatasetError(
            f"'{feature}' has {dim} columns but {len(given)} names; there must be one name a column", feature=feature
        )
    layout = JointLayout(tuple(_canonical(name, feature, robot) for name in given), given, unit, robot)
    _check_complete(layout, feature)
    return layout


def flat_names(names: object) -> tuple[str, ...]:
    """Names of columns in any of the forms that LeRobot datasets have; empty if there are none."""
    while isinstance(names, Mapping) and len(names) == 1:
        names = next(iter(names.values()))
    if isinstance(names, Sequence) and len(names) == 1 and not isinstance(names[0], str):
        return flat_names(names[0])
    if isinstance(names, Sequence) and not isinstance(names, str) and all(isinstance(name, str) for name in names):
        return tuple(names)
    return ()


def check_values(layout: JointLayout, values: np.ndarray, *, feature: str = "action") -> tuple[str, ...]:
    """Refuse joint values that are not finite, no radians, or not of the joints they are called.

    Args:
        layout: Names of the columns.
        values: Shape (n, D), in the layout's unit.
        feature: Name of the feature, for messages.

    Returns:
        Notes about joints that leave their limits a little; nothing is changed.

    Raises:
        DatasetError: Naming the feature, column and first frame.
    """
    values = np.asarray(values, dtype=float)
    if values.ndim != 2 or values.shape[1] != layout.dim:
        raise DatasetError(f"'{feature}' has shape {values.shape}; (frames, {layout.dim}) is expected", feature=feature)
    bad = ~np.isfinite(values)
    if bad.any():
        frame, column = (int(i) for i in np.argwhere(bad)[0])
        raise DatasetError(
            f"'{feature}' column {column} ({layout.given[column]}) is {values[frame, column]} at frame {frame}; "
            f"{int(bad.sum())} of {bad.size} numbers are not finite: leave those episodes out",
            feature=feature,
            frame=frame,
        )
    return tuple(
        note for column in range(layout.dim) for note in _check_column(layout, values[:, column], column, feature)
    )


def _check_column(layout: JointLayout, values: np.ndarray, column: int, feature: str) -> list[str]:
    name, spelt = layout.names[column], layout.given[column]
    if name in GRASPS:
        return _check_gripper(values, column, spelt, feature)
    q = np.deg2rad(values) if layout.unit == "deg" else values
    frame = int(np.argmax(np.abs(q)))
    if np.abs(q[frame]) > DEGREES_FROM:
        raise DatasetError(
            f"'{feature}' column {column} ({spelt}) is {values[frame]:.4g} {layout.unit} at frame {frame}; no joint of "
            f"the G1 passes {DEGREES_FROM:.3g} rad: "
            + ("the numbers look like degrees, say --unit deg" if layout.unit == "rad" else "the recording is damaged"),
            feature=feature,
            frame=frame,
        )
    index = layout.robot.index(name)
    low, high = layout.robot.position_min[index], layout.robot.position_max[index]
    excess = np.maximum(low - q, q - high)
    if np.mean(excess > ORDER_MARGIN) > ORDER_SHARE:
        raise DatasetError(
            f"'{feature}' column {column} ({spelt}) is outside the limits [{low:.3g}, {high:.3g}] rad of {name} by "
            f"more than {ORDER_MARGIN} rad in {np.mean(excess > ORDER_MARGIN):.0%} of the frames: the columns are in "
            "another order than their names say (the right Dex3 hand is thumb, index, middle), or have another sign",
            feature=feature,
            frame=int(np.argmax(excess)),
        )
    beyond = excess > 1e-6
    if not beyond.any():
        return []
    return [f"{feature}: {name} is beyond its limits in {int(beyond.sum())} frames, by up to {excess.max():.3g} rad"]


def _check_gripper(values: np.ndarray, column: int, spelt: str, feature: str) -> list[str]:
    frame = int(np.argmax(np.abs(values)))
    if np.abs(values[frame]) > DEGREES_FROM:
        raise DatasetError(
            f"'{feature}' column {column} ({spelt}) is {values[frame]:.4g} at frame {frame}; a Dex1 motor angle is "
            f"between 0 (closed) and {DEX1_OPEN} rad (open)",
            feature=feature,
            frame=frame,
        )
    outside = (values < 0.0) | (values > DEX1_OPEN)
    if not outside.any():
        return []
    return [f"{feature}: {spelt} is outside [0, {DEX1_OPEN}] rad in {int(outside.sum())} frames and was clipped"]


def _canonical(name: str, feature: str, robot: RobotSpec) -> str:
    known = {_key(joint): joint for joint in robot.joint_names}
    known |= {"leftgripper": "left_grasp", "rightgripper": "right_grasp"}
    known |= {"leftgrasp": "left_grasp", "rightgrasp": "right_grasp"}
    found = known.get(_key(name))
    if found is None:
        near = did_you_mean(name, (*UNITREE_DEX3, "kLeftGripper", "kRightGripper", *robot.joint_names))
        raise DatasetError(
            f"'{feature}' has a column '{name}', which is no joint of the G1 with Dex3 hands or Dex1 grippers; "
            f"{near}if the names say nothing, --assume-spec joint28 or joint16 does",
            feature=feature,
        )
    return found


def _key(name: str) -> str:
    """Letters and digits in lower case, without ``k`` in front, ``_joint`` behind and LeRobot's ending."""
    name = re.sub(r"\.(pos|q)$", "", name)
    if re.match(r"k[A-Z]", name):
        name = name[1:]
    return re.sub(r"[^a-z0-9]", "", name.lower()).removesuffix("joint")


def _check_complete(layout: JointLayout, feature: str) -> None:
    doubled = sorted({name for name in layout.names if layout.names.count(name) > 1})
    if doubled:
        raise DatasetError(f"'{feature}' has two columns for {', '.join(doubled)}", feature=feature)
    if any(grasp in layout.names for grasp in GRASPS) and any(
        finger in layout.names for finger in fingers_of(layout.robot)
    ):
        raise DatasetError(f"'{feature}' has both Dex3 fingers and grippers; one of them is expected", feature=feature)
    arms, fingers = arms_of(layout.robot), fingers_of(layout.robot)
    wanted = (*arms, *(GRASPS if any(grasp in layout.names for grasp in GRASPS) else fingers))
    missing = [name for name in wanted if name not in layout.names]
    if missing:
        raise DatasetError(
            f"'{feature}' has {layout.dim} columns, but none for {', '.join(missing)}; both arms ({len(arms)}) "
            f"and either both hands ({len(fingers)}) or two Dex1 grippers are needed",
            feature=feature,
        )


def _assumed(
    given: tuple[str, ...], dim: int, feature: str, assume: ActionSpec, unit: str, robot: RobotSpec
) -> JointLayout:
    names = tuple(name for slot in assume.slots for name in (slot.joint_names or (slot.name,)))
    wrong = [name for name in names if name not in (*robot.joint_names, *GRASPS)]
    if wrong:
        raise DatasetError(
            f"--assume-spec {assume.name} is no joint layout: it has {', '.join(wrong)}; joint28 and joint16 are",
            feature=feature,
        )
    if dim != len(names):
        raise DatasetError(f"'{feature}' has {dim} columns; '{assume.name}' has {len(names)}", feature=feature)
    layout = JointLayout(names, given if len(given) == dim else names, unit, robot)
    _check_complete(layout, feature)
    for column, (name, spelt) in enumerate(zip(names, layout.given, strict=True)):
        try:
            said = _canonical(spelt, feature, robot)
        except DatasetError:
            continue  # the name says nothing, the user does
        if said != name:
            raise DatasetError(
                f"'{feature}' column {column} is called '{spelt}', '{assume.name}' has {name} there: the order is "
                "another one; without --assume-spec the columns are mapped by their names",
                feature=feature,
            )
    return layout
