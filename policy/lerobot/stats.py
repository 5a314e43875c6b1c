"""Whether a checkpoint's normalisation does what its network was trained with.

LeRobot 0.6.1 leaves numbers as they are, without a word, where statistics are missing or under another name; it
broadcasts statistics of length 1 over all numbers; and it divides by widths down to 1e-14.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from policy.action_spec.spec import ActionSpec
from policy.dataset.stats import DEVIATIONS_99, WIDTH_MIN, in_units
from policy.errors import did_you_mean
from policy.findings import Finding

if TYPE_CHECKING:
    from lerobot.configs import PreTrainedConfig

STATE, ACTION = "observation.state", "action"

POSITION_MAX = 2.0
"""Largest distance of a wrist from its frame's origin that can be meant [m]; the G1 reaches 0.6 m from its shoulder."""
ROT6D_MAX = 1.01
"""Largest entry of a rotation matrix, 1, with rounding."""

RANGES = {
    "MEAN_STD": ("mean", "std"),
    "MIN_MAX": ("min", "max"),
    "QUANTILES": ("q01", "q99"),
    "QUANTILE10": ("q10", "q90"),
}
"""Statistics that each normalisation of LeRobot reads."""


def normaliser(processor: Any, *, inverse: bool = False) -> Any | None:
    """The (un)normalising step of a pipeline, or None."""
    from lerobot.processor import NormalizerProcessorStep, UnnormalizerProcessorStep

    kind = UnnormalizerProcessorStep if inverse else NormalizerProcessorStep
    return next((step for step in processor.steps if isinstance(step, kind)), None)


def mode_of(step: Any, kind: str) -> str:
    """Normalisation of a kind of feature (``STATE``, ``ACTION``, ``VISUAL``) by a step."""
    from lerobot.configs import FeatureType

    mode = step.norm_map.get(FeatureType[kind])
    return "IDENTITY" if mode is None else mode.value


def bounds(step: Any, key: str, kind: str) -> tuple[np.ndarray, np.ndarray] | None:
    """What a step maps to -1 and 1, each of shape (n,); None without statistics or normalisation.

    For mean and standard deviation, where a normal distribution has its 1 % and 99 % quantiles.
    """
    mode = mode_of(step, kind)
    if mode not in RANGES or any(name not in step.stats.get(key, {}) for name in RANGES[mode]):
        return None
    first, second = (np.asarray(step.stats[key][name], dtype=float).ravel() for name in RANGES[mode])
    if mode == "MEAN_STD":
        return first - 0.5 * DEVIATIONS_99 * second, first + 0.5 * DEVIATIONS_99 * second
    return first, second


def check_stats(
    config: PreTrainedConfig,
    processors: tuple[Any, Any],
    layouts: Mapping[str, ActionSpec],
    *,
    allow_narrow: bool = False,
) -> list[Finding]:
    """Everything about the statistics that can be seen without data.

    Args:
        config: Of the policy.
        processors: Pre- and post-processor.
        layouts: What the numbers of ``observation.state`` and ``action`` are.
        allow_narrow: Accept numbers that hardly move in the data.
    """
    pre, post = normaliser(processors[0]), normaliser(processors[1], inverse=True)
    if pre is None or post is None:
        where = "pre-processor" if pre is None else "post-processor"
        text = f"the {where} of '{config.type}' has no normalising step of LeRobot's: numbers would pass as they are"
        return [Finding("statistics", "error", text, "take both processors from the training run, unchanged")]
    findings = []
    if STATE in layouts:
        findings += _check_numbers(pre, STATE, "STATE", layouts[STATE], allow_narrow, "pre-processor")
    relative = bool(getattr(config, "use_relative_actions", False))
    findings += _check_numbers(post, ACTION, "ACTION", layouts[ACTION], allow_narrow, "post-processor", relative)
    findings += _check_modes(config, pre, post)
    findings += _check_agreement(pre, post)
    for key in config.image_features:
        findings += _check_image(pre, key)
    if not findings:
        text = f"{mode_of(post, 'ACTION')} of {layouts[ACTION].dim} numbers, finite, wide enough, same before and after"
        findings.append(Finding("statistics", "ok", text))
    return findings


def _check_numbers(
    step: Any, key: str, kind: str, layout: ActionSpec, allow_narrow: bool, where: str, relative: bool = False
) -> Iterator[Finding]:
    mode = mode_of(step, kind)
    if mode not in RANGES:
        if mode != "IDENTITY":
            yield Finding("statistics", "warning", f"{key} is normalised by {mode}, which is not checked here")
        return
    cure = "recompute the statistics from the training data and save the processors again"
    problem = _missing(step, key, mode, where)
    if problem:
        yield Finding("statistics", "error", problem, cure)
        return
    for name in RANGES[mode]:
        values = np.asarray(step.stats[key][name], dtype=float).ravel()
        if len(values) != layout.dim:
            text = f"{key}.{name} of the {where} has {len(values)} numbers; '{layout.name}' has {layout.dim}"
            yield Finding("statistics", "error", text, "LeRobot would broadcast or fail; " + cure)
            return
        if not np.isfinite(values).all():
            i = int(np.flatnonzero(~np.isfinite(values))[0])
            text = f"{key}.{name} of the {where} is {values[i]} for {layout.feature_names[i]}"
            yield Finding("statistics", "error", text, cure)
            return
    low, high = bounds(step, key, kind)
    yield from _check_widths(key, layout, low, high, allow_narrow)
    if not relative:
        yield from _check_plausible(key, layout, low, high, strict=mode != "MEAN_STD")


