"""A layout in words and numbers: every slot with unit, frame, order and limits, and what it is in the stance."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import Any

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import LAYOUTS, builtin
from policy.action_spec.slot import ROTATIONS, Slot
from policy.action_spec.spec import ActionSpec
from policy.action_spec.state import state_layout, state_numbers

FRAMES = {
    "pelvis": "as measured at the observation; x forward, y left, z up along the trunk",
    "pelvis_yaw": "the pelvis as measured at the observation, turned upright",
    "torso": "as measured at the observation",
    "stance": "between the soles, level, x along the feet, z up; it stands still in a reach and goes with steps",
    "world": "where the robot first stood, on the floor between the soles; x forward, y left, z up",
}
MODES = {
    "relative_se3": "relative to the state, T_frame_wrist @ T_number",
    "relative_add": "relative to the state, added to it",
    "delta": "each step added to the one before, the first to the state",
    "delta_se3": "each step in the hand as it was at the one before, T_frame_wrist @ T_number",
}
ELEMENTS = {
    "cols": tuple(f"R[{row}, {col}]" for col in (0, 1) for row in range(3)),
    "rows": tuple(f"R[{row}, {col}]" for row in (0, 1) for col in range(3)),
    "interleaved": tuple(f"R[{row}, {col}]" for row in range(3) for col in (0, 1)),
}
"""What each number of a rot6d is, R the rotation of the wrist in its frame."""
COLUMNS = f"  {'':<4}{'':<28}{'stance':>9}{'least':>9}{'largest':>9}"


def summary(name: str) -> str:
    """A built-in layout in one line: its name and the first sentence of its description.

    Raises:
        SpecError: If there is none of that name.
    """
    builtin(name)
    return f"{name:<20}{(LAYOUTS[name].__doc__ or '').strip().splitlines()[0].replace('``', '')}"


def lines(spec: ActionSpec) -> list[str]:
    """Every slot and number of a layout, for people."""
    stance, height = stance_numbers(spec), Anchor.nominal(robot=spec.robot).T_world_base[2, 3]
    lines = [
        f"{spec.id}: {spec.dim} numbers a step, {spec.horizon} steps a chunk at {spec.fps:g} Hz",
        *_versions(spec),
        f"stance: the numbers of the robot standing still, its pelvis {height:.3f} m above the floor",
        "least, largest: of the layout, which clips to them; else the range of the joint",
    ]
    if spec.masked:
        lines.append(f"a mask of {spec.dim} comes with each chunk; what it leaves out is not there")
    if spec.name in LAYOUTS and builtin(spec.name, spec.robot) == spec and (source := _source(spec.name)):
        lines += textwrap.wrap(f"source: {source}", 100)
    lines += [f"frame {frame}: {FRAMES[frame]}" for frame in frames(spec)]
    lines += textwrap.wrap(_state_of(spec), 120)
    for slot in spec.slots:
        lines += ["", _heading(slot, spec.robot)]
        if slot.kind == "ignored":
            continue
        lines.append(COLUMNS)
        for i, name, (low, high) in zip(range(slot.size), _names(slot), _limits(slot, spec.robot), strict=True):
            at = slot.start + i
            lines.append(f"  {at:<4}{name:<28}{_number(stance[at])}{_number(low)}{_number(high)}".rstrip())
    return lines


def table(spec: ActionSpec) -> dict[str, Any]:
    """Every slot and number of a layout, for programs: its JSON, and of each number what `lines` says of it."""
    stance, numbers = stance_numbers(spec), []
    for slot in spec.slots:
        if slot.kind == "ignored":
            continue
        for i, name, (low, high) in zip(range(slot.size), _names(slot), _limits(slot, spec.robot), strict=True):
            at = slot.start + i
            numbers.append(
                {"number": at, "name": name, "slot": slot.name, "unit": slot.unit, "stance": float(stance[at]),
                 "least": low, "largest": high}
            )  # fmt: skip
    where = {frame: FRAMES[frame] for frame in frames(spec)}
    return {"id": spec.id, "layout": spec.to_dict(), "dim": spec.dim, "frames": where, "numbers": numbers}


def _source(name: str) -> str:
    """Where a built-in layout is from, as its description says."""
    text = (LAYOUTS[name].__doc__ or "").partition("Source:")[2]
    return " ".join(text.replace("``", "").split())


def frames(spec: ActionSpec) -> tuple[str, ...]:
    """Frames that poses of a layout are in, in the order of its slots."""
    poses = (slot for slot in spec.slots if slot.kind == "position" or slot.kind in ROTATIONS)
    return tuple(dict.fromkeys(slot.frame for slot in poses))


def called(spec: ActionSpec) -> str:
    """A layout in a few words: its id, and the frame of its wrists where it has them."""
    return spec.id + "".join(f", wrists in the {frame}" for frame in frames(spec)[:1])


def _versions(spec: ActionSpec) -> list[str]:
    """Where the other versions of a built-in layout have the wrists."""
    others = (builtin(name) for name in LAYOUTS)
    others = [other for other in others if other.name == spec.name and other.version != spec.version]
    return [f"version {other.version} has the wrists in the {frames(other)[0]}: {other.id}" for other in others]


def _state_of(spec: ActionSpec) -> str:
    """The state that goes with a layout, by what differs from the action."""
    state = state_layout(spec)
    new = ", ".join(slot.name for slot in state.slots if spec.slot(slot.name) is None)
    gone = ", ".join(slot.name for slot in spec.slots if state.slot(slot.name) is None)
    changes = (f", with {new}" if new else "") + (f" in place of {gone}" if gone else "")
    return f"state: {state.dim} numbers{changes}"


def stance_numbers(spec: ActionSpec) -> np.ndarray:
    """The numbers of a step that leaves the robot where it stands, shape (dim,)."""
    anchor = Anchor.nominal(robot=spec.robot)
    return state_numbers(spec, anchor.observation(), anchor)


def _heading(slot: Slot, robot: RobotSpec) -> str:
    unit = "" if slot.unit == "1" else f" [{slot.unit}]"
    parts = [f"{slot.name}: {slot.kind}{unit}"]
    if slot.kind == "position" or slot.kind in ROTATIONS:
        wrist = robot.tool(slot.name.split("_", maxsplit=1)[0]).wrist_frame
        offset = f" moved by {slot.tcp_offset} m" if any(slot.tcp_offset) else ""
        parts.append(f"{wrist}{offset} in the {slot.frame}")
    if slot.kind == "force":
        parts.append(f"of the world on the palm, in the {slot.frame}")
    if slot.kind == "axes":
        parts.append("ahead, to the left and up in the stance, either way")
    if slot.kind == "ignored":
        return f"{slot.name}: {slot.size} ignored: {slot.reason}"
    if slot.closing is not None:
        parts.append(f"{slot.closing[0]:g} open, {slot.closing[1]:g} closed")
    elif slot.name.endswith("_grasp"):
        parts.append("motor of a Dex1 gripper, 0 closed" if slot.unit == "dex1 rad" else "0 open, 1 closed")
    if slot.name == "base_height" and slot.frame == "stance":
        parts.append("of the pelvis above the soles")
    if slot.name.endswith("_leg"):
        parts.append("where the pelvis is over feet that stay; what asks for a step is refused")
    if slot.mode in MODES:
        parts.append(MODES[slot.mode])
    if slot.orientation == "free":
        parts.append("free: what is lost of it is no fault")
    return ", ".join(parts)


def _names(slot: Slot) -> Iterator[str]:
    if slot.kind != "rot6d":
        yield from slot.feature_names
        return
    for name, element in zip(slot.feature_names, ELEMENTS[slot.rot6d_layout], strict=True):
        yield f"{name:<20} {element}"


def _limits(slot: Slot, robot: RobotSpec) -> Iterator[tuple[float | None, float | None]]:
    """The slot's own limits, else the joints' ranges; none where numbers are free, or relative."""
    if slot.limits is not None:
        yield from slot.limits
    elif slot.kind == "joint" and slot.mode == "absolute":
        for joint in (robot.joints[robot.index(name)] for name in slot.joint_names):
            low, high = slot.from_si(np.array([joint.position_min, joint.position_max]))
            yield float(low), float(high)
    else:
        yield from [(None, None)] * slot.size


def _number(value: float | None) -> str:
    # Adding 0.0 makes a minus zero a zero.
    return f"{'':>9}" if value is None else f"{round(value, 3) + 0.0:>9.3f}"
