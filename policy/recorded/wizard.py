"""Which layouts the numbers of a dataset, a chunk file or a checkpoint may be in, each with what speaks for it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import LAYOUTS, builtin
from policy.action_spec.codec import decode
from policy.action_spec.frame_guess import ARM_REACH, LEAN_MIN, SHOULDERS, UNIT_DISTANCE
from policy.action_spec.mask import full_mask
from policy.action_spec.slot import CLOSING, QuaternionOrder, Rot6dLayout, Slot
from policy.action_spec.spec import ActionSpec
from policy.archive import read_arrays
from policy.dataset.checks import column_layout
from policy.dataset.format import ACTION
from policy.dataset.inspection import action_findings
from policy.dataset.naming.meaning import GRASPS
from policy.dataset.naming.sources import find_source
from policy.dataset.naming.vouched import require_same_names
from policy.dataset.open import is_dataset, open_dataset
from policy.errors import ChunkError, DatasetError, FileFormatError, PolicyError
from policy.reading import SPEC_MAX, ReadingError, read_json
from policy.recorded.chunk_file import KEYS

ROWS_MAX = 600
"""Most rows that are looked at; chosen: 20 s at 30 Hz, in which every joint moves."""
REACH_SHARE = 0.9
"""Share of the rows in which wrists must be in reach of their shoulders; chosen: calibration and overshoot."""
CLOSINGS = ((0.0, 1.0), (-1.0, 1.0), (0.0, 100.0), (0.0, 255.0), (0.0, 1000.0))
"""Ranges that closing numbers are given in; chosen: shares, signs, percent, bytes, and the counts of Inspire hands."""
OF_MOTORS = 10.0
"""Largest angle of a gripper's motor [rad]; definition: `policy.action_spec.slot.DEX1_OPEN`, nearly twice."""
BY_NAMES = "by_names"
"""What the layout is called that the names of a dataset's columns say."""


@dataclass(frozen=True)
class WizardInput:
    """Numbers to be identified.

    Attributes:
        source: Where it is from.
        dim: Numbers a step.
        fps: Steps a second [Hz]; None where nothing says it.
        values: Rows (n, dim); None of a checkpoint, whose numbers cannot be seen.
        named: Part and name of each number; empty where there are none.
        by_names: Layout that the names say, and its columns; None if they do not.
        horizon: Steps of a chunk; None where nothing says it.
    """

    source: str
    dim: int
    fps: float | None
    values: np.ndarray | None
    named: tuple[tuple[str, str], ...] = ()
    by_names: ActionSpec | None = None
    horizon: int | None = None


@dataclass(frozen=True)
class Fit:
    """A layout, and whether it fits.

    Attributes:
        spec: The layout, at the rate of the source.
        fits: Whether nothing speaks against it.
        why: What speaks for it, or against it.
    """

    spec: ActionSpec
    fits: bool
    why: tuple[str, ...]


def numbers_of(source: str | Path) -> WizardInput:
    """Numbers of a dataset folder, a chunk ``.npz`` or the folder of a checkpoint.

    Raises:
        PolicyError: If it is none of these, or cannot be read.
    """
    path = Path(source)
    if path.suffix.lower() == ".npz":
        return _of_chunk(path)
    if is_dataset(path):
        return _of_dataset(path)
    if path.is_dir():
        return _of_checkpoint(path)
    what = "there is no such file or folder"
    if path.is_file():
        what = "a dataset, a checkpoint or a chunk .npz is expected"
    if path.suffix.lower() == ".npy" and path.is_file():
        what = "an array says nothing of itself: `wholebody check FILE.npy` names the layouts that are as wide"
    if path.suffix.lower() == ".csv" and path.is_file():
        what = "a motion has a layout of its own: `wholebody convert FILE.csv chunk.npz` makes wrists of it"
    raise PolicyError(f"'{path}': {what}")


