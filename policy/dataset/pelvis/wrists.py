"""A dataset in one wrist layout as one in another, row by row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.action_spec.codec import decode, encode
from policy.action_spec.describe import called
from policy.action_spec.spec import ActionSpec
from policy.action_spec.state import state_layout
from policy.dataset.format import ACTION, STATE, Dataset
from policy.dataset.pelvis.legs import RecordedLegs, state_of
from policy.dataset.pelvis.rows import decode_rows, encode_rows
from policy.errors import DatasetError, SpecError
from policy.reading import SPEC_MAX, ReadingError, read_text


def recorded_layout(dataset: Dataset, key: str, robot: RobotSpec | None = None) -> ActionSpec | None:
    """What ``meta/action_spec.json`` says of actions, ``meta/state_spec.json`` of states; None without it.

    Raises:
        DatasetError: If the file is malformed.
    """
    file = dataset.folder / "meta" / f"{'action' if key == ACTION else 'state'}_spec.json"
    if not file.exists():
        return None
    try:
        return ActionSpec.from_json(read_text(file, SPEC_MAX), robot)
    except (OSError, ReadingError, SpecError) as error:
        raise DatasetError(f"{file}: {error}") from error


@dataclass(frozen=True)
class WristConversion:
    """Conversion from one absolute wrist layout to another.

    Attributes:
        source: Layout of the rows.
        target: Layout to write.

    Raises:
        SpecError: If one of them is relative, or has no wrists, so that rows do not stand for themselves.
    """

    source: ActionSpec
    target: ActionSpec

    def __post_init__(self) -> None:
        for spec in (self.source, self.target):
            moving = [slot.name for slot in spec.slots if slot.mode != "absolute"]
            if moving or spec.slot("left_wrist_position") is None or spec.slot("right_wrist_position") is None:
                what = f"{', '.join(moving)} are not absolute" if moving else "it has no wrist positions"
                raise SpecError(f"rows of '{spec.name}' cannot be converted one by one: {what}; wbc32 and wbc27 can")

    @property
    def assumptions(self) -> dict[str, float | str]:
        """What the result has in it that the source does not say, but for the pelvis: nothing."""
        return {}

    @property
    def provenance(self) -> dict[str, Any]:
        """Description of the source for ``meta/conversion.json``."""
        return {"layout_in_source": called(self.source)}

    def forward(self, rows: np.ndarray, anchors: Sequence[Anchor] | None) -> np.ndarray:
        """Numbers (n, A) of the target for rows (n, D).

        Args:
            rows: Numbers of the source.
            anchors: One a row; None for the nominal stance in all.

        Raises:
            ChunkError: If a row is malformed, or a joint layout cannot reach it.
        """
        if anchors is None:
            nominal = Anchor.nominal(robot=self.source.robot)
            return encode(self.target, decode(self.source, rows, nominal), nominal)
        return encode_rows(self.target, decode_rows(self.source, rows, anchors), anchors)


def wrist_conversions(
    dataset: Dataset, spec: ActionSpec, assume: ActionSpec | None, legs: RecordedLegs | None
) -> dict[str, WristConversion]:
    """Conversions of what a dataset has in wrists already; empty if it has none.

    Args:
        dataset: What is converted.
        spec: Layout to write.
        assume: Layout of its actions that the user vouches for; what the dataset says of itself if None.
        legs: What says where the pelvis was.

    Raises:
        DatasetError: If the widths are not those of the layouts.
        SpecError: If a layout cannot be converted row by row.
    """
    actions = recorded_layout(dataset, ACTION, spec.robot) if assume is None else assume
    if actions is None or actions.slot("left_wrist_position") is None:
        return {}
    if (actions.version, actions.slots) == (spec.version, spec.slots):
        raise DatasetError(
            f"'{ACTION}' of {dataset.folder} is in the layout {actions.name} already, as {called(actions)}; --to names "
            "another"
        )
    states = recorded_layout(dataset, STATE, spec.robot) if assume is None else None
    found = {}
    for key, source in ((ACTION, actions), (STATE, states or state_layout(actions))):
        if key == STATE and legs is not None and legs.feature == STATE:
            continue  # joints, with the legs among them
        width = int(dataset.feature(key)["shape"][0])
        if width != source.dim:
            raise DatasetError(f"'{key}' of {dataset.folder} has {width} numbers; '{source.name}' has {source.dim}")
        found[key] = WristConversion(source, spec if key == ACTION else state_of(spec, legs))
    return found
