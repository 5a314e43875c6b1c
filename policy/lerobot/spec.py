"""What the numbers of a checkpoint mean: the action and state layouts that travel beside its weights.

LeRobot stores how many numbers an action has, never what they are. Two files in the checkpoint's folder say it, each
the JSON of an `ActionSpec` with its hash:

=====================  ===========================================================================================
``action_spec.json``   layout of the actions after the post-processor
``state_spec.json``    layout of ``observation.state``; without it, that of the action (`state_layout`)
=====================  ===========================================================================================
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

from policy.action_spec.spec import ActionSpec, require_same
from policy.action_spec.state import state_layout
from policy.errors import SpecError
from policy.reading import SPEC_MAX, ReadingError, read_text
from policy.writing import write_text

ACTION_SPEC_FILE = "action_spec.json"
STATE_SPEC_FILE = "state_spec.json"


def write_specs(folder: str | Path, spec: ActionSpec, state: ActionSpec | None = None) -> None:
    """Write the layouts of a checkpoint beside its weights.

    Args:
        folder: Where ``config.json`` and ``model.safetensors`` are.
        spec: Layout of the actions after the post-processor.
        state: Layout of ``observation.state``; `state_layout` of the action if None.
    """
    folder, state = Path(folder), state_layout(spec) if state is None else state
    _require_absolute(state)
    write_text(folder / ACTION_SPEC_FILE, spec.to_json() + "\n")
    write_text(folder / STATE_SPEC_FILE, state.to_json() + "\n")


def read_action_spec(folder: Path, wanted: ActionSpec | None, assumed: ActionSpec | None) -> ActionSpec:
    """Layout of a checkpoint's actions.

    Args:
        folder: The checkpoint.
        wanted: What the caller decodes; None takes what the checkpoint says.
        assumed: What the user vouches for; replaces what the checkpoint says.

    Raises:
        SpecError: If nothing says it, or the checkpoint says something else than `wanted`.
    """
    if assumed is not None:
        return assumed
    file = folder / ACTION_SPEC_FILE
    if not file.exists():
        name = "wbc32" if wanted is None else wanted.name
        raise SpecError(
            f"{file} is missing: nothing says what the actions of this checkpoint mean, and their number never does. "
            f"wholebody spec {folder} --layout {name} writes it; --assume-spec {name} vouches for it once"
        )
    found = _read(file)
    if wanted is not None:
        try:
            # How many steps a chunk has is the network's business; decoding takes any number.
            require_same(dataclasses.replace(wanted, horizon=found.horizon), found)
        except SpecError as error:
            raise SpecError(f"{file}: {error}; decode with the checkpoint's own layout, or --assume-spec") from error
    return found


def read_state_spec(folder: Path, spec: ActionSpec) -> ActionSpec:
    """Layout of a checkpoint's state; that of the action if no file says otherwise.

    Raises:
        SpecError: If the file is malformed, or a slot is not absolute.
    """
    file = folder / STATE_SPEC_FILE
    if not file.exists():
        return state_layout(spec)
    found = _read(file)
    _require_absolute(found)
    return found


def _read(file: Path) -> ActionSpec:
    try:
        return ActionSpec.from_json(read_text(file, SPEC_MAX))
    except (OSError, ReadingError, SpecError) as error:
        raise SpecError(f"{file}: {error}") from error


def _require_absolute(state: ActionSpec) -> None:
    for slot in state.slots:
        if slot.mode != "absolute":
            raise SpecError(
                f"state layout '{state.name}': slot '{slot.name}' is {slot.mode}; a state is absolute in every slot"
            )
