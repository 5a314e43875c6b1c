"""Wrist poses in the numbers of an action spec, and back; `policy.action_spec.codec` has the table of modes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.slot import Slot
from policy.action_spec.spec import ActionSpec
from policy.errors import ChunkError, RotationError
from policy.geometry.rotations import (
    matrix_to_quaternion,
    matrix_to_rot6d,
    matrix_to_rotvec,
    matrix_to_rpy,
    quaternion_to_matrix,
    rot6d_to_matrix,
    rotvec_to_matrix,
    rpy_to_matrix,
)
from policy.geometry.se3 import inverse, make_transform, translated, yaw_frame

NETWORK_QUATERNION_TOLERANCE = 0.05
"""Tolerance of a quaternion's norm around 1 in an action: networks do not hit 1; half of it would be another
quantity."""


def decode_wrist(spec: ActionSpec, side: str, actions: np.ndarray, anchor: Anchor) -> np.ndarray:
    """``T_world_hand`` (H, 4, 4) from raw actions (H, A).

    Args:
        spec: Must have a wrist position for the side; without a rotation, the anchor's is kept.
        side: ``left`` or ``right``.
        actions: Finite.
        anchor: Pelvis and state.

    Raises:
        ChunkError: If numbers are no rotation; names step and slot.
    """
    position, rotation = spec.slot(f"{side}_wrist_position"), spec.slot(f"{side}_wrist_rotation")
    reference = _Reference(position, anchor)
    if rotation is None:
        R = reference.T[:3, :3]
    else:
        try:
            R = _decode_rotation(rotation, actions[:, rotation.indices], reference)
        except RotationError as error:
            raise ChunkError(
                f"{rotation.name} at step {error.index}: {error}", step=error.index, slot=rotation.name
            ) from error
    p = _decode_position(position, position.to_si(actions[:, position.indices]), reference, R)
    return reference.T_world_frame @ _moved(make_transform(R, p), [-x for x in position.tcp_offset])


def encode_wrist(
    spec: ActionSpec, side: str, T_world_hand: np.ndarray, anchor: Anchor
) -> Iterator[tuple[Slot, np.ndarray]]:
    """Numbers (H, size) of the slots of a wrist, if there are any, for poses (H, 4, 4)."""
    position, rotation = spec.slot(f"{side}_wrist_position"), spec.slot(f"{side}_wrist_rotation")
    if position is None:
        return
    reference = _Reference(position, anchor)
    T = _moved(reference.T_frame_world @ T_world_hand, position.tcp_offset)
    yield position, position.from_si(_encode_position(position, T, reference))
    if rotation is not None:
        yield rotation, _encode_rotation(rotation, T[:, :3, :3], reference)


class _Reference:
    """The slot's frame at the anchor, and the tool in it, which costs kinematics and is made when needed."""

    def __init__(self, position: Slot, anchor: Anchor) -> None:
        self.position, self.anchor = position, anchor
        self.T_world_frame = frame_pose(position, anchor)
        self._T: np.ndarray | None = None

    @property
    def T_frame_world(self) -> np.ndarray:
        """Inverse of the frame; both wrists share that of the pelvis."""
        in_pelvis = self.T_world_frame is self.anchor.T_world_base
        return self.anchor.T_base_world if in_pelvis else inverse(self.T_world_frame)

    @property
    def T(self) -> np.ndarray:
        """``T_frame_tool`` at the anchor's joints, (4, 4)."""
        if self._T is None:
            hand = "lhand" if self.position.name.startswith("left") else "rhand"
            T_world_hand = self.anchor.T_world_base @ self.anchor.poses[hand]
            self._T = _moved(self.T_frame_world @ T_world_hand, self.position.tcp_offset)
        return self._T


def _moved(T: np.ndarray, offset: Sequence[float]) -> np.ndarray:
    return translated(T, offset) if any(offset) else T


