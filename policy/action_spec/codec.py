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
==============  ======================================  ==================================  ======================

with ``p[-1] = p_ref``, ``R[-1] = R_ref``. relative_se3 is GR00T's and UMI's ``T_ref @ T_rel``, with both slots of a
wrist; relative_add is LeRobot's ``use_relative_actions``; in delta both are along the axes of F.
"""

from __future__ import annotations

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.frame_guess import unit_guess, world_guess
from policy.action_spec.hands import closing_of, finger_range, grasp_posture
from policy.action_spec.slot import TARGETS, Slot
from policy.action_spec.spec import ActionSpec
from policy.action_spec.wrist_codec import decode_wrist, encode_wrist
from policy.chunk import ActionChunk
from policy.errors import ChunkError
from policy.geometry.rotations import angle_between
from policy.geometry.se3 import inverse
from policy.joints import LEFT_ARM, RIGHT_ARM, WAIST, permutation
from policy.kinematics.forward import kinematics
from policy.kinematics.inverse import arm_joints

NUMBER_MAX = 1e6
"""Largest number of an action that can be meant, in whatever unit: a kilometre in millimetres."""
HINT_TOLERANCE = 1e-4
"""Metres and radians within which given arm joints must reach the given pose to be used in `encode`."""

FINGER_TOLERANCE = 1e-3
"""How far a finger may be asked past its range without a word: the rounding of files and networks [rad, 1]."""

WALK, RISE = 0.05, 0.05
"""Speed of the base [m/s, rad/s] and difference of its height from the pelvis's [m] from which a chunk has a note that
nobody walks or rises for it; chosen: above what networks scatter by."""

_SIDES = (("left", "lhand"), ("right", "rhand"))
_ARMS = {"left": LEFT_ARM, "right": RIGHT_ARM}


def decode(
    spec: ActionSpec, actions: np.ndarray, anchor: Anchor, *, seq: int = 0, t_obs: float = 0.0, fps: float | None = None
) -> ActionChunk:
    """Chunk from raw actions.

    Args:
        spec: What the numbers mean.
        actions: Raw actions in the units of the spec, shape (H, A); H need not be the spec's horizon.
        anchor: Pelvis that the chunk is fixed to, and the state that relative slots refer to.
        seq: Number of the chunk within the episode.
        t_obs: Time of step 0 [s].
        fps: Rate if it is not the spec's [Hz].

    Raises:
        ChunkError: If the shape is wrong, or a number is not finite or no rotation; names step and slot.
    """
    actions, notes = _clip(spec, _checked(spec, actions))
    notes += world_guess(spec, actions, anchor)
    steps = len(actions)
    waist = _joint_values(spec.slot("waist"), actions, anchor)
    arms = {side: _joint_values(spec.slot(f"{side}_arm"), actions, anchor) for side, _ in _SIDES}
    wrists, fingers = {}, {}
    for side, hand in _SIDES:
        if spec.slot(f"{side}_wrist_position"):
            wrists[hand] = decode_wrist(spec, side, actions, anchor)
        else:
            wrists[hand] = anchor.T_world_base @ _reached(anchor, side, hand, arms[side], waist)
        fingers[hand], said = _decode_fingers(spec, side, actions, anchor)
        notes += said
    notes += unit_guess(wrists, anchor)
    slots = [spec.slot(name) for name in ("base_height", "base_velocity")]
    height, velocity = (_resolved(slot, actions, anchor) if slot else None for slot in slots)
    notes += _not_followed(height, velocity, anchor)
    chunk = ActionChunk(
        spec_id=spec.id,
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
        base_height=None if height is None else height[:, 0],
        base_velocity=None if velocity is None else velocity.reshape(steps, 3),
        notes=notes,
    )
    # Every pose above is a product of rotations that were made orthonormal.
    chunk.validate(rotations=False)
    return chunk


def _not_followed(height: np.ndarray | None, velocity: np.ndarray | None, anchor: Anchor) -> tuple[str, ...]:
    """Notes on a base that is to move: the feet stay, and pelvis and waist go where hands and balance need them."""
    away = 0.0 if height is None else float(np.abs(height - anchor.T_world_base[2, 3]).max())
    speed = 0.0 if velocity is None else float(np.abs(velocity).max())
    notes = ()
    if speed > WALK:
        notes += (f"base_velocity asks for up to {speed:.2g} m/s or rad/s and is not followed: the feet stay",)
    if away > RISE:
        notes += (f"base_height asks for up to {away:.2g} m more or less and is not followed: hands move the pelvis",)
    return notes


def encode(spec: ActionSpec, chunk: ActionChunk, anchor: Anchor) -> np.ndarray:
    """Raw actions (H, A) that `decode` turns into the chunk, with the same anchor.

    What a layout asks for and the chunk lacks is filled in: waist and base height from the anchor, zero velocity, arm
    joints by inverse kinematics. A layout with one number a hand keeps only the closing of the fingers.

    Raises:
        ChunkError: If the chunk is malformed, or the arms of a joint layout cannot reach a pose.
    """
    chunk.validate()
    return encode_valid(spec, chunk, anchor)


def encode_valid(spec: ActionSpec, chunk: ActionChunk, anchor: Anchor) -> np.ndarray:
    """`encode` for a chunk that was validated or made from something that was."""
    actions = np.empty((len(chunk), spec.dim))
    for side, hand in _SIDES:
        for slot, numbers in encode_wrist(spec, side, getattr(chunk, f"T_world_{hand}"), anchor):
            actions[:, slot.indices] = numbers
    for slot in spec.slots:
        if not slot.name.endswith(("_wrist_position", "_wrist_rotation")):
            numbers = slot.from_si(_values_for(slot, spec, chunk, anchor))
            actions[:, slot.indices] = _to_mode(slot, numbers, anchor)
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
        if excess.any():
            count, worst = int((excess > 0.0).sum()), float(excess.max())
            notes.append(f"{slot.name}: {count} numbers clipped to their limits, by up to {worst:.3g} {slot.unit}")
    return actions, tuple(notes)


def _resolved(slot: Slot, actions: np.ndarray, anchor: Anchor) -> np.ndarray:
    """SI values (H, size) of a joint, scalar or velocity slot, in its own order, whatever its mode."""
    numbers = actions[:, slot.indices]
    if slot.mode == "relative_add":
        numbers = numbers + _reference_numbers(slot, anchor)
    elif slot.mode == "delta":
        numbers = np.cumsum(numbers, axis=0) + _reference_numbers(slot, anchor)
    return slot.to_si(numbers)


def _to_mode(slot: Slot, numbers: np.ndarray, anchor: Anchor) -> np.ndarray:
    """Inverse of the modes in `_resolved`, in the slot's numbers."""
    if slot.mode == "relative_add":
        return numbers - _reference_numbers(slot, anchor)
    if slot.mode == "delta":
        return np.diff(numbers, axis=0, prepend=_reference_numbers(slot, anchor)[None])
    return numbers


