"""What a dataset is read as: which column is which joint, what is left out, and what was taken for granted."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from models.spec import RobotSpec
from policy.action_spec.spec import ActionSpec
from policy.dataset.checks import column_layout
from policy.dataset.format import ACTION, STATE, Dataset
from policy.dataset.naming.sources import find_source
from policy.dataset.open import open_dataset
from policy.dataset.pelvis.wrists import recorded_layout
from policy.errors import DatasetError


def mapping(
    folder: str | Path, *, assume: ActionSpec | None = None, read_as: Sequence[str] = (), robot: RobotSpec | None = None
) -> dict[str, Any]:
    """Plain data that says what is made of a dataset.

    Args:
        folder: The dataset.
        assume: Layout of the actions that the user vouches for.
        read_as: What the user says that the numbers are instead of what they are called.
        robot: The robot; the G1 with Dex3 hands if None.

    Raises:
        DatasetError: If it cannot be read.
    """
    dataset = open_dataset(folder)
    about = {"format": dataset.version, "fps": dataset.fps, "episodes": len(dataset.episodes)}
    features = {key: _feature(dataset, key, assume if key == ACTION else None, robot) for key in (ACTION, STATE)}
    facts = {"read_as": list(read_as), "assumed_layout": None if assume is None else assume.id}
    return {**about, **facts, "features": features}


def _feature(dataset: Dataset, key: str, assume: ActionSpec | None, robot: RobotSpec | None) -> dict[str, Any]:
    try:
        source = find_source(dataset, key)
        found: dict[str, Any] = {"features": list(source.features), "notes": list(source.notes)}
        spec = recorded_layout(dataset, key, robot) if assume is None else assume
        if spec is not None and spec.slot("left_wrist_position"):
            return found | {"layout": spec.id}
        layout = column_layout(dataset, source, assume=assume, robot=robot)
    except DatasetError as error:
        return {"refused": str(error)}
    joints = {"joints": list(layout.names), "names_in_source": list(layout.given)}
    return found | joints | {"left_out": layout.left_out, "layout": layout.whole_spec.id}
