"""Raw action vectors to chunks and back, as an action spec says.

Legend: F is the slot's frame at the anchor, tool the wrist moved by ``tcp_offset``, ref the anchor's own state. What a
number v of step k means, by mode:

==============  ======================================  ==================================  ======================
mode            position                                rotation                            joint, scalar
==============  ======================================  ==================================  ======================
absolute        p = v                                   R = R(v)                            x = v
relative_se3    p = p_ref + R_ref v                     R = R_ref R(v)                      --
relative_add    p = p_ref + v                           R = R(numbers of R_ref + v)         x = x_ref + v
delta           p[k] = p[k-1] + v                       R[k] = R(v) R[k-1]                  x[k] = x[k-1] + v
delta_se3       p[k] = p[k-1] + R[k-1] v                R[k] = R[k-1] R(v)                  --
==============  ======================================  ==================================  ======================

with ``p[-1] = p_ref``, ``R[-1] = R_ref``. relative_se3 is GR00T's, UMI's and UnifoLM-WLA's ``T_ref @ T_rel``, with both
slots of a wrist; relative_add is LeRobot's ``use_relative_actions``; in delta both are along the axes of F, in
delta_se3 along those of the hand at the step before.
"""

from __future__ import annotations

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.frame_guess import pelvis_guess, unit_guess, world_guess
from policy.action_spec.hands import SIDES, closing_of, finger_closings
from policy.action_spec.mask import unmasked
from policy.action_spec.pelvis_path import PelvisPath, pelvis_path, tilt_of
from policy.action_spec.slot import OF_TOUCH, Slot
from policy.action_spec.slot_values import (
    CLIPPED,
    NOT_FOLLOWED,
    decode_fingers,
    decode_touch,
    encode_touch,
    floor_of,
    joint_values,
    ordered_as,
    resolved,
    to_mode,
)
from policy.action_spec.spec import ActionSpec
from policy.action_spec.wrist_codec import decode_wrist, encode_wrist
from policy.chunk import ActionChunk
from policy.errors import ChunkError, SpecError
from policy.geometry.rotations import angle_between
from policy.geometry.se3 import inverse
from policy.joints import joints_of
from policy.kinematics.forward import kinematics
from policy.kinematics.inverse import arm_joints

NUMBER_MAX = 1e6
"""Largest number of an action that can be meant, in whatever unit: a kilometre in millimetres."""
HINT_TOLERANCE = 1e-4
"""Metres and radians within which given arm joints must reach the given pose to be used in `encode`."""

WALK, RISE = 0.05, 0.05
"""Speed of the base [m/s, rad/s] and difference of its height from the pelvis's [m] from which a chunk has a note that
nobody walks or rises for it; chosen: above what networks scatter by."""

CLIP_TOLERANCE = 1e-3
"""Excess over a limit that is clipped without a word [unit of the slot]; chosen: rounding of files and networks."""

_SIDES = (("left", "lhand"), ("right", "rhand"))


