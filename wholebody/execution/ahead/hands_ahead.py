"""Hands that follow the newest chunk of a stream while its plan is being made; the plan before leads the body.

Chunks that come faster than they are planned say where hands are to be *now*, and a plan of them is a tenth of a second
old when it takes over. So the hands go along the newest chunk's own paths, joined to what they do, no further off the
plan's than its posture serves. What a plan changed in a chunk it said of where the hands come to: they are held as much
nearer to it.
"""

from __future__ import annotations

from math import inf

import numpy as np

from policy.chunk import ActionChunk
from wholebody.control.touch import Touch
from wholebody.execution.plan_follower import PlanFollower
from wholebody.planning.plan import ChunkPlan
from wholebody.planning.preparation import prepare
from wholebody.reference import HandLimits, HandMotion, HandPath, ReferenceSmoother

LEASH = (0.15, 0.6)
"""How far a hand may be from the plan [m], and how far turned [rad]; measured: a fast stream is up to 0.15 m further on
than was foretold, and the program keeps the balance there."""
LEASH_MIN = 0.008
"""Distance that is left of it where the plan leads hands elsewhere than asked [m]; derived: what plans leave to the
program, `planner.clamp_tolerance`."""
STREAM_GAP = 0.15
"""Longest time between two chunks of a stream [s]; chosen: 10 Hz. Who says less often where hands are to be says it far
enough ahead for a plan."""
CHANGE = 3.0
"""How many times as much the leash is shortened as the plan moved the hand; chosen: 5 cm are a no."""


class HandsAhead:
    """Decides whether the hands are led along the newest chunk, or by the plan.

    Args:
        follower: Follows the plan.
        smoother: Of the hands.
        limits: Of the left and the right hand.
        touch: Says whether hands touch something: then the plan leads them, which knows what they met.
    """

    def __init__(
        self, follower: PlanFollower, smoother: ReferenceSmoother, limits: tuple[HandLimits, ...], touch: Touch
    ) -> None:
        self._follower, self._smoother, self._limits, self._touch = follower, smoother, limits, touch
        self._paths: tuple[HandPath, ...] | None = None
        self._t_obs, self._ahead = -inf, 0.0
        self._own: tuple[HandPath, ...] = ()

    def offer(self, chunk: ActionChunk, plan: ChunkPlan | None, now: float) -> None:
        """Take a chunk whose plan has to wait, now [s], and the plan that is followed, if one is."""
        streams, self._t_obs = chunk.t_obs - self._t_obs <= STREAM_GAP, chunk.t_obs
        if plan is not None:
            self._paths = self._joined(chunk, now - chunk.t_obs) if streams else None
            self._look(plan, now)

    def begin(self, chunk: ActionChunk, plan: ChunkPlan, now: float) -> None:
        """Go on beside a plan that has taken over, now [s], where its chunk is not the newest one itself."""
        self._own = plan.paths
        if chunk.t_obs >= self._t_obs:
            self._paths = None
        self._look(plan, now)

    def end(self, plan: ChunkPlan | None) -> None:
        """Leave the hands to the plan that is followed, if one is: no motion leads on from where they are led."""
        self._paths = None
        if plan is not None:
            self._look(plan, 0.0)

    def hands(self, s: np.ndarray) -> tuple[HandMotion, ...]:
        """What both hands are led along at parameters (n,) of the plan [s], rows (n, 40) with rates along it."""
        if self._follower.leads:
            return tuple(path.sample(s + self._ahead) for path in self._paths)
        return tuple(path.sample(s) for path in self._own)

    def _look(self, plan: ChunkPlan, now: float) -> None:
        follower = self._follower
        if self._paths is not None and plan.rate >= 1.0 and not self._touch.active:
            self._ahead = now - self._t_obs - follower.s
            way = max(LEASH[0] - CHANGE * plan.report.moved_by(follower.s), LEASH_MIN)
            follower.lead(self._paths, self._ahead, (way, LEASH[1]))
        elif follower.leads:
            self._own = self._continued(plan.paths, follower.s)
            follower.let_go(self._own)

    def _joined(self, chunk: ActionChunk, s: float) -> tuple[HandPath, ...] | None:
        """The chunk's own paths from ``s`` on; None for one that jumps, or is not taken as given."""
        prepared = prepare(chunk, self._limits)
        if prepared.lift.any() or prepared.smoothed:
            return None
        chunk = prepared.chunk
        hands = (chunk.T_world_lhand, chunk.q_lhand), (chunk.T_world_rhand, chunk.q_rhand)
        own = (
            HandPath.through(prepared.times, T, q, limits) for (T, q), limits in zip(hands, self._limits, strict=True)
        )
        paths = self._continued(own, s)
        near = all(path.join.distance <= LEASH[0] and path.join.angle <= LEASH[1] for path in paths)
        return paths if near else None

    def _continued(self, paths: tuple[HandPath, ...], s: float) -> tuple[HandPath, ...]:
        """Paths from ``s`` on, joined to what the hands do."""
        rows = self._smoother.motion.rows
        return tuple(path.joined(HandMotion(row.copy()), s) for path, row in zip(paths, rows, strict=True))
