"""A recording looked at before it is played: what its numbers may be instead of what they are called."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.slot_values import NOT_FOLLOWED
from policy.action_spec.spec import ActionSpec
from policy.dataset.joint_layout import JointLayout
from policy.dataset.joint_values import check_values
from policy.dataset.naming.meaning import GRASPS
from policy.dataset.naming.vouched import column_names
from policy.errors import DatasetError, FileFormatError
from policy.findings import Finding
from policy.suspicion.closings import closing_findings
from policy.suspicion.corrections import AS_NAMED, HANDS_ONLY, Table, corrected, require_known
from policy.suspicion.joint_table import joint_findings
from policy.suspicion.poses import wrist_findings
from policy.suspicion.rows import row_findings

START = 0.15
"""Difference of a first step from the measured joints of the same file from which it is told [rad]; chosen: policies
begin within a tenth of it."""
RANGE_SLACK = 1e-3
"""How far a joint may be asked past its range without a word [rad]; chosen: rounding of files and networks."""


def read_as_said(spec: ActionSpec, actions: np.ndarray, fps: float, read_as: Sequence[str]) -> tuple[np.ndarray, float]:
    """Actions (H, A) and their rate [Hz] as a user says that they are to be read.

    Raises:
        ReadAsError: If that is not known, or has no meaning for them.
    """
    require_known(read_as)
    table = corrected(Table(column_names(spec)[0], np.asarray(actions, dtype=float), fps, spec.robot), read_as)
    return table.values, table.fps


def spec_as_said(spec: ActionSpec, read_as: Sequence[str]) -> ActionSpec:
    """A layout without its legs where a user says that the hands alone are judged."""
    legs = [slot.name for slot in spec.slots if slot.name in ("left_leg", "right_leg")]
    return spec.without(legs, "hands alone are judged, as --read-as says") if HANDS_ONLY in read_as else spec


def action_findings(
    spec: ActionSpec, actions: np.ndarray, anchor: Anchor, fps: float, measured: Mapping[str, float] | None = None
) -> list[Finding]:
    """Hypotheses about raw actions.

    Args:
        spec: What they are called.
        actions: Finite, shape (H, A).
        anchor: Where they are read from.
        fps: Steps a second [Hz].
        measured: Joints at the first step by name [rad], as far as a file says them.

    Returns:
        Errors and warnings, the worst first.
    """
    names, q = _joints_of(spec, actions)
    hints = _hinted(spec, names)
    found = joint_findings([name if name not in hints else "" for name in names], q, spec.robot)
    found += wrist_findings(spec, actions, anchor)
    found += closing_findings(spec, actions, fps)
    found += row_findings(actions)
    found += _out_of_range(spec, names, q, known=any(one.level == "error" for one in found))
    found += _start(names, q, measured or {})
    return sorted(found, key=lambda one: one.level != "error")


def settled(found: Sequence[Finding], read_as: Sequence[str], path: str) -> tuple[str, ...]:
    """Notes of findings.

    Raises:
        FileFormatError: If there are errors, and the user does not say that the numbers are what they are called.
    """
    errors = [one for one in found if one.level == "error"]
    if errors and AS_NAMED not in read_as:
        texts: dict[str, list[str]] = {}
        for one in errors:  # a cure of several is said once
            texts.setdefault(one.cure, []).append(one.text)
        said = (f"{' and '.join(found)}; {cure}" if cure else " and ".join(found) for cure, found in texts.items())
        raise FileFormatError("; ".join(said), path=path)
    return tuple(one.sentence for one in found)


def _joints_of(spec: ActionSpec, actions: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
    """Names of absolute joints, empty elsewhere, and all numbers with joints in rad."""
    names, values = list(column_names(spec)[0]), np.array(actions, dtype=float)
    for slot in spec.slots:
        if slot.kind == "joint" and slot.mode == "absolute":
            values[:, slot.indices] = slot.to_si(values[:, slot.indices])
        else:
            names[slot.indices] = [""] * slot.size
    return tuple(names), values


def _hinted(spec: ActionSpec, names: Sequence[str]) -> list[str]:
    """Joints that are only a hint, beside wrists that are followed."""
    return [name for name in names if name and "_hand_" not in name] if spec.slot("left_wrist_position") else []


def _out_of_range(spec: ActionSpec, names: Sequence[str], q: np.ndarray, *, known: bool) -> list[Finding]:
    """Joints past their range: refused as those of datasets are, or noted; those that are only hints are noted."""
    if known:
        return []
    hints = _hinted(spec, names)
    q = q.copy()
    grasps = [slot.name for slot in spec.slots if slot.unit == "dex1 rad" and slot.mode == "absolute"]
    kept = [name if name in spec.robot.joint_names and name not in hints else "" for name in names]
    for slot in spec.slots:
        if slot.name in grasps and slot.name in GRASPS:
            kept[slot.start] = slot.name
        if slot.kind == "fingers" and slot.mode == "absolute":
            kept[slot.indices] = [f"{slot.name}_{finger}" for finger in slot.joint_names]
            if sorted(slot.closing) != [0.0, 1.0]:
                q[:, slot.indices] = slot.to_si(q[:, slot.indices])
    found = refused_values(JointLayout(tuple(kept), spec.feature_names, robot=spec.robot), q)
    return found + _hints(spec, [names.index(name) for name in hints], names, q)


def refused_values(layout: JointLayout, q: np.ndarray) -> list[Finding]:
    """Joints (n, D) past their ranges: refused as those of datasets are, or noted."""
    try:
        check_values(layout, q, feature="actions")
    except DatasetError as error:
        return [Finding("joint_range", "error", str(error), "--read-as as_named reads it all the same")]
    return _hints(
        layout, [i for i, name in enumerate(layout.names) if name in layout.robot.joint_names], layout.names, q, ""
    )


def _hints(
    spec: ActionSpec | JointLayout, columns: Sequence[int], names: Sequence[str], q: np.ndarray,
    what: str = f", and {NOT_FOLLOWED}: the wrists are",
) -> list[Finding]:  # fmt: skip
    robot, worst = spec.robot, {}
    for i in columns:
        index = robot.index(names[i])
        low, high = robot.position_min[index], robot.position_max[index]
        excess = float(np.maximum(low - q[:, i], q[:, i] - high).max())
        if excess > RANGE_SLACK and "_hand_" not in names[i]:
            worst[names[i]] = (excess, low, high)
    return [
        Finding("joint_range", "warning",
                f"{name} is asked up to {excess:.3g} rad beyond its limit{what} (range {low:.3g} to {high:.3g} rad)")
        for name, (excess, low, high) in sorted(worst.items(), key=lambda item: -item[1][0])[:4]
    ]  # fmt: skip


def _start(names: Sequence[str], q: np.ndarray, measured: Mapping[str, float]) -> list[Finding]:
    away = {name: abs(q[0, i] - measured[name]) for i, name in enumerate(names) if name in measured}
    if not away or max(away.values()) <= START:
        return []
    name = max(away, key=away.get)
    count = sum(distance > START for distance in away.values())
    return [Finding(
        "start", "warning",
        f"row 0 is up to {away[name]:.2f} rad from the measured pose in q0_joints, a jump or numbers relative to it "
        f"({name}; {count} joints by more than {START} rad)",
        "name a layout whose slots have the mode relative_add, if they are differences",
    )]  # fmt: skip


def with_notes[T](chunk: T, notes: Sequence[str]) -> T:
    """A chunk with more notes."""
    return replace(chunk, notes=(*chunk.notes, *notes)) if notes else chunk