def _reference_numbers(slot: Slot, anchor: Anchor) -> np.ndarray:
    """The anchor's own state in the numbers of a slot, shape (size,)."""
    side = slot.name.split("_", maxsplit=1)[0]
    if slot.name.endswith("_grasp"):
        q = anchor.q_lhand if side == "left" else anchor.q_rhand
        return slot.from_si(np.atleast_1d(closing_of(side, q)))
    if slot.name == "base_height":
        return slot.from_si(anchor.T_world_base[2:3, 3])
    values = {"left_hand": anchor.q_lhand, "right_hand": anchor.q_rhand, "waist": anchor.q_body[WAIST]}
    values |= {f"{name}_arm": anchor.q_body[where] for name, where in _ARMS.items()}
    return slot.from_si(_ordered_as(slot, values[slot.name]))


def _joint_values(slot: Slot | None, actions: np.ndarray, anchor: Anchor) -> np.ndarray | None:
    """Joints of a slot in motor order (H, n) [rad], None without a slot."""
    if slot is None:
        return None
    return _resolved(slot, actions, anchor)[:, permutation(slot.joint_names, TARGETS[slot.name][1])]


def _ordered_as(slot: Slot, q: np.ndarray) -> np.ndarray:
    """Joints in motor order (..., n) in the order of a slot."""
    return q[..., permutation(TARGETS[slot.name][1], slot.joint_names)]


