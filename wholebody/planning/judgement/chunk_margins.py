"""The room that a chunk's own numbers leave to the bounds on hands and fingers: no robot is needed for it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import astuple

import numpy as np

from models.spec import RobotSpec
from policy.chunk import ActionChunk
from wholebody.planning.floor_projection import above_floor
from wholebody.planning.judgement.limits import Limit, Margin
from wholebody.planning.limit_projection import DEMAND
from wholebody.reference import HandLimits
from wholebody.reference.rotation import continuous_quaternions

HANDS = ("left hand", "right hand")
FINGER_SCALE, FLOOR_SCALE = 1e-3, 1e-3
"""Excess over the range of a finger [rad] and lift out of the floor [m] that counts as one; chosen: the rounding of
files."""


def chunk_margins(chunk: ActionChunk, limits: tuple[HandLimits, ...], spec: RobotSpec) -> Iterator[Margin]:
    """Of a chunk as given: least room to each kind of bound on its numbers.

    Args:
        chunk: As given, valid.
        limits: Of the left and the right hand.
        spec: The robot.
    """
    yield from _rates(chunk, limits, 0)
    yield from _rates(chunk, limits, 1)
    yield from _fingers(chunk, limits, spec)
    lifted, _ = above_floor(chunk)
    lift = np.stack([now[:, 2, 3] - then[:, 2, 3] for now, then in zip(_hands(lifted), _hands(chunk), strict=True)])
    side, k = np.unravel_index(lift.argmax(), lift.shape)
    most = float(lift[side, k])
    # Where nothing was lifted there is room that nobody measures.
    if most > 0.0:
        yield _at(Limit.INTO_FLOOR, HANDS[side], int(k), chunk.fps, most, 0.0, -most, FLOOR_SCALE)


def _rates(chunk: ActionChunk, limits: tuple[HandLimits, ...], part: int) -> Iterator[Margin]:
    """Speed, acceleration and jerk of the hands' positions (part 0) or orientations (1), per axis."""
    codes = (
        (Limit.HAND_SPEED, Limit.HAND_ACCELERATION, Limit.HAND_JERK),
        (Limit.TURN_SPEED, Limit.TURN_ACCELERATION, Limit.TURN_JERK),
    )[part]
    # A quaternion changes half as fast as the hand turns.
    hands = [2.0 * continuous_quaternions(T[:, :3, :3]) if part else T[:, :3, 3] for T in _hands(chunk)]
    for order, code in enumerate(codes, 1):
        if len(chunk) <= order:
            return
        worst: Margin | None = None
        for name, values, limit in zip(HANDS, hands, limits, strict=True):
            rates = np.abs(np.diff(values, order, axis=0)) * chunk.fps**order
            bound = DEMAND[order - 1] * astuple((limit.position, limit.orientation)[part])[order - 1]
            k, _ = np.unravel_index(rates.argmax(), rates.shape)
            value = float(rates.max())
            one = _at(code, name, int(k), chunk.fps, value, bound, bound - value, bound)
            worst = one if worst is None or one.margin < worst.margin else worst
        yield worst


def _fingers(chunk: ActionChunk, limits: tuple[HandLimits, ...], spec: RobotSpec) -> Iterator[Margin]:
    worst: Margin | None = None
    for tool, q, limit in zip(spec.tools, (chunk.q_lhand, chunk.q_rhand), limits, strict=True):
        if not tool.finger_joints:
            continue
        low, high = np.array(limit.finger_lower), np.array(limit.finger_upper)
        excess = np.maximum(low - q, q - high)
        k, i = np.unravel_index(excess.argmax(), excess.shape)
        value, bound = float(q[k, i]), float(high[i] if q[k, i] > 0.5 * (low[i] + high[i]) else low[i])
        room = -float(excess[k, i])
        one = _at(Limit.FINGER_RANGE, tool.finger_joints[i], int(k), chunk.fps, value, bound, room, FINGER_SCALE)
        worst = one if worst is None or one.margin < worst.margin else worst
    if worst is not None:
        yield worst


def _hands(chunk: ActionChunk) -> tuple[np.ndarray, np.ndarray]:
    return chunk.T_world_lhand, chunk.T_world_rhand


def _at(
    code: Limit, subject: str, step: int, fps: float, value: float, bound: float, room: float, scale: float
) -> Margin:
    """A margin; any excess is a no, which a share of -1 says."""
    share = room / scale if room >= 0.0 else min(room / scale, -1.0)
    return Margin(
        code=code, subject=subject, time=step / fps, step=step, value=value, bound=bound, unit=code.unit, margin=room,
        share=share,
    )  # fmt: skip