def decode(
    spec: ActionSpec, actions: np.ndarray, anchor: Anchor, *, seq: int = 0, t_obs: float = 0.0,
    fps: float | None = None, mask: np.ndarray | None = None,
) -> ActionChunk:  # fmt: skip
    """Chunk from raw actions, anchored in time and world.

    Args:
        spec: What the numbers mean.
        actions: Raw actions in the units of the spec, shape (H, A); H need not be the spec's horizon.
        anchor: Pelvis and soles that the chunk is fixed to, and the state that relative slots refer to.
        seq: Number of the chunk within the episode.
        t_obs: Time of step 0 [s].
        fps: Rate if it is not the spec's [Hz].
        mask: Which numbers are there, shape (A,), (H,) or (H, A), bool; needed by a masked spec, of no other.

    Raises:
        ChunkError: If the shape is wrong, or a number is not finite or no rotation, or legs ask for a step; names step
            and slot.
    """
    given, (spec, actions) = spec, unmasked(spec, _checked(spec, actions), mask)
    actions, notes = _clip(spec, actions)
    notes += given.said_ignored
    notes += world_guess(spec, actions, anchor) + pelvis_guess(spec, actions, anchor)
    waist, pelvis = joint_values(spec.slot("waist"), actions, anchor), pelvis_path(spec, actions, anchor)
    notes += pelvis.notes
    arms = {side: joint_values(spec.slot(f"{side}_arm"), actions, anchor) for side, _ in _SIDES}
    wrists, fingers = {}, {}
    for side, hand in _SIDES:
        wrists[hand] = (
            decode_wrist(spec, side, actions, anchor)
            if spec.slot(f"{side}_wrist_position")
            else pelvis.T_world_base @ _reached(anchor, side, hand, arms[side], waist)
        )
        fingers[hand], finger_notes = decode_fingers(spec, side, actions, anchor)
        notes += finger_notes
    notes += unit_guess(wrists, anchor)
    height, velocity = _height(spec, actions, anchor, pelvis), _velocity(spec, actions, anchor)
    notes += _not_followed(height, velocity, anchor, pelvis)
    chunk = ActionChunk(
        spec_id=given.id,
        seq=seq,
        t_obs=float(t_obs),
        fps=float(spec.fps if fps is None else fps),
        T_world_lhand=wrists["lhand"],
        T_world_rhand=wrists["rhand"],
        q_lhand=fingers["lhand"],
        q_rhand=fingers["rhand"],
        q_larm=arms["left"],
        q_rarm=arms["right"],
        q_waist=waist,
        q_legs=pelvis.q_legs,
        base_height=height,
        base_velocity=velocity,
        hands_in=_hands_in(spec),
        notes=notes,
        **decode_touch(spec, actions, anchor),
    )
    # Every pose is a product of rotations that were made orthonormal.
    chunk.validate(rotations=False, robot=anchor.robot)
    return chunk


def _hands_in(spec: ActionSpec) -> str:
    """Frame in which a layout has the hands."""
    position = spec.slot("left_wrist_position") or spec.slot("right_wrist_position")
    if position is not None:
        return position.frame
    return "soles" if spec.slot("left_leg") or spec.slot("right_leg") else "pelvis"


def _height(spec: ActionSpec, actions: np.ndarray, anchor: Anchor, pelvis: PelvisPath) -> np.ndarray | None:
    """Height of the pelvis (H,) [m], as asked for or as the legs put it; None where neither says it."""
    slot = spec.slot("base_height")
    if slot is not None:
        return resolved(slot, actions, anchor)[:, 0] + floor_of(slot, anchor)
    return pelvis.T_world_base[:, 2, 3].copy() if pelvis.q_legs is not None else None


def _velocity(spec: ActionSpec, actions: np.ndarray, anchor: Anchor) -> np.ndarray | None:
    """Planar velocity and yaw rate (H, 3) [m/s, rad/s]; None where neither is asked for."""
    planar, rate = spec.slot("base_velocity"), spec.slot("base_yaw_rate")
    if planar is None and rate is None:
        return None
    velocity = np.zeros((len(actions), 3))
    for slot, where in ((planar, slice(0, planar.size if planar else 0)), (rate, slice(2, 3))):
        if slot is not None:
            velocity[:, where] = resolved(slot, actions, anchor)
    return velocity


def _not_followed(
    height: np.ndarray | None, velocity: np.ndarray | None, anchor: Anchor, pelvis: PelvisPath
) -> tuple[str, ...]:
    """Notes on a base that is to move: the feet stay, and pelvis and waist go where hands and balance need them."""
    here = pelvis.T_world_base[:, 2, 3] if pelvis.q_legs is not None else anchor.T_world_base[2, 3]
    away = 0.0 if height is None else float(np.abs(height - here).max())
    notes = () if velocity is None else feet_stay(velocity)
    if away > RISE:
        notes += (f"base_height asks for up to {away:.2g} m more or less and {NOT_FOLLOWED}: hands move the pelvis",)
    return notes


def feet_stay(velocity: np.ndarray) -> tuple[str, ...]:
    """Note on velocities of a base (H, 3) that nobody walks with, if they are more than rest [m/s, rad/s]."""
    if (speed := float(np.abs(velocity).max())) <= WALK:
        return ()
    return (f"base_velocity asks for up to {speed:.2g} m/s or rad/s and {NOT_FOLLOWED}: the feet stay",)