def frame_pose(slot: Slot, anchor: Anchor) -> np.ndarray:
    """``T_world_frame`` (4, 4) of the frame that a slot is in."""
    if slot.frame == "world":
        return np.eye(4)
    if slot.frame == "pelvis_yaw":
        return yaw_frame(anchor.T_world_base)
    if slot.frame == "torso":
        return anchor.T_world_base @ anchor.poses["torso"]
    if slot.frame == "stance":
        return anchor.T_world_stance
    return anchor.T_world_base


def _decode_position(slot: Slot, v: np.ndarray, reference: _Reference, R: np.ndarray) -> np.ndarray:
    if slot.mode == "absolute":
        return v
    p_ref, R_ref = reference.T[:3, 3], reference.T[:3, :3]
    if slot.mode == "relative_se3":
        return p_ref + v @ R_ref.T
    if slot.mode == "delta_se3":
        R_before = np.concatenate([R_ref[None], np.broadcast_to(R, (len(v), 3, 3))[:-1]])
        return p_ref + np.cumsum((R_before @ v[..., None])[..., 0], axis=0)
    return p_ref + (v if slot.mode == "relative_add" else np.cumsum(v, axis=0))


def _encode_position(slot: Slot, T: np.ndarray, reference: _Reference) -> np.ndarray:
    p = T[:, :3, 3]
    if slot.mode == "absolute":
        return p
    p_ref, R_ref = reference.T[:3, 3], reference.T[:3, :3]
    if slot.mode == "relative_se3":
        return (p - p_ref) @ R_ref
    if slot.mode == "delta_se3":
        R_before = np.concatenate([R_ref[None], T[:-1, :3, :3]])
        return (np.diff(p, axis=0, prepend=p_ref[None])[:, None] @ R_before)[:, 0]
    return p - p_ref if slot.mode == "relative_add" else np.diff(p, axis=0, prepend=p_ref[None])


def _decode_rotation(slot: Slot, numbers: np.ndarray, reference: _Reference) -> np.ndarray:
    if slot.mode == "absolute":
        return _to_matrix(slot, numbers)
    R_ref = reference.T[:3, :3]
    if slot.mode == "relative_add":
        return _to_matrix(slot, _to_numbers(slot, R_ref) + numbers)
    R = _to_matrix(slot, numbers)
    if slot.mode == "relative_se3":
        return R_ref @ R
    turned = np.empty_like(R)
    before = R_ref
    for k, step in enumerate(R):
        before = turned[k] = before @ step if slot.mode == "delta_se3" else step @ before
    # A long product of rotations drifts off SO(3); a unit quaternion brings it back.
    return quaternion_to_matrix(matrix_to_quaternion(turned, "xyzw"), "xyzw")


def _encode_rotation(slot: Slot, R: np.ndarray, reference: _Reference) -> np.ndarray:
    if slot.mode == "absolute":
        return _to_numbers(slot, R)
    R_ref = reference.T[:3, :3]
    if slot.mode == "relative_se3":
        return _to_numbers(slot, R_ref.T @ R)
    if slot.mode == "relative_add":
        return _to_numbers(slot, R) - _to_numbers(slot, R_ref)
    inverse_before = np.swapaxes(np.concatenate([R_ref[None], R[:-1]]), -1, -2)
    return _to_numbers(slot, inverse_before @ R if slot.mode == "delta_se3" else R @ inverse_before)


def _to_matrix(slot: Slot, numbers: np.ndarray) -> np.ndarray:
    if slot.kind == "rot6d":
        return rot6d_to_matrix(numbers, slot.rot6d_layout)
    if slot.kind == "quaternion":
        return quaternion_to_matrix(numbers, slot.quaternion_order, tolerance=NETWORK_QUATERNION_TOLERANCE)
    angles = slot.to_si(numbers)
    return rotvec_to_matrix(angles) if slot.kind == "rotvec" else rpy_to_matrix(angles)


def _to_numbers(slot: Slot, R: np.ndarray) -> np.ndarray:
    if slot.kind == "rot6d":
        return matrix_to_rot6d(R, slot.rot6d_layout)
    if slot.kind == "quaternion":
        return matrix_to_quaternion(R, slot.quaternion_order)
    return slot.from_si(matrix_to_rotvec(R) if slot.kind == "rotvec" else matrix_to_rpy(R))
