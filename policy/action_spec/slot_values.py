"""Values of joint, finger and scalar slots in SI: from the numbers of an action, and from an anchor."""

from __future__ import annotations

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.hands import closing_of, finger_closings, finger_range, fingers_closed, grasp_posture
from policy.action_spec.slot import Slot
from policy.action_spec.spec import ActionSpec
from policy.action_spec.wrist_codec import frame_pose
from policy.chunk import ActionChunk
from policy.joints import joints_of

CLIPPED, NOT_FOLLOWED, OUT_OF_RANGE = "clipped to their limits", "is not followed", "out of the fingers' range"
"""What notes say of numbers that are carried out otherwise than given; a verdict goes by these words."""
FINGER_TOLERANCE = 1e-3
"""How far a finger may be asked past its range without a word: the rounding of files and networks [rad, 1]."""

NOT_SAID = {"force_max": 1e3, "stiffness": 600.0}
"""What a hand has of which nothing is said while something is of the other one [N, N/m]: no limit of its own, and the
stiffness that controllers are shipped with."""
_HANDS = ("left", "lpalm", 0), ("right", "rpalm", 1)


def resolved(slot: Slot, actions: np.ndarray, anchor: Anchor) -> np.ndarray:
    """SI values (H, size) of a joint, scalar or velocity slot, in its own order, whatever its mode."""
    numbers = actions[:, slot.indices]
    if slot.mode == "relative_add":
        numbers = numbers + _reference_numbers(slot, anchor)
    elif slot.mode == "delta":
        numbers = np.cumsum(numbers, axis=0) + _reference_numbers(slot, anchor)
    return slot.to_si(numbers)


def to_mode(slot: Slot, numbers: np.ndarray, anchor: Anchor) -> np.ndarray:
    """Inverse of the modes in `resolved`, in the slot's numbers."""
    if slot.mode == "relative_add":
        return numbers - _reference_numbers(slot, anchor)
    if slot.mode == "delta":
        return np.diff(numbers, axis=0, prepend=_reference_numbers(slot, anchor)[None])
    return numbers


def _reference_numbers(slot: Slot, anchor: Anchor) -> np.ndarray:
    """The anchor's own state in the numbers of a slot, shape (size,)."""
    side = slot.name.split("_", maxsplit=1)[0]
    q_hand = anchor.q_lhand if side == "left" else anchor.q_rhand
    if slot.name.endswith("_grasp"):
        return slot.from_si(np.atleast_1d(closing_of(side, q_hand, anchor.robot)))
    if slot.kind == "fingers":
        return slot.from_si(finger_closings(side, slot.joint_names, q_hand, anchor.robot))
    if slot.name == "base_height":
        return slot.from_si(anchor.T_world_base[2:3, 3] - floor_of(slot, anchor))
    values = {"left_hand": anchor.q_lhand, "right_hand": anchor.q_rhand}
    values |= {limb: anchor.q_body[where] for limb, where in anchor.robot.limbs.items()}
    return slot.from_si(ordered_as(slot, values[slot.name], anchor))


def floor_of(slot: Slot, anchor: Anchor) -> float:
    """Height in world from which a base height counts: the soles where it is in the stance [m]."""
    return float(anchor.T_world_stance[2, 3]) if slot.frame == "stance" else 0.0


def joint_values(slot: Slot | None, actions: np.ndarray, anchor: Anchor) -> np.ndarray | None:
    """Joints of a slot in motor order (H, n) [rad], None without a slot; joints that a short group lacks are 0."""
    if slot is None:
        return None
    names, given = joints_of(anchor.robot, slot.name), resolved(slot, actions, anchor)
    values = np.zeros((len(given), len(names)))
    values[:, [names.index(name) for name in slot.joint_names]] = given
    return values


def ordered_as(slot: Slot, q: np.ndarray, anchor: Anchor) -> np.ndarray:
    """Joints in motor order (..., n) in the order of a slot."""
    names = joints_of(anchor.robot, slot.name)
    return q[..., [names.index(name) for name in slot.joint_names]]


def decode_fingers(
    spec: ActionSpec, side: str, actions: np.ndarray, anchor: Anchor
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Finger joints (H, m) in motor order [rad] as they were given, and a note on those out of range."""
    grasp, hand = spec.slot(f"{side}_grasp"), spec.slot(f"{side}_hand")
    if grasp:
        closing = resolved(grasp, actions, anchor)[:, 0]
        posture = grasp_posture(side, closing, anchor.robot)
        return posture, _beyond(grasp, closing, (0.0, 1.0), "of 0 open to 1 closed")
    if hand is not None and hand.kind == "fingers":
        closings = resolved(hand, actions, anchor)
        fingers = fingers_closed(side, hand.joint_names, closings, anchor.robot)
        return fingers, _beyond(hand, closings, (0.0, 1.0), "of 0 open to 1 closed")
    fingers = joint_values(hand, actions, anchor)
    if fingers is None:
        return np.tile(anchor.q_lhand if side == "left" else anchor.q_rhand, (len(actions), 1)), ()
    return fingers, _beyond(hand, fingers, finger_range(side, anchor.robot), "rad")


def _beyond(
    slot: Slot, values: np.ndarray, bounds: tuple[np.ndarray | float, np.ndarray | float], unit: str
) -> tuple[str, ...]:
    """What to say of values past what fingers can do, if any are; the end of the range is commanded for them."""
    excess = np.abs(values - np.clip(values, *bounds))
    count = int((excess > FINGER_TOLERANCE).sum())
    if not count:
        return ()
    return (f"{slot.name}: {count} numbers {OUT_OF_RANGE}, by up to {excess.max():.3g} {unit}",)


def decode_touch(spec: ActionSpec, actions: np.ndarray, anchor: Anchor) -> dict[str, np.ndarray]:
    """Arrays of a chunk that say how hands touch, those that the layout has: forces in world, limits, stiffnesses."""
    found = {}
    for side, palm, _ in _HANDS:
        if force := spec.slot(f"{side}_force"):
            found[f"f_world_{palm}"] = resolved(force, actions, anchor) @ frame_pose(force, anchor)[:3, :3].T
    for name, otherwise in NOT_SAID.items():
        slots = [spec.slot(f"{side}_{name}") for side, _, _ in _HANDS]
        if any(slots):
            none = np.full((len(actions), 1), otherwise)
            columns = np.broadcast_arrays(*(none if s is None else resolved(s, actions, anchor) for s in slots))
            values = np.stack(columns, axis=1)
            found[name] = values[..., 0] if values.shape[-1] == 1 else values
    return found


def encode_touch(slot: Slot, chunk: ActionChunk, anchor: Anchor) -> np.ndarray:
    """SI values (H, size) of a slot of a hand that touches; what the chunk does not say is no force, and `NOT_SAID`.

    One number has the least of what a chunk says of axes.
    """
    side, _, name = slot.name.partition("_")
    palm, hand = next((palm, hand) for known, palm, hand in _HANDS if known == side)
    if slot.kind == "force":
        force = getattr(chunk, f"f_world_{palm}")
        return np.zeros((len(chunk), 3)) if force is None else force @ frame_pose(slot, anchor)[:3, :3]
    values = getattr(chunk, name)
    if values is None:
        return np.full((len(chunk), slot.size), NOT_SAID[name])
    of_hand = values[:, hand].reshape(len(chunk), -1)
    return of_hand.min(axis=1, keepdims=True) if slot.size == 1 else np.broadcast_to(of_hand, (len(chunk), 3))
