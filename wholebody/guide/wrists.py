"""Palms of raw actions and back, for arrays of numpy and tensors of torch alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.spec import ActionSpec
from policy.action_spec.wrist_codec import frame_pose
from policy.geometry.se3 import inverse, translated
from wholebody.errors import InputError

SIDES = (("left", "lhand"), ("right", "rhand"))
POSITION_MODES, ROTATION_MODES = ("absolute", "relative_se3", "relative_add"), ("absolute", "relative_se3")
"""Modes of wrists whose numbers of a step depend on no other step; definition."""


@dataclass(frozen=True)
class Wrist:
    """How the numbers of one hand are its palm: ``R = turn rot6d(r)``, ``p = scale v + origin + R ahead``.

    Attributes:
        position, rotation: Columns of an action, shapes (3,) and (6,).
        by_rows: Whether the six numbers are the first two rows of the matrix, not its first two columns, one after the
            other.
        scale, turn: Shape (3, 3).
        origin: Shape (3,), [m].
        ahead: Palm point in the axes of the hand, from the point that the numbers are of, shape (3,), [m].
    """

    position: np.ndarray
    rotation: np.ndarray
    by_rows: bool
    scale: np.ndarray
    turn: np.ndarray
    origin: np.ndarray
    ahead: np.ndarray

    def palm(self, actions: Any) -> tuple[Any, Any]:
        """Palm points (..., 3) [m] and rotations (..., 3, 3) in world of raw actions (..., A); any real numbers do."""
        R = _like(self.turn, actions) @ _rotations(actions[..., self.rotation], self.by_rows)
        p = actions[..., self.position] @ _like(self.scale.T, actions) + _like(self.origin, actions)
        return p + R @ _like(self.ahead, actions), R

    def moved(self, actions: np.ndarray, p: np.ndarray, R: np.ndarray) -> np.ndarray:
        """Raw actions with the palm there; numbers stay as they are where it is there already."""
        out, (p_now, R_now) = actions.copy(), self.palm(actions)
        shift = (p - R @ self.ahead) - (p_now - R_now @ self.ahead)
        out[..., self.position] += shift @ np.linalg.inv(self.scale).T
        out[..., self.rotation] += _numbers(self.turn.T @ R, self.by_rows) - _numbers(self.turn.T @ R_now, self.by_rows)
        return out


def wrists(spec: ActionSpec, anchor: Anchor, offsets: np.ndarray) -> tuple[Wrist, Wrist]:
    """How the numbers of a layout are palms, fixed to an anchor.

    Args:
        spec: The layout.
        anchor: Where the robot stands.
        offsets: Palm points in the axes of the wrists, shape (2, 3), [m].

    Raises:
        InputError: If the layout is not of wrists with six numbers of a rotation, absolute or relative to the state.
    """
    found = []
    for (side, hand), offset in zip(SIDES, offsets, strict=True):
        position, rotation = spec.slot(f"{side}_wrist_position"), spec.slot(f"{side}_wrist_rotation")
        known = position is not None and position.mode in POSITION_MODES and rotation is not None
        if not known or rotation.kind != "rot6d" or rotation.mode not in ROTATION_MODES:
            raise InputError(
                f"'{spec.name}' has no gradient for the {side} wrist: a position and six numbers of a rotation (rot6d) "
                f"are expected, in modes {', '.join(POSITION_MODES)}, as in wbc32"
            )
        T_world_frame = frame_pose(position, anchor)
        T_ref = inverse(T_world_frame) @ anchor.T_world_base @ anchor.poses[hand]
        T_ref = translated(T_ref, np.asarray(position.tcp_offset, dtype=float))
        scale, origin = T_world_frame[:3, :3], T_world_frame[:3, 3]
        if position.mode != "absolute":
            origin = origin + scale @ T_ref[:3, 3]
        if position.mode == "relative_se3":
            scale = scale @ T_ref[:3, :3]
        turn = T_world_frame[:3, :3] @ (T_ref[:3, :3] if rotation.mode == "relative_se3" else np.eye(3))
        unit = float(position.to_si(np.ones(1))[0])
        six = np.arange(rotation.start, rotation.start + 6)
        if rotation.rot6d_layout == "interleaved":
            six = six[[0, 2, 4, 1, 3, 5]]
        found.append(
            Wrist(
                np.arange(position.start, position.start + 3),
                six,
                rotation.rot6d_layout == "rows",
                unit * scale,
                turn,
                origin,
                offset - np.asarray(position.tcp_offset, dtype=float),
            )
        )
    return found[0], found[1]


def _rotations(numbers: Any, by_rows: bool) -> Any:
    """Rotations (..., 3, 3) of six numbers (..., 6), made orthonormal one after the other (Zhou et al. 2019)."""
    a, b = numbers[..., :3], numbers[..., 3:]
    x = a / _length(a)
    y = b - (x * b).sum(-1)[..., None] * x
    y = y / _length(y)
    z = _cross(x, y)
    stack = np.stack if isinstance(numbers, np.ndarray) else _torch().stack
    return stack([x, y, z], -2 if by_rows else -1)


def _numbers(R: np.ndarray, by_rows: bool) -> np.ndarray:
    """The first two rows or columns of rotations (..., 3, 3), (..., 6)."""
    two = R[..., :2, :] if by_rows else np.swapaxes(R[..., :, :2], -1, -2)
    return two.reshape(*R.shape[:-2], 6)


def _length(v: Any) -> Any:
    return ((v * v).sum(-1)[..., None] + 1e-24) ** 0.5


def _cross(x: Any, y: Any) -> Any:
    return np.cross(x, y) if isinstance(x, np.ndarray) else _torch().linalg.cross(x, y)


def _like(values: np.ndarray, other: Any) -> Any:
    """Values as an array or tensor of the same kind as another one."""
    if isinstance(other, np.ndarray):
        return values
    return _torch().as_tensor(np.ascontiguousarray(values), dtype=other.dtype, device=other.device)


def _torch() -> Any:
    import torch

    return torch