def encode(spec: ActionSpec, chunk: ActionChunk, anchor: Anchor) -> np.ndarray:
    """Raw actions (H, A) that `decode` turns into the chunk, with the same anchor.

    What a layout asks for and the chunk lacks is filled in: waist, legs, tilt and base height from the anchor, zero
    velocity, no force on the hands, arm joints by inverse kinematics, 0 for what is ignored. A layout with a number a
    hand or a finger keeps only how closed they are.

    Raises:
        ChunkError: If the chunk is malformed, or the arms of a joint layout cannot reach a pose.
    """
    chunk.validate(robot=anchor.robot)
    arms = [slot for slot in spec.slots if slot.name.endswith("_arm")]
    short = [slot.name for slot in arms if slot.size < len(joints_of(anchor.robot, slot.name))]
    actions = encode_valid(spec, chunk, anchor)
    for name in short:
        side, hand = name.removesuffix("_arm"), {"left_arm": "lhand", "right_arm": "rhand"}[name]
        arm, waist = (joint_values(spec.slot(part), actions, anchor) for part in (name, "waist"))
        T = anchor.T_world_base @ _reached(anchor, side, hand, arm, waist)
        off = np.linalg.norm(T[:, :3, 3] - getattr(chunk, f"T_world_{hand}")[:, :3, 3], axis=1)
        if off.max() > HINT_TOLERANCE:
            k = int(off.argmax())
            raise ChunkError(
                f"the {side} hand of '{spec.name}' would be {off[k]:.3g} m from its pose at step {k}: its wrist lacks "
                "pitch and yaw",
                step=k,
                slot=name,
            )
    return actions


def encode_valid(spec: ActionSpec, chunk: ActionChunk, anchor: Anchor) -> np.ndarray:
    """`encode` for a chunk that was validated or made from something that was."""
    actions = np.zeros((len(chunk), spec.dim))
    for side, hand in _SIDES:
        for slot, numbers in encode_wrist(spec, side, getattr(chunk, f"T_world_{hand}"), anchor):
            actions[:, slot.indices] = numbers
    for slot in spec.slots:
        if slot.kind != "ignored" and not slot.name.endswith(("_wrist_position", "_wrist_rotation")):
            numbers = slot.from_si(_values_for(slot, spec, chunk, anchor))
            actions[:, slot.indices] = to_mode(slot, numbers, anchor)
    return actions


def _checked(spec: ActionSpec, actions: np.ndarray) -> np.ndarray:
    actions = np.asarray(actions)
    if actions.dtype.kind not in "fiu":
        raise ChunkError(f"the actions are of type {actions.dtype}; numbers are expected")
    if actions.ndim != 2 or actions.shape[1] != spec.dim or len(actions) < 1:
        raise ChunkError(f"the actions have shape {actions.shape}; '{spec.name}' has (steps, {spec.dim})")
    with np.errstate(over="ignore"):
        actions = actions.astype(float)
    bad = ~(np.abs(actions) <= NUMBER_MAX)
    if bad.any():
        step, column = (int(i) for i in np.argwhere(bad)[0])
        name = next(slot.name for slot in spec.slots if column < slot.start + slot.size)
        raise ChunkError(
            f"action {column} ({spec.feature_names[column]}) is {actions[step, column]} at step {step}; "
            f"{int(bad.sum())} of {actions.size} numbers are not finite or beyond {NUMBER_MAX:g}",
            step=step,
            slot=name,
        )
    return actions