def _decode_fingers(
    spec: ActionSpec, side: str, actions: np.ndarray, anchor: Anchor
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Finger joints (H, 7) in motor order [rad] as they were given, and a note on those out of range."""
    grasp, hand = spec.slot(f"{side}_grasp"), spec.slot(f"{side}_hand")
    if grasp:
        closing = _resolved(grasp, actions, anchor)[:, 0]
        return grasp_posture(side, closing), _beyond(grasp, closing, (0.0, 1.0), "of 0 open to 1 closed")
    fingers = _joint_values(hand, actions, anchor)
    if fingers is None:
        return np.tile(anchor.q_lhand if side == "left" else anchor.q_rhand, (len(actions), 1)), ()
    return fingers, _beyond(hand, fingers, finger_range(side), "rad")


def _beyond(
    slot: Slot, values: np.ndarray, bounds: tuple[np.ndarray | float, np.ndarray | float], unit: str
) -> tuple[str, ...]:
    """What to say of values past what fingers can do, if any are; the end of the range is commanded for them."""
    excess = np.abs(values - np.clip(values, *bounds))
    count = int((excess > FINGER_TOLERANCE).sum())
    if not count:
        return ()
    return (f"{slot.name}: {count} numbers out of the fingers' range, by up to {excess.max():.3g} {unit}",)


def _reached(anchor: Anchor, side: str, hand: str, arm: np.ndarray, waist: np.ndarray | None) -> np.ndarray:
    """``T_base_hand`` (H, 4, 4) of arm joints, with the given waist or the anchor's."""
    q_body = np.tile(anchor.q_body, (len(arm), 1))
    q_body[:, _ARMS[side]] = arm
    if waist is not None:
        q_body[:, WAIST] = waist
    return kinematics().poses(q_body)[hand]


def _values_for(slot: Slot, spec: ActionSpec, chunk: ActionChunk, anchor: Anchor) -> np.ndarray:
    """SI values (H, size) that a chunk has for a joint, scalar or velocity slot, in the slot's order."""
    steps, side = len(chunk), slot.name.split("_", maxsplit=1)[0]
    if slot.name == "base_velocity":
        return np.zeros((steps, 3)) if chunk.base_velocity is None else chunk.base_velocity
    if slot.name == "base_height":
        filled = np.full(steps, anchor.T_world_base[2, 3])
        return (filled if chunk.base_height is None else chunk.base_height)[:, None]
    if slot.name.endswith("_grasp"):
        return closing_of(side, chunk.q_lhand if side == "left" else chunk.q_rhand)[:, None]
    if slot.name == "waist":
        return _ordered_as(slot, _waist_of(chunk, anchor))
    if slot.name.endswith("_arm"):
        return _ordered_as(slot, _arm_of(side, spec, chunk, anchor))
    return _ordered_as(slot, chunk.q_lhand if side == "left" else chunk.q_rhand)


def _waist_of(chunk: ActionChunk, anchor: Anchor) -> np.ndarray:
    return np.tile(anchor.q_body[WAIST], (len(chunk), 1)) if chunk.q_waist is None else chunk.q_waist


def _arm_of(side: str, spec: ActionSpec, chunk: ActionChunk, anchor: Anchor) -> np.ndarray:
    """Arm joints (H, 7) that reach the chunk's poses: its own where they do, else by inverse kinematics."""
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
    return arm_joints(hand, T_base_hand, anchor.q_body, q_waist=waist)
