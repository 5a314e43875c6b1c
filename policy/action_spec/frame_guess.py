"""Wrist positions that make sense in another frame only, or in another unit: guesses for their author."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.slot import Slot
from policy.action_spec.spec import ActionSpec
from policy.action_spec.wrist_codec import frame_pose
from policy.geometry.se3 import make_transform

SHOULDERS = {"left": (0.0, 0.136, 0.302), "right": (0.0, -0.136, 0.302)}
"""Centre of what a wrist reaches, in the pelvis of an upright robot [m]."""
ARM_REACH = 0.383
"""Largest distance of a wrist from it [m]. Source of both: the sphere around 20 000 random arm postures."""
LEAN_MIN = 0.1
"""What leaning adds at least [m]."""
FAR_MIN, NEAR_MIN = 0.3, 0.15
"""Distances of a first step from the hand [m] that make another frame likely: further than a chunk may begin in its
own, and no further than a chunk is ahead of the hand in the other."""
UNIT_DISTANCE = 5.0
"""Distance of a wrist from the pelvis from which its numbers are in another unit [m]; chosen: what no task asks of a
robot that stands, and little in millimetres."""


def world_guess(spec: ActionSpec, actions: np.ndarray, anchor: Anchor) -> tuple[str, ...]:
    """A sentence if every wrist begins out of its arm's reach in the layout's frame, and within it in world.

    Args:
        spec: What the numbers are said to mean.
        actions: Finite raw actions, shape (H, A).
        anchor: Pelvis at the first step.

    Returns:
        One sentence, or none.
    """
    slots = [slot for slot in spec.slots if slot.kind == "position" and slot.mode == "absolute"]
    if not slots or not all(_only_in_world(slot, actions[0], anchor) for slot in slots):
        return ()
    slot = slots[0]
    p = ", ".join(f"{x:.2f}" for x in slot.to_si(actions[0, slot.indices]))
    return (
        f"these look like positions in world: {slot.name} begins at ({p}) m, out of reach in the {slot.frame}, which "
        f"'{spec.name}' is in, and within reach in world; multiply the poses by the inverse of the {slot.frame}'s pose "
        'as it was measured at the observation, or name a layout with "frame": "world"',
    )


def pelvis_guess(spec: ActionSpec, actions: np.ndarray, anchor: Anchor) -> tuple[str, ...]:
    """A sentence if wrists that should be in the stance begin where the hands are, if they are read in the pelvis.

    Args:
        spec: What the numbers are said to mean.
        actions: Finite raw actions, shape (H, A).
        anchor: Pelvis, soles and joints at the first step.

    Returns:
        One sentence, or none.
    """
    slots = [slot for slot in spec.slots if slot.kind == "position" and slot.mode == "absolute"]
    if not slots or any(slot.frame != "stance" for slot in slots):
        return ()
    away = np.array([_from_hand(slot, actions[0], anchor) for slot in slots])
    if not ((away[:, 0] > FAR_MIN) & (away[:, 1] < NEAR_MIN)).all():
        return ()
    p = ", ".join(f"{x:.2f}" for x in slots[0].to_si(actions[0, slots[0].indices]))
    return (
        f"these look like positions in the pelvis, as version 1 of wbc32 has them: --assume-spec wbc32-v1 reads them "
        f"so; {slots[0].name} begins at ({p}) m, {away[0, 1]:.2f} m from the wrist if that is in the pelvis, and "
        f"{away[0, 0]:.2f} m if it is in the stance",
    )


def unit_guess(wrists: Mapping[str, np.ndarray], anchor: Anchor) -> tuple[str, ...]:
    """A sentence if a wrist is asked to be across a room from the pelvis.

    Args:
        wrists: Poses in world, shape (H, 4, 4), under the keys lhand and rhand.
        anchor: Pelvis at the first step.

    Returns:
        One sentence, or none.
    """
    away = {hand: np.linalg.norm(T[:, :3, 3] - anchor.T_world_base[:3, 3], axis=1).max() for hand, T in wrists.items()}
    hand = max(away, key=away.get)
    if not away[hand] > UNIT_DISTANCE:
        return ()
    side = {"lhand": "left", "rhand": "right"}[hand]
    return (
        f"the {side} wrist is asked to be {away[hand]:.3g} m from the pelvis: positions are in metres; "
        "`wholebody layouts --from` looks whether another unit fits",
    )


def _from_hand(slot: Slot, numbers: np.ndarray, anchor: Anchor) -> tuple[float, float]:
    """Distances of a position, read in the stance and in the pelvis, from where the wrist is [m]."""
    p = np.append(slot.to_si(numbers[slot.indices]) - np.array(slot.tcp_offset), 1.0)
    T_world_hand = anchor.T_world_base @ anchor.poses["lhand" if slot.name.startswith("left") else "rhand"]
    read = (T @ p for T in (anchor.T_world_stance, anchor.T_world_base))
    return tuple(float(np.linalg.norm((there - T_world_hand[:, 3])[:3])) for there in read)


def _only_in_world(slot: Slot, numbers: np.ndarray, anchor: Anchor) -> bool:
    p, tool = slot.to_si(numbers[slot.indices]), float(np.linalg.norm(slot.tcp_offset))
    T_world_shoulder = anchor.T_world_base @ make_transform(np.eye(3), np.array(SHOULDERS[slot.name.split("_")[0]]))
    T_world_frame = frame_pose(slot, anchor)
    in_frame = np.linalg.norm(T_world_frame[:3, :3] @ p + T_world_frame[:3, 3] - T_world_shoulder[:3, 3])
    in_world = np.linalg.norm(p - T_world_shoulder[:3, 3])
    return bool(in_world <= ARM_REACH + tool < in_frame - LEAN_MIN)