def _clip(spec: ActionSpec, actions: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    notes = []
    for slot in spec.slots:
        if slot.limits is None:
            continue
        given = actions[:, slot.indices].copy()
        low, high = np.array(slot.limits).T
        actions[:, slot.indices] = np.clip(given, low, high)
        excess = np.abs(given - actions[:, slot.indices])
        if excess.max() > CLIP_TOLERANCE:
            count, worst = int((excess > CLIP_TOLERANCE).sum()), float(excess.max())
            unit = "of its range" if slot.unit == "1" else slot.unit
            notes.append(f"{slot.name}: {count} numbers {CLIPPED}, by up to {worst:.3g} {unit}")
    return actions, tuple(notes)


def _reached(anchor: Anchor, side: str, hand: str, arm: np.ndarray | None, waist: np.ndarray | None) -> np.ndarray:
    """``T_base_hand`` (H, 4, 4) of arm joints, with the given waist or the anchor's."""
    if arm is None:
        raise SpecError(f"a layout needs the {side} wrist or the joints of its arm")
    q_body = np.tile(anchor.q_body, (len(arm), 1))
    q_body[:, anchor.robot.limbs[f"{side}_arm"]] = arm
    if waist is not None:
        q_body[:, anchor.robot.limbs["waist"]] = waist
    return kinematics(anchor.robot).poses(q_body)[hand]


def _values_for(slot: Slot, spec: ActionSpec, chunk: ActionChunk, anchor: Anchor) -> np.ndarray:
    """SI values (H, size) that a chunk has for a joint, scalar or velocity slot, in the slot's order."""
    steps, side = len(chunk), SIDES[not slot.name.startswith("left_")]
    q_hand = chunk.q_lhand if side == "left" else chunk.q_rhand
    if slot.name.startswith("base_"):
        return _base_values(slot, chunk, anchor)
    if slot.name in OF_TOUCH:
        return encode_touch(slot, chunk, anchor)
    if slot.kind == "fingers":
        return finger_closings(side, slot.joint_names, q_hand, anchor.robot)
    if slot.kind == "scalar":
        return closing_of(side, q_hand, anchor.robot)[:, None]
    if slot.name == "waist":
        q = _waist_of(chunk, anchor)
    elif slot.name.endswith("_arm"):
        q = _arm_of(side, spec, chunk, anchor)
    else:
        leg = anchor.robot.limbs.get(slot.name)
        q = q_hand if leg is None else np.tile(anchor.q_body[leg], (steps, 1))
    return ordered_as(slot, q, anchor)


def _base_values(slot: Slot, chunk: ActionChunk, anchor: Anchor) -> np.ndarray:
    """SI values (H, size) of a slot of the base."""
    steps = len(chunk)
    if slot.name == "base_tilt":
        return np.tile(tilt_of(anchor.T_world_base), (steps, 1))
    if slot.name == "base_height":
        filled = np.full(steps, anchor.T_world_base[2, 3])
        return (filled if chunk.base_height is None else chunk.base_height)[:, None] - floor_of(slot, anchor)
    velocity = np.zeros((steps, 3)) if chunk.base_velocity is None else chunk.base_velocity
    return velocity[:, 2:] if slot.name == "base_yaw_rate" else velocity[:, : slot.size]


def _waist_of(chunk: ActionChunk, anchor: Anchor) -> np.ndarray:
    if chunk.q_waist is not None:
        return chunk.q_waist
    return np.tile(anchor.q_body[anchor.robot.limbs["waist"]], (len(chunk), 1))


def _arm_of(side: str, spec: ActionSpec, chunk: ActionChunk, anchor: Anchor) -> np.ndarray:
    """Arm joints (H, n) that reach the chunk's poses: its own where they do, else by inverse kinematics."""
    hand = "lhand" if side == "left" else "rhand"
    waist = _waist_of(chunk, anchor) if spec.slot("waist") else None
    T_base_hand = inverse(anchor.T_world_base) @ getattr(chunk, f"T_world_{hand}")
    hint = chunk.q_larm if side == "left" else chunk.q_rarm
    if hint is not None:
        T = _reached(anchor, side, hand, hint, waist)
        distance = np.linalg.norm(T[:, :3, 3] - T_base_hand[:, :3, 3], axis=1)
        angle = angle_between(T[:, :3, :3], T_base_hand[:, :3, :3])
        if max(distance.max(), angle.max()) <= HINT_TOLERANCE:
            return hint
    return arm_joints(hand, T_base_hand, anchor.q_body, q_waist=waist, robot=anchor.robot)