def _missing(step: Any, key: str, mode: str, where: str) -> str:
    stats = step.stats
    if key not in stats:
        known = ", ".join(stats) or "none at all"
        near = did_you_mean(key, stats)
        return f"the {where} has no statistics for '{key}', so LeRobot would not normalise it; {near}there are: {known}"
    lacking = [name for name in RANGES[mode] if name not in stats[key]]
    return f"the {where} lacks {key}.{lacking[0]}, which {mode} needs" if lacking else ""


def _check_widths(
    key: str, layout: ActionSpec, low: np.ndarray, high: np.ndarray, allow_narrow: bool
) -> Iterator[Finding]:
    least, width = in_units(layout, WIDTH_MIN), high - low
    bad = np.flatnonzero(~(width >= least))
    if not len(bad):
        return
    i = int(bad[0])
    more = f" and {len(bad) - 1} more" if len(bad) > 1 else ""
    what = f"{key} {layout.feature_names[i]}{more}"
    text = f"{what} has a range of {width[i]:.3g}; {least[i]:.3g} is the least that is sound"
    if (width < 0.0).any():
        yield Finding("statistics", "error", text, "upper and lower bounds are exchanged: recompute the statistics")
    elif allow_narrow:
        yield Finding("statistics", "warning", text, "accepted on request; an action there stays where training had it")
    else:
        yield Finding(
            "statistics",
            "error",
            text,
            "noise there fills the whole range. Recompute with a floor on the range and train again, or allow narrow "
            "ranges (--allow-narrow) if these never move on the robot",
        )


def _check_plausible(
    key: str, layout: ActionSpec, low: np.ndarray, high: np.ndarray, *, strict: bool
) -> Iterator[Finding]:
    for slot in layout.slots:
        if slot.mode != "absolute":
            continue
        ends = np.abs(np.stack([low[slot.indices], high[slot.indices]]))
        if slot.kind == "rot6d" and strict and ends.max() > ROT6D_MAX:
            text = f"{key} {slot.name} reaches {ends.max():.3g}; an entry of a rotation matrix is at most 1"
            yield Finding("statistics", "error", text, "these statistics are of another quantity than the layout says")
        if slot.kind == "position" and slot.to_si(ends).max() > POSITION_MAX:
            text = f"{key} {slot.name} reaches {slot.to_si(ends).max():.3g} m; at most {POSITION_MAX} m can be meant"
            yield Finding("statistics", "error", text, "the data are in another unit or frame than the layout says")


def _check_modes(config: PreTrainedConfig, pre: Any, post: Any) -> Iterator[Finding]:
    """Refuse a kind of number with different normalisations: one that is not undone is not one."""
    cure = "take config.json and both processors from the same training run"
    for kind, key in (("ACTION", ACTION), ("STATE", STATE)):
        named = getattr(config, "normalization_mapping", {}).get(kind)
        modes = {
            "config.json": named.value if named is not None else "IDENTITY",
            "the pre-processor": mode_of(pre, kind),
        }
        if kind == "ACTION":
            modes["the post-processor"] = mode_of(post, kind)
        if len(set(modes.values())) > 1:
            text = f"{key} is normalised by {', '.join(f'{mode} in {where}' for where, mode in modes.items())}"
            yield Finding("statistics", "error", text, cure)


def _check_agreement(pre: Any, post: Any) -> Iterator[Finding]:
    """Training normalised actions with the pre-processor; what the post-processor does must undo that."""
    before, after = pre.stats.get(ACTION), post.stats.get(ACTION)
    if before is None or after is None:
        return
    for name in RANGES.get(mode_of(post, "ACTION"), ()):
        if name in before and name in after and not np.array_equal(before[name], after[name]):
            text = f"action.{name} differs between pre- and post-processor"
            cure = "take both from the same training run: the network was trained with the pre-processor's"
            yield Finding("statistics", "error", text, cure)


def _check_image(step: Any, key: str) -> Iterator[Finding]:
    mode = mode_of(step, "VISUAL")
    if mode not in RANGES:
        return
    problem = _missing(step, key, mode, "pre-processor")
    if not problem:
        for name in RANGES[mode]:
            values = np.asarray(step.stats[key][name], dtype=float)
            if values.size != 3 or not np.isfinite(values).all():
                problem = f"{key}.{name} is {values.ravel()[:4].tolist()}; three finite numbers, one a colour, are due"
    if problem:
        cure = "save the processors again with the statistics of the training data"
        yield Finding("statistics", "error", problem, cure)