def fits(numbers: WizardInput) -> list[Fit]:
    """Every layout of that width, those that fit first; of several that fit, the one with the fewest doubts first."""
    found = (
        []
        if numbers.by_names is None
        else [
            Fit(
                numbers.by_names,
                True,
                ("the names of the columns say it: they are mapped by name, and no --assume-spec is needed",),
            )
        ]
    )
    for name in LAYOUTS:
        spec = builtin(name)
        if spec.dim == numbers.dim:
            settings = {"fps": numbers.fps or spec.fps, "horizon": numbers.horizon or spec.horizon}
            spec = dataclasses.replace(spec, **settings)
            found.append(_fit(spec, numbers))
            found += [one for one in (_fit(other, numbers) for other in _variants(spec, numbers)) if one.fits]
    return sorted(found, key=lambda one: (not one.fits, len(one.why)))


def _variants(spec: ActionSpec, numbers: WizardInput) -> list[ActionSpec]:
    """Variants of a layout, each with one change that the findings suggest."""
    if numbers.values is None:
        return []
    codes = {one.check for one in action_findings(spec, numbers.values, Anchor.nominal(), spec.fps)}
    places = [slot for slot in spec.slots if slot.kind == "position" and slot.unit == "m"]
    if places and np.abs(numbers.values[:, places[0].indices]).max() > UNIT_DISTANCE:
        codes.add("unit")
    found: list[ActionSpec] = []

    def change(name: str, which: Callable[[Slot], bool], **fields: object) -> None:
        slots = tuple(dataclasses.replace(slot, **fields) if which(slot) else slot for slot in spec.slots)
        found.append(dataclasses.replace(spec, name=f"{spec.name}_{name}", version=1, slots=slots))

    if "rot6d_layout" in codes:
        for layout in get_args(Rot6dLayout):
            change(layout, lambda slot: slot.kind == "rot6d", rot6d_layout=layout)
    if "unit" in codes:
        for unit in ("cm", "mm"):
            change(unit, lambda slot: slot.kind == "position", unit=unit)
    if "quaternion_order" in codes:
        for order in get_args(QuaternionOrder):
            change(order, lambda slot: slot.kind == "quaternion", quaternion_order=order)
    grasps = [slot for slot in spec.slots if slot.name in GRASPS]
    seen = np.array([numbers.values[:, slot.start] for slot in grasps])
    if codes & {"closing_range", "gripper_share"} or (grasps and np.abs(seen).max() > OF_MOTORS):
        low, high = min(CLOSINGS, key=lambda ends: abs(seen.min() - ends[0]) + abs(seen.max() - ends[1]))
        for name, ends in (("opens_up", (high, low)), ("closes_up", (low, high))):
            change(name, lambda slot: slot.name in GRASPS, unit=CLOSING, closing=ends, limits=None)
    return found


def lines(numbers: WizardInput, found: list[Fit]) -> list[str]:
    """A table for people."""
    rate = "" if numbers.fps is None else f" at {numbers.fps:g} Hz"
    seen = "numbers not seen" if numbers.values is None else f"{len(numbers.values)} rows seen"
    lines = [f"{numbers.source}: {numbers.dim} numbers a step{rate}, {seen}"]
    for one in found:
        lines.append(f"  {label(one.spec):<20} {'fits' if one.fits else 'does not'}")
        lines += [f"  {'':<20} {why}" for why in one.why]
    if not found:
        lines.append(
            f"  no layout has {numbers.dim} numbers; write your own: wholebody layouts NAME --write is a start"
        )
    elif not any(one.fits for one in found):
        lines.append("  none fits: see what speaks against the nearest, and write your own as JSON")
    return lines


def label(spec: ActionSpec) -> str:
    """Name of a layout, with its version where a built-in one has several."""
    versions = sum(builtin(name).name == spec.name for name in LAYOUTS)
    return f"{spec.name}-v{spec.version}" if versions > 1 else spec.name


