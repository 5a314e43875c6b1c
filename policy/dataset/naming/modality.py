"""GR00T's ``meta/modality.json``: which columns of a vector are which part of the body."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from models import g1
from policy.action_spec.slot import SHORT_ARM
from policy.dataset.format import ACTION, Dataset, read_json
from policy.errors import DatasetError
from policy.joints import joints_of
from policy.reading import listed

MODALITY = "modality.json"
_GROUPS = ("left_arm", "right_arm", "left_leg", "right_leg", "waist", "left_hand", "right_hand")
_HANDS = ("left_hand", "right_hand")


def modality_names(
    dataset: Dataset, key: str, feature: str, width: int
) -> tuple[tuple[tuple[str, str], ...], tuple[str, ...]]:
    """Part and name of each column of a feature by ``meta/modality.json``, and what was taken for granted.

    Parts have no order of their own: joints are taken in motor order, fingers as Pinocchio sorts them (index, middle,
    thumb) where a hand stands behind its arm, as in the exports of GR00T-WholeBodyControl.

    Args:
        dataset: Where it is.
        key: ``action`` or ``observation.state``.
        feature: Whose columns.
        width: How many there are.

    Returns:
        No names if there is no such file, or it does not speak of the feature.

    Raises:
        DatasetError: If the file is malformed, or two parts overlap.
    """
    file = dataset.folder / "meta" / MODALITY
    if not file.exists():
        return (), ()
    stated = read_json(file).get("action" if key == ACTION else "state")
    if not isinstance(stated, Mapping):
        return (), ()
    named: list[tuple[str, str]] = [("", "")] * width
    at: dict[str, int] = {}
    for part, place in stated.items():
        if not isinstance(place, Mapping) or place.get("original_key", feature) != feature:
            continue
        start, end = place.get("start"), place.get("end")
        if type(start) is not int or type(end) is not int or not 0 <= start < end <= width:
            raise DatasetError(
                f"{file} has '{part}' from {start!r:.20} to {end!r:.20}; '{feature}' has {width} columns"
            )
        if any(name for _, name in named[start:end]):
            raise DatasetError(f"{file} has '{part}' where another part is already")
        at[part] = start
        names = part_joints(part, end - start, pinocchio=_behind_its_arm(part, start, stated))
        named[start:end] = [(part, names[i] if names else f"{part}_{i}") for i in range(end - start)]
    if not at:
        return (), ()
    notes = [f"{key}: {file.name} says which columns are which part, not their order: joints are in motor order"]
    if any(_behind_its_arm(hand, at.get(hand, -1), stated) for hand in _HANDS):
        notes.append(f"{key}: fingers are taken as index, middle, thumb, since each hand stands behind its arm")
    return tuple((part, name or f"unnamed_{i}") for i, (part, name) in enumerate(named)), tuple(notes)


def numbered_parts(named: Sequence[tuple[str, str]]) -> tuple[tuple[tuple[str, str], ...], tuple[str, ...]]:
    """Names with those such as ``left_arm_0`` to ``left_arm_6`` replaced by joints, and what was taken for granted.

    Args:
        named: Part and name of each column.
    """
    found: dict[str, dict[int, int]] = {}
    for column, (_, name) in enumerate(named):
        if match := re.fullmatch(r"(.*?)[_.]?(\d{1,3})", name.lower()):
            found.setdefault(match[1].rpartition(".")[2], {})[int(match[2])] = column
    names, parts = [name for _, name in named], []
    for part, columns in found.items():
        joints = () if part in _HANDS else part_joints(part, len(columns))
        if joints and sorted(columns) == list(range(len(columns))):
            parts.append(part)
            for number, column in columns.items():
                names[column] = joints[number]
    note = f"{listed(parts, 6)} are numbered, not named: joints are taken in motor order"
    return tuple((part, name) for (part, _), name in zip(named, names, strict=True)), (note,) if parts else ()


def part_joints(part: str, width: int, *, pinocchio: bool = False) -> tuple[str, ...]:
    """Joints of a body part that is as wide as the G1's; none if it is another part or width.

    Args:
        part: Such as ``left_arm``.
        width: Its columns.
        pinocchio: Whether fingers are in Pinocchio's order.
    """
    name = re.sub(r"(_joints?|_q|_qpos|_pos)$", "", part.lower().replace("-", "_"))
    robot = g1()
    group = joints_of(robot, name) if name in _GROUPS else robot.body_joints if name == "body" else ()
    if name.endswith("_arm") and width == SHORT_ARM:
        return group[:SHORT_ARM]
    if name in ("left_gripper", "right_gripper", *_HANDS) and width == 1:
        return (f"{name.partition('_')[0]}_gripper",)
    if len(group) != width:
        return ()
    return tuple(sorted(group)) if pinocchio and name in _HANDS else group


def _behind_its_arm(part: str, start: int, said: Mapping) -> bool:
    arm = said.get(part.replace("hand", "arm")) if part in _HANDS else None
    return isinstance(arm, Mapping) and arm.get("end") == start
