"""The numbers of a chunk and of its plan that a probability is made of."""

from __future__ import annotations

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.rotations import angle_between
from wholebody.planning.judgement.chunk_judge import Begin, ChunkJudge, ChunkJudgement
from wholebody.planning.judgement.limits import Limit
from wholebody.verdict.calibration.rollout import STANDING_WELL, rollouts

SHOULDER = np.array([[0.0, 0.12, 1.1], [0.0, -0.12, 1.1]])
"""Shoulders of the standing robot, about, left first [m]; chosen: an origin of distances, no more."""
WINDOW = 0.05
"""Standard deviation of the Gaussian through which paths are looked at [s]; chosen: what is faster moves no trunk."""


def quantities(judge: ChunkJudge, chunk: ActionChunk, begin: Begin, found: ChunkJudgement) -> dict[str, float]:
    """Quantities by name, each a finite number: room to bounds, what the plan changes, how the chunk moves the palms.

    Args:
        judge: What judged it.
        chunk: As given, valid, with H steps.
        begin: Where it is begun.
        found: What the judge says.
    """
    room = {one.code: one.share for one in found.margins}
    report, (p, R) = found.plan.report, judge.asked(chunk)
    at, turned = judge.at(begin)
    plan = {
        "moved": float(found.moved.max()),
        "turned": float(found.turned.max()),
        "slowdown": report.slowdown,
        "unsafe": float(not report.safe),
        "searched": float(not found.previewed),
        "violation": report.violation,
        "start": float(np.linalg.norm(at - p[0], axis=1).max()),
        "start_turn": float(angle_between(turned, R[0]).max()),
        "start_speed": float(np.linalg.norm(begin.hands.v, axis=1).max()),
    }
    rooms = {f"room_{code}": float(room.get(code, 1.0)) for code in Limit if code is not Limit.SCENE_DISTANCE}
    # What a preview clears leaves room to every bound: following it once more would tell little.
    followed = STANDING_WELL
    if not found.previewed:
        with rollouts.lend(judge.config) as rollout:
            followed = rollout.quantities(chunk, begin, judge.loads)
    return rooms | plan | followed | _motion(p, R, chunk.fps) | _smooth(at, p, chunk.fps)


def is_news(chunk: ActionChunk, looked_at: float) -> bool:
    """Whether a chunk says what none before it did: steps that move, later than was looked at.

    Args:
        chunk: A valid chunk.
        looked_at: Time of the last step of the chunks before [s]; minus infinity where there was none.
    """
    if not np.isfinite(looked_at):
        return True
    new = chunk.times > looked_at + 1e-9
    return bool(new.any()) and any(
        np.ptp(T[new], axis=0).max() > 0.0 for T in (chunk.T_world_lhand, chunk.T_world_rhand)
    )


def _motion(p: np.ndarray, R: np.ndarray, fps: float) -> dict[str, float]:
    """Quantities of palm points (H, 2, 3) [m] and rotations (H, 2, 3, 3) at a rate [Hz]."""
    speed, acceleration = np.diff(p, axis=0) * fps, np.diff(p, 2, axis=0) * fps**2
    turn = angle_between(R[1:], R[:-1])
    both, middle = acceleration.sum(axis=1), p.mean(axis=1)
    return {
        "seconds": len(p) / fps,
        "path": float(np.linalg.norm(np.diff(p, axis=0), axis=2).sum(axis=0).max(initial=0.0)),
        "path_turn": float(turn.sum(axis=0).max(initial=0.0)),
        "speed": _largest(speed),
        "first_speed": _largest(speed[:1]),
        "last_speed": _largest(speed[-1:]),
        "acceleration": _largest(acceleration),
        "acceleration_rms": float(np.sqrt((acceleration**2).sum(axis=2).mean())) if len(acceleration) else 0.0,
        "push_rms": float(np.sqrt((both[:, :2] ** 2).sum(axis=1).mean())) if len(both) else 0.0,
        "turn_speed": float(turn.max(initial=0.0)) * fps,
        "front": float(middle[:, 0].max()),
        "back": float(middle[:, 0].min()),
        "aside": float(np.abs(middle[:, 1]).max()),
        "low": float(p[..., 2].min()),
        "high": float(p[..., 2].max()),
        "reach": float(np.linalg.norm(p - SHOULDER, axis=2).max()),
        "apart": float(np.linalg.norm(p[:, 0] - p[:, 1], axis=1).min()),
        "crossed": float((p[:, 1, 1] - p[:, 0, 1]).max()),
    }


def _smooth(at: np.ndarray, p: np.ndarray, fps: float) -> dict[str, float]:
    """Palm points (H, 2, 3) that begin at (2, 3) and end at rest [m], smoothed through a window, at a rate [Hz]."""
    reach = int(np.ceil(3.0 * WINDOW * fps))
    window = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (WINDOW * fps)) ** 2)
    held = np.concatenate([np.repeat(at[None], 2 * reach, 0), p, np.repeat(p[-1:], 2 * reach, 0)])
    flat = held.reshape(len(held), -1)
    columns = [np.convolve(column, window / window.sum(), "valid") for column in flat.T]
    path = np.stack(columns, axis=1).reshape(-1, 2, 3)
    speed, acceleration = np.diff(path, axis=0) * fps, np.diff(path, 2, axis=0) * fps**2
    both, shift = acceleration.sum(axis=1), (path - path[0]).mean(axis=1)
    return {
        "smooth_speed": _largest(speed),
        "smooth_acceleration": _largest(acceleration),
        "smooth_push": float(np.linalg.norm(both[:, :2], axis=1).max()),
        "smooth_push_rms": float(np.sqrt((both[:, :2] ** 2).sum(axis=1).mean())),
        "smooth_lift": float(np.abs(both[:, 2]).max()),
        "away": _largest(path - path[0]),
        "shift_front": float(shift[:, 0].max()),
        "shift_back": float(-shift[:, 0].min()),
        "shift_aside": float(np.abs(shift[:, 1]).max()),
    }


def _largest(vectors: np.ndarray) -> float:
    """The longest of vectors (n, 2, 3)."""
    return float(np.linalg.norm(vectors, axis=2).max(initial=0.0))