def _fit(spec: ActionSpec, numbers: WizardInput) -> Fit:
    why: list[str] = []
    try:
        if numbers.named:
            require_same_names(spec, numbers.named, ACTION)
    except DatasetError as error:
        return Fit(spec, False, (str(error),))
    if numbers.values is None:
        return Fit(spec, True, ("it has as many numbers; what they are, a checkpoint alone does not say",))
    anchor = Anchor.nominal()
    found = action_findings(spec, numbers.values, anchor, spec.fps)
    against = [one.text for one in found if one.level == "error"]
    doubts = [one.text for one in found if one.level == "warning"]
    try:
        chunk = decode(spec, numbers.values, anchor, mask=full_mask(spec))
    except ChunkError as error:
        return Fit(spec, False, (*against, str(error)))
    reached = []
    for side, T in (("left", chunk.T_world_lhand), ("right", chunk.T_world_rhand)):
        shoulder = anchor.T_world_base[:3, :3] @ np.array(SHOULDERS[side]) + anchor.T_world_base[:3, 3]
        away = np.linalg.norm(T[:, :3, 3] - shoulder, axis=1)
        reached.append(np.mean(away <= ARM_REACH + LEAN_MIN))
    share = float(min(reached))
    why.append(f"both wrists are within reach in {share:.0%} of the rows")
    if share < REACH_SHARE:
        against.append(why.pop())
    for slot in spec.slots:
        if slot.kind in ("joint", "scalar", "fingers"):
            low, high = (float(x) for x in np.quantile(numbers.values[:, slot.indices], (0.01, 0.99)))
            why.append(f"{slot.name}: {low:.3g} to {high:.3g} {slot.unit}")
    return Fit(spec, not against, tuple(against or [*why[:1], *doubts, *why[1:]]))


def _of_chunk(path: Path) -> WizardInput:
    try:
        arrays = read_arrays(path, KEYS)
    except OSError as error:
        raise FileFormatError(f"cannot be read: {error.strerror or error}", path=str(path)) from error
    except ReadingError as error:
        raise FileFormatError(str(error), path=str(path)) from error
    actions = arrays.get("actions")
    if actions is None or actions.ndim != 2 or actions.dtype.kind not in "fiu" or not len(actions):
        raise FileFormatError("has no 'actions' of shape (steps, numbers)", path=str(path))
    actions = actions.astype(float)
    if not np.isfinite(actions).all():
        raise FileFormatError("has actions that are not finite", path=str(path))
    fps = float(arrays["fps"]) if "fps" in arrays and arrays["fps"].size == 1 else None
    return WizardInput(path.name, actions.shape[1], fps, actions[:ROWS_MAX], horizon=min(len(actions), 1000))


def _of_dataset(path: Path) -> WizardInput:
    dataset = open_dataset(path)
    source, episode = find_source(dataset, ACTION), dataset.episodes[0]  # two of them do not join
    rows = source.of(dataset.table(episode, list(source.features)), episode)
    values = np.asarray(rows, dtype=float)[:ROWS_MAX]
    if not np.isfinite(values).all():
        raise DatasetError(f"{path} has actions that are not finite")
    try:
        layout = column_layout(dataset, source)
        spec = dataclasses.replace(layout.whole_spec, name=BY_NAMES, fps=dataset.fps)
    except DatasetError:
        spec = None
    named = tuple(zip(source.parts, source.names, strict=True))
    return WizardInput(path.name, source.dim, dataset.fps, values, named, spec)


def _of_checkpoint(path: Path) -> WizardInput:
    try:
        config = read_json(path / "config.json", SPEC_MAX)
    except (OSError, ReadingError) as error:
        why = (
            "has neither" if isinstance(error, FileNotFoundError) else f"has a config.json that cannot be read: {error}"
        )
        raise PolicyError(f"'{path}' {why}: a dataset has meta/info.json, a checkpoint config.json") from error
    try:
        dim = int(config["output_features"]["action"]["shape"][0])
        steps = int(config.get("chunk_size") or config.get("horizon") or 0)
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise PolicyError(f"{path}/config.json does not say how wide its action is: {error!r}") from error
    return WizardInput(path.name, dim, None, None, horizon=steps if 1 <= steps <= 1000 else None)
