"""Which conversion the actions and states of a dataset take into a wrist layout."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from policy.action_spec.spec import ActionSpec
from policy.dataset.checks import column_layout
from policy.dataset.format import ACTION, STATE, Dataset
from policy.dataset.joint_conversion import SYNERGIES, JointConversion
from policy.dataset.naming.sources import Source
from policy.dataset.pelvis.legs import RecordedLegs, state_of
from policy.dataset.pelvis.wrists import WristConversion, wrist_conversions
from policy.errors import DatasetError

Conversion = JointConversion | WristConversion


def row_conversions(
    dataset: Dataset, sources: Mapping[str, Source], spec: ActionSpec, legs: RecordedLegs | None,
    waist: tuple[float, ...] | None, synergy: str | None, given: Mapping[str, Any],
) -> dict[str, Conversion]:  # fmt: skip
    """Conversions of actions and states: from wrists where the dataset says that it has them, else from joints.

    Args:
        dataset: What is converted.
        sources: Its actions and states.
        spec: Layout of the actions to write.
        legs: What says where the pelvis was.
        waist: As of `policy.dataset.joint_conversion.JointConversion`.
        synergy: Likewise.
        given: As of `policy.dataset.checks.column_layout`: assume, unit, robot.

    Raises:
        DatasetError: If it is not known what a column is.
        SpecError: If the layout cannot be filled.
    """
    found: dict[str, Conversion] = {**wrist_conversions(dataset, spec, given["assume"], legs)}
    given = {**given, "assume": None if found else given["assume"]}
    for key, layout in {ACTION: spec, STATE: state_of(spec, legs)}.items():
        if key not in found:
            columns = column_layout(dataset, sources[key], **given)
            # A state with lean and height has one closing number a hand, whatever the actions have.
            closed = key == STATE and layout.slot("left_grasp") and spec.slot("left_hand") and not columns.dex1
            named = synergy or (SYNERGIES[0] if closed and columns.hand else None)
            found[key] = JointConversion(columns, layout, waist, named)
    return found


def of_executed(
    conversions: Mapping[str, Conversion], waist: tuple[float, ...] | None, synergy: str | None
) -> JointConversion:
    """Conversion of measured joints into the layout of the actions.

    Raises:
        DatasetError: If the states are no joints.
    """
    state = conversions[STATE]
    if not isinstance(state, JointConversion):
        raise DatasetError("executed actions are made of measured joints; the states of this dataset are wrists")
    return JointConversion(state.source, conversions[ACTION].target, waist, synergy)
