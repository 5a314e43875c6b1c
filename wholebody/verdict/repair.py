"""The repair of a chunk: slowed down, or its path bent, by no more than makes it hold when it is planned again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from policy.action_spec.slot_values import CLIPPED, OUT_OF_RANGE
from policy.chunk import ActionChunk
from policy.geometry.rotations import angle_between, matrix_to_rotvec, rotvec_to_matrix
from policy.geometry.se3 import translated
from wholebody.planning.floor_projection import above_floor
from wholebody.planning.judgement.chunk_judge import Begin, ChunkJudge
from wholebody.planning.plan import ChunkPlan
from wholebody.planning.preparation import prepare, within_range
from wholebody.reference import HandPath

SLOWER_MAX = 4.0
"""Largest factor by which a chunk is slowed down; chosen: what does not hold then does not hold at rest either."""
BISECTIONS = 6
"""Halvings of the range of a change; derived: 4 to the power of 1 / 64 is 2 % of the slow-down."""
SPARE_SHARE = 0.02
"""Share by which a change is more than the least one that was found to hold; chosen: rounding in a file."""
MORE, MORE_TRIES = 1.05, 4
"""Factor on a change that holds by one plan and not as it is played back, and how often it is tried; chosen."""
ChangeKind = Literal["slower", "moved", "turned", "combined", "lighter"]
BENT: tuple[ChangeKind, ...] = ("turned", "moved", "combined")
"""Ways to bend a path, of which the smallest that does is taken, and of equal ones the first."""

Ask = Callable[[ActionChunk, Begin], bool]
"""Whether something is so of a chunk that is begun somewhere."""


@dataclass(frozen=True)
class Change:
    """A change of a chunk that makes it hold.

    Attributes:
        kind: ``slower`` by a factor, a hand ``moved`` or ``turned`` along the path, or ``combined``: both, and
            its fingers brought into their range.
        slower: Factor; 1 is unslowed.
        moved, turned: How far a palm is at most from where it was asked to be [m], [rad].
        chunk: As changed, feasible.
        lighter: Mass less in the hands, both together [kg].
        actions: The same as numbers of the layout that the chunk came in, (H, A), where it came so.
    """

    kind: ChangeKind
    slower: float
    moved: float
    turned: float
    chunk: ActionChunk
    lighter: float = 0.0
    actions: np.ndarray | None = None


class Repairer:
    """Changes one chunk.

    Args:
        judge: Holds the robot.
        chunk: A valid chunk.
        begin: Where it is begun; at rest with the hands at its first step if not given.
        holds: Whether a chunk that is begun somewhere is feasible as it is, by one plan for all of it.
        lasts: The same as it is played back, each window planned when it comes.
    """

    def __init__(self, judge: ChunkJudge, chunk: ActionChunk, begin: Begin | None, holds: Ask, lasts: Ask) -> None:
        self._judge, self._begin, self._holds, self._lasts = judge, begin, holds, lasts
        self._last_first: tuple[tuple, Begin] | None = None
        prepared = prepare(chunk, judge.planner.hand_limits)
        self.chunk, self.inside = chunk, in_range(prepared.chunk)
        # Noise that is moved too far when it is taken out may be slow enough to be followed.
        scattered = above_floor(within_range(chunk, judge.planner.hand_limits))[0] if prepared.smoothed else None
        self._scattered = scattered and in_range(scattered)

    def holds(self, chunk: ActionChunk) -> bool:
        """Whether a chunk is feasible unchanged, by one plan for all of it."""
        return self._holds(chunk, self._begin or self._first_pose(chunk))

    def lasts(self, chunk: ActionChunk) -> bool:
        """Whether a chunk is feasible as it is played back."""
        return self._lasts(chunk, self._begin or self._first_pose(chunk))

    def _first_pose(self, chunk: ActionChunk) -> Begin:
        """Start posture of this chunk; kept for the next one that begins alike."""
        first = tuple(values[0].tobytes() for values in chunk.arrays().values())
        if self._last_first is None or self._last_first[0] != (first, self._judge.loads):
            self._last_first = (first, self._judge.loads), self._judge.first_pose(chunk)
        return self._last_first[1]

    def repaired(self) -> Change | None:
        """Slowed down first, then its path bent as little as possible; None if that would be another motion."""
        for chunk in (self.inside, self._scattered):
            if chunk is not None and (one := self._slower(chunk)) is not None and self._is_small(one):
                return one
        for factor in (1.0, *self._judge.config.planner.slowdowns):
            bent = [one for kind in BENT if (one := self.bent(factor, kind)) is not None and self._is_small(one)]
            if bent:
                return min(bent, key=self._size)
        return None

    def _size(self, change: Change) -> float:
        """Size of a change in terms of what a repair may move and turn a palm, the larger of both."""
        bounds = self._judge.config.verdict
        return max(change.moved / bounds.palm_repair, change.turned / bounds.turn_repair)

    def _is_small(self, change: Change) -> bool:
        return self._size(change) <= 1.0

    def _slower(self, chunk: ActionChunk) -> Change | None:
        if self.lasts(chunk):
            return self._change("slower", chunk, 1.0)
        # Neither implies the other: one plan sees all of the chunk, playback plans anew from where it has come to.
        factors = [self._least_slowdown(chunk, ask) for ask in (self.holds, self.lasts)]
        found = [factor for factor in factors if factor is not None]
        return self._change("slower", slowed(chunk, min(found)), min(found)) if found else None

    def _least_slowdown(self, chunk: ActionChunk, ask: Callable[[ActionChunk], bool]) -> float | None:
        """The least factor that a bisection by some question comes to and that lasts, or a little more."""
        if not ask(slowed(chunk, SLOWER_MAX)):
            return None
        least = _least(lambda x: ask(slowed(chunk, float(np.exp(x)))), float(np.log(SLOWER_MAX)))
        return self._lasting(lambda factor: slowed(chunk, factor), float(np.exp(least)), SLOWER_MAX)

    def bent(self, factor: float, kind: ChangeKind) -> Change | None:
        """The path led towards what is planned for it at a speed, as far as a repair may: moved, turned, or both."""
        slow = slowed(self.inside, factor)
        begin = self._begin or self._first_pose(slow)
        goal = hands_of(self._judge.planner.plan(slow, slow.t_obs, begin.body, begin.hands), slow)

        def bent(share: float) -> ActionChunk:
            return towards(
                slow, goal, share * (kind != "turned"), share * (kind != "moved"), self._judge.planner.offsets
            )

        if not self.holds(bent(1.0)):
            return None
        # Of the way to the plan as much as a repair may lead a palm.
        most = 1.0 / max(self._size(self._change(kind, bent(1.0), factor)), 1.0)
        least = _least(lambda x: self.holds(bent(x)), 1.0, most)
        share = self._lasting(bent, least, 1.0) if least <= most else None
        return None if share is None else self._change(kind, bent(share), factor)

    def _lasting(self, chunk_at: Callable[[float], ActionChunk], least: float, most: float) -> float | None:
        """The first value from the least that holds on, a little more each time, that lasts too; None if none does."""
        values = [least * (1.0 + SPARE_SHARE) * MORE**k for k in range(MORE_TRIES)]
        values = [values[0], least, *values[1:]]
        return next((x for x in (min(value, most) for value in values) if self.lasts(chunk_at(x))), None)

    def _change(self, kind: ChangeKind, chunk: ActionChunk, factor: float) -> Change:
        return Change(kind, factor, *changed(self._judge, slowed(self.chunk, factor), chunk), chunk)


def in_range(chunk: ActionChunk) -> ActionChunk:
    """A chunk whose numbers were brought into their range: that it was given others is no longer to be noted."""
    return replace(chunk, notes=tuple(note for note in chunk.notes if CLIPPED not in note and OUT_OF_RANGE not in note))


def changed(judge: ChunkJudge, chunk: ActionChunk, other: ActionChunk) -> tuple[float, float]:
    """How far palms are moved [m] and turned [rad] at most from a chunk to another one of as many steps."""
    (p, R), (q, S) = judge.asked(other), judge.asked(chunk)
    return float(np.linalg.norm(p - q, axis=2).max()), float(angle_between(R, S).max())


def slowed(chunk: ActionChunk, factor: float) -> ActionChunk:
    """A chunk that takes so many times longer, at the same rate of steps, on the same path.

    The last step is reached at the first step that is not before it.
    """
    if factor <= 1.0 or len(chunk) < 2:
        return chunk
    steps = int(np.ceil((len(chunk) - 1) * factor - 1e-9)) + 1
    times, end = np.arange(len(chunk)) / chunk.fps, (len(chunk) - 1) / chunk.fps
    at = np.minimum(np.arange(steps) / chunk.fps / factor, end)
    hands = [
        HandPath.from_knots(times, T, q).sample(at)
        for T, q in ((chunk.T_world_lhand, chunk.q_lhand), (chunk.T_world_rhand, chunk.q_rhand))
    ]
    # Hints of the source are about its own times.
    hints = dict.fromkeys(("q_larm", "q_rarm", "q_waist", "q_legs", "base_height", "base_velocity"))
    left, right = hands
    return replace(
        chunk,
        T_world_lhand=left.T_world_hand,
        T_world_rhand=right.T_world_hand,
        q_lhand=left.q_finger[:, : chunk.q_lhand.shape[1]].copy(),
        q_rhand=right.q_finger[:, : chunk.q_rhand.shape[1]].copy(),
        **hints,
    )


def slower_by(chunk: ActionChunk, change: Change, more: float) -> Change:
    """A slow-down of a chunk that is so many times more."""
    factor = change.slower * more
    return replace(change, slower=factor, chunk=slowed(chunk, factor))


def hands_of(plan: ChunkPlan, chunk: ActionChunk) -> list[np.ndarray]:
    """Wrist poses (H, 4, 4) of both hands at the steps of a chunk by its plan; where that begins, before it does."""
    times = plan.start + plan.rate * np.maximum(np.arange(len(chunk)) / chunk.fps - plan.start, 0.0)
    return [path.sample(times).T_world_hand for path in plan.paths]


def towards(
    chunk: ActionChunk, goal: list[np.ndarray], position: float, turn: float, offsets: np.ndarray
) -> ActionChunk:
    """A chunk whose palms are led by a share of the way, and of the turn, to other wrist poses (H, 4, 4)."""
    out = []
    for T, there, offset in zip((chunk.T_world_lhand, chunk.T_world_rhand), goal, offsets, strict=True):
        R, S = T[:, :3, :3], there[:, :3, :3]
        p, q = (translated(at, offset)[:, :3, 3] for at in (T, there))
        led = T.copy()
        led[:, :3, :3] = rotvec_to_matrix(turn * matrix_to_rotvec(S @ np.swapaxes(R, 1, 2))) @ R
        led[:, :3, 3] = p + position * (q - p) - led[:, :3, :3] @ offset
        out.append(led)
    return replace(chunk, T_world_lhand=out[0], T_world_rhand=out[1])


def _least(holds: Callable[[float], bool], most: float, wanted: float = np.inf) -> float:
    """Least value up to ``most``, which holds, that was found to hold, by bisection from 0.

    It ends where only values are left that are more than ``wanted``.
    """
    low, high = 0.0, most
    for _ in range(BISECTIONS):
        if low >= wanted:
            break
        middle = 0.5 * (low + high)
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high
