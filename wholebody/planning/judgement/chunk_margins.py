"""The room that a chunk's own numbers leave to the bounds on hands and fingers: no robot is needed for it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import astuple

import numpy as np

from models.spec import RobotSpec
from policy.chunk import ActionChunk
from policy.geometry.rotations import rotvec_to_matrix
from policy.geometry.se3 import make_transform
from wholebody.config.verdict import VerdictConfig
from wholebody.planning.floor_projection import above_floor
from wholebody.planning.judgement.limits import Limit, Margin
from wholebody.planning.limit_projection import DEMAND
from wholebody.reference import HandLimits, HandMotion
from wholebody.reference.rotation import continuous_quaternions

HANDS, PALMS = ("left hand", "right hand"), ("left palm", "right palm")
AT_START = " at its start"
"""Added to a hand whose motion before the chunk is what its first steps do not go on from."""
FINGER_SCALE, FLOOR_SCALE = 1e-3, 1e-3
"""Excess over the range of a finger [rad] and lift out of the floor [m] that counts as one; chosen: the rounding of
files."""

BEFORE = 2
"""Steps before the first one that hands are thought to have come along; derived: a jerk there takes two."""


def chunk_margins(chunk: ActionChunk, limits: tuple[HandLimits, ...], spec: RobotSpec) -> Iterator[Margin]:
    """Least room of a chunk as given to each kind of bound on its numbers.

    Args:
        chunk: As given, valid.
        limits: Of the left and the right hand.
        spec: The robot.
    """
    yield from _rates(_hands(chunk), chunk.fps, limits, 0)
    yield from _rates(_hands(chunk), chunk.fps, limits, 1)
    yield from _fingers(chunk, limits, spec)
    lifted, _ = above_floor(chunk)
    lift = np.stack([now[:, 2, 3] - then[:, 2, 3] for now, then in zip(_hands(lifted), _hands(chunk), strict=True)])
    side, k = np.unravel_index(lift.argmax(), lift.shape)
    most = float(lift[side, k])
    # Where nothing was lifted there is room that nobody measures.
    if most > 0.0:
        yield _at(Limit.INTO_FLOOR, HANDS[side], int(k), chunk.fps, most, 0.0, -most, FLOOR_SCALE)


def rates_from(chunk: ActionChunk, motion: HandMotion, limits: tuple[HandLimits, ...]) -> Iterator[Margin]:
    """Least room to the bounds on accelerations and jerks, those included that take hands to the chunk's first steps.

    Args:
        chunk: As given, valid.
        motion: Of the hands before, which are at its first step, rows (2, 40).
        limits: Of the left and the right hand.
    """
    back, hands = -np.arange(BEFORE, 0, -1)[:, None] / chunk.fps, []
    for T, v, w in zip(_hands(chunk), motion.v, motion.w, strict=True):
        before = make_transform(rotvec_to_matrix(back * w) @ T[0, :3, :3], T[0, :3, 3] + back * v)
        hands.append(np.concatenate([before, T]))
    yield from _rates(hands, chunk.fps, limits, 0, BEFORE)
    yield from _rates(hands, chunk.fps, limits, 1, BEFORE)


def _rates(
    hands: Sequence[np.ndarray], fps: float, limits: tuple[HandLimits, ...], part: int, before: int = 0
) -> Iterator[Margin]:
    """Speed, acceleration and jerk of hands (H, 4, 4), of their positions (part 0) or orientations (1), per axis.

    Each is told at the step in the middle of those that make it: a jump, at the last step before it. So many steps
    ``before`` the first one are none of the chunk.
    """
    codes = (
        (Limit.HAND_SPEED, Limit.HAND_ACCELERATION, Limit.HAND_JERK),
        (Limit.TURN_SPEED, Limit.TURN_ACCELERATION, Limit.TURN_JERK),
    )[part]
    # A quaternion changes half as fast as the hand turns.
    paths = [2.0 * continuous_quaternions(T[:, :3, :3]) if part else T[:, :3, 3] for T in hands]
    for order, code in enumerate(codes, 1):
        if len(paths[0]) <= order:
            return
        worst: Margin | None = None
        for name, values, limit in zip(HANDS, paths, limits, strict=True):
            rates = np.abs(np.diff(values, order, axis=0)) * fps**order
            bound = DEMAND[order - 1] * astuple((limit.position, limit.orientation)[part])[order - 1]
            k, _ = np.unravel_index(rates.argmax(), rates.shape)
            value = float(rates.max())
            subject, step = name + (AT_START if k < before else ""), max(int(k) + order // 2 - before, 0)
            one = _at(code, subject, step, fps, value, bound, bound - value, bound)
            worst = one if worst is None or one.margin < worst.margin else worst
        yield worst


def palm_margins(moved: np.ndarray, turned: np.ndarray, bounds: VerdictConfig, fps: float) -> Iterator[Margin]:
    """Room for how far palms are commanded from a chunk at its steps [m], and how far turned [rad], shapes (H, 2)."""
    for code, off, bound in (
        (Limit.REACH, moved, bounds.palm_feasible),
        (Limit.ORIENTATION, turned, bounds.turn_feasible),
    ):
        step, side = np.unravel_index(off.argmax(), off.shape)
        value, time = float(off.max()), float(step / fps)
        yield Margin(
            code=code, subject=PALMS[int(side)], time=time, step=int(step), value=value, bound=bound, unit=code.unit,
            margin=bound - value, share=(bound - value) / bound,
        )  # fmt: skip


def _fingers(chunk: ActionChunk, limits: tuple[HandLimits, ...], spec: RobotSpec) -> Iterator[Margin]:
    worst: Margin | None = None
    for tool, q, limit in zip(spec.tools, (chunk.q_lhand, chunk.q_rhand), limits, strict=True):
        if not tool.finger_joints:
            continue
        low, high = (np.array(bound[: q.shape[1]]) for bound in (limit.finger_lower, limit.finger_upper))
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
