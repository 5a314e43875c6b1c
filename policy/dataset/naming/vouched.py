"""A layout that a user vouches for, held against the names of the columns."""

from __future__ import annotations

from collections.abc import Sequence

from policy.action_spec.spec import ActionSpec
from policy.dataset.naming.meaning import GRASPS, meaning, says_nothing
from policy.errors import DatasetError


def column_names(spec: ActionSpec) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Canonical name of each number of a layout, empty where it is no joint, and why it is ignored."""
    names: list[str] = []
    reasons: list[str] = []
    for slot in spec.slots:
        if slot.kind == "fingers":
            names += [f"{slot.name}_{finger}" for finger in slot.joint_names]
        elif slot.kind == "joint" or slot.name in GRASPS:
            names += slot.joint_names or (slot.name,)
        else:
            names += [""] * slot.size
        reasons += [slot.reason] * slot.size
    return tuple(names), tuple(reasons)


def require_same_names(assume: ActionSpec, named: Sequence[tuple[str, str]], feature: str) -> None:
    """Refuse a layout that a user vouches for where the names of the columns say another one.

    Raises:
        DatasetError: Naming the first column that contradicts it.
    """
    if says_nothing([name for _, name in named], assume.dim) or len(named) != assume.dim:
        return
    for column, (name, (part, spelt)) in enumerate(zip(column_names(assume)[0], named, strict=True)):
        meant = meaning(spelt, part, assume.robot).name
        if meant and meant != name:
            raise DatasetError(
                f"'{feature}' column {column} is called '{spelt}', '{assume.name}' has {name or 'no joint'} there: the "
                "order is another one; without --assume-spec the columns are mapped by their names",
                feature=feature,
            )
