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
from wholebody.execution.ahead.fast_stream import LAG, FastStream
from wholebody.execution.ahead.ready import ReadyBody
from wholebody.execution.plan_follower import PlanFollower
from wholebody.planning.plan import ChunkPlan
from wholebody.planning.preparation import PreparedChunk, prepare
from wholebody.reference import HandLimits, HandMotion, HandPath, ReferenceSmoother

LEASH = (0.15, 0.6)
"""How far a hand may be from the plan [m], and how far turned [rad]; measured: a fast stream is up to 0.15 m further on
than was foretold, and the program keeps the balance there."""
JUDGED_LEASH = (0.06, 0.3)
"""The same where a gate judges chunks, of which the newest has not been judged yet [m], [rad]; chosen: so far hands may
be taken back where it is rejected. What jumps further waits for its judgement."""
LEASH_MIN = 0.008
"""Distance that is left of it where the plan leads hands elsewhere than asked [m]; derived: what plans leave to the
program, `planner.clamp_tolerance`."""
STREAM_GAP = 0.15
"""Longest time between two chunks of a stream [s]; chosen: 10 Hz. Who says less often where hands are to be says it far
enough ahead for a plan."""
CHANGE = 3.0
"""How many times as much the leash is shortened as the plan moved the hand; chosen: 5 cm are a no."""


BEHIND = 0.01
"""Distance from what was said from which on plans are no help to fast hands [m]; chosen: over twice the 4 mm that hands
are off along plans which serve. The body goes down only for what a standing one does not follow."""
FREE = (10.0, 7.0)
"""Leash of fast hands [m, rad]; definition: none."""
BODY_SHARE = 0.4
"""Share with which a joint's distance from where the body waits counts; measured: fast hands take it up to 0.31 rad
away."""
FAST_LIMITS = {"speed": 0.6, "acceleration": 0.6, "jerk": 4.0}
"""Share of each of the limits on the positions of fast hands; measured: with less jerk they lag behind, and 1.5 m/s and
12 m/s^2 are a third more than a lissajous of 0.15 m asks for."""
FORESEEN = 0.1
"""How far ahead fast hands have to be in reach from where the body waits [s]; chosen: a plan is as far away."""
ASTRAY = 0.08
"""Error of a palm at which fast hands are led by the next plan again [m]; derived: where a plan is held,
`safety.error_stop`."""
ASTRAY_TIME = 0.1
"""Time for which a palm is so far off after which the robot stands off its plan [s]; chosen: a target is out of reach
from where the body waits, and the body would be drawn after it."""


class HandsAhead:
    """Decides whether the hands are led along the newest chunk, or by the plan, and who leads the body.

    Args:
        follower: Follows the plan.
        smoother: Of the hands.
        limits: Of the left and the right hand.
        touch: Says whether hands touch something: then the plan leads them, which knows what they met.
        ready: Where the body waits for fast hands.
        gated: Whether chunks are judged by their plans: then the newest one leads hands on a shorter leash, and not
            before another one is cleared where one was rejected; and no hands are fast, which follow no plan.

    Attributes:
        fast: Whether hands are led as single targets say, and the body waits for them.
        streams: Whether the newest chunk came so soon after the one before that both are of a stream.
    """

    def __init__(
        self,
        follower: PlanFollower,
        smoother: ReferenceSmoother,
        limits: tuple[HandLimits, ...],
        touch: Touch,
        ready: ReadyBody,
        *,
        gated: bool = False,
    ) -> None:
        self._follower, self._smoother, self._limits, self._touch = follower, smoother, limits, touch
        self._gated, self._rejected, self._leash = gated, False, JUDGED_LEASH if gated else LEASH
        self._ready, self._stream, self.fast, self._astray = ready, FastStream(limits), False, 0.0
        self._usual = smoother.limits.copy()
        self._paths: tuple[HandPath, ...] | None = None
        self._t_obs, self._ahead = -inf, 0.0
        self._said, self.streams = -inf, False
        self._own: tuple[HandPath, ...] = ()

    def offer(self, chunk: ActionChunk, plan: ChunkPlan | None, now: float, *, waits: bool) -> None:
        """Take a chunk, now [s], the plan that is followed, if one is, and whether the chunk's own plan has to wait."""
        waits = waits and not self._rejected
        self.streams, self._said = chunk.t_obs - self._said <= STREAM_GAP, chunk.t_obs
        if not self._gated:
            self._stream.add(chunk)
        if self.fast and not self._follower.leads:
            self._slow_down()
        fast = self._stream.is_fast(now) or self.fast
        if plan is None or not (waits or fast):
            self._t_obs = chunk.t_obs if waits else self._t_obs
            return
        prepared = prepare(chunk, self._limits)
        paths = self._stream.paths(prepared) if fast else None
        if paths is not None and self._are_fast(paths, chunk, now):
            self._t_obs, self._paths = chunk.t_obs, paths
            self._look(plan, now)
        elif waits and not self.fast:
            streams, self._t_obs = chunk.t_obs - self._t_obs <= STREAM_GAP, chunk.t_obs
            self._paths = self._joined(prepared, now - chunk.t_obs) if streams else None
            self._look(plan, now)

    def begin(self, chunk: ActionChunk, plan: ChunkPlan, now: float, *, cleared: bool = True) -> None:
        """Go on beside a plan that has taken over, now [s], where its chunk is not the newest one itself.

        Hands that a gate gave back to their plan are led again if it ``cleared`` the chunk of this one.
        """
        self._own, self._rejected = plan.paths, self._rejected and not cleared
        near = self._ready.reaches(self._smoother.motion.p) and self._follower.off() < ASTRAY
        if self.fast and self._stream.is_fast(now) and not self._touch.active and near:
            self._follower.wait(self._ready.row, BODY_SHARE)
        else:
            self._slow_down()
            if chunk.t_obs >= self._t_obs:
                self._paths = None
        self._look(plan, now)

    @property
    def is_lost(self) -> bool:
        """Whether fast hands have been far from where they are led for `ASTRAY_TIME`."""
        return self.fast and self._follower.leads and self._astray > ASTRAY_TIME

    @property
    def is_there(self) -> bool:
        """Whether fast hands are where single targets have them, whatever a plan of these would have to change."""
        return self.fast and self._follower.leads and self._follower.off() <= LEASH_MIN

    def advance(self, elapsed: float) -> None:
        """Let the body go on to where it waits for fast hands, for so long [s]."""
        if not self.fast or not self._follower.leads:
            return
        self._astray = self._astray + elapsed if self._follower.off() > ASTRAY else 0.0
        if not self._ready.is_over:
            self._follower.wait(self._ready.advance(elapsed), BODY_SHARE)

    def _are_fast(self, paths: tuple[HandPath, ...], chunk: ActionChunk, now: float) -> bool:
        """Whether fast hands are to be led along paths; from now on [s], if they were not before."""
        there = np.array([now - chunk.t_obs + t for t in (-LAG, FORESEEN)])
        p, now_there = np.stack([path.sample(there).p for path in paths], axis=1), self._smoother.motion.p
        off = float(np.linalg.norm(p[0] - now_there, axis=1).max())
        if self.fast:
            return off <= LEASH[0] and self._ready.reaches(p[1])
        serves = not BEHIND <= off <= LEASH[0]
        if serves or not self._stream.is_fast(now) or self._touch.active or self._follower.trust < 1.0:
            return False
        self.fast, self._astray = self._ready.begin(now_there) and self._ready.reaches(p[1]), 0.0
        if self.fast:
            for name, factor in FAST_LIMITS.items():
                self._smoother.limits[name][:, 0] *= factor
            self._follower.wait(self._ready.row, BODY_SHARE)
        return self.fast

    def _slow_down(self) -> None:
        """Leave hands and body to plans."""
        if self.fast:
            self._smoother.limits[:] = self._usual
            self.fast, self._paths, self._astray = False, None, 0.0

    def end(self, plan: ChunkPlan | None) -> None:
        """Leave the hands to the plan that is followed, as no motion leads on from where they are; to none if None.

        Fast hands go on: they follow what was said, not a plan of it.
        """
        self._rejected = self._gated
        if plan is None:
            self._slow_down()
        if self.fast and self._follower.leads:
            return
        self._paths = None
        if plan is not None:
            self._look(plan, 0.0)

    def leave(self, plan: ChunkPlan | None) -> None:
        """Leave the hands to the plan that is followed, fast ones too."""
        self._slow_down()
        self.end(plan)

    def hands(self, s: np.ndarray) -> tuple[HandMotion, ...]:
        """What both hands are led along at parameters (n,) of the plan [s], rows (n, 40) with rates along it."""
        if self._follower.leads:
            return tuple(path.sample(s + self._ahead) for path in self._paths)
        return tuple(path.sample(s) for path in self._own)

    def _look(self, plan: ChunkPlan, now: float) -> None:
        follower = self._follower
        if self.fast:
            self._ahead = now - self._t_obs - follower.s - LAG
            follower.lead(self._paths, self._ahead, FREE)
        elif self._paths is not None and plan.rate >= 1.0 and not self._touch.active:
            self._ahead = now - self._t_obs - follower.s
            way = max(min(LEASH[0] - CHANGE * plan.report.moved_by(follower.s), self._leash[0]), LEASH_MIN)
            follower.lead(self._paths, self._ahead, (way, self._leash[1]))
        elif follower.leads:
            self._own = self._continued(plan.paths, follower.s)
            follower.let_go(self._own)

    def _joined(self, prepared: PreparedChunk, s: float) -> tuple[HandPath, ...] | None:
        """The chunk's own paths from ``s`` on; None for one that jumps, or is not taken as given."""
        if prepared.lift.any() or prepared.smoothed:
            return None
        chunk = prepared.chunk
        hands = (chunk.T_world_lhand, chunk.q_lhand), (chunk.T_world_rhand, chunk.q_rhand)
        own = (
            HandPath.through(prepared.times, T, q, limits) for (T, q), limits in zip(hands, self._limits, strict=True)
        )
        paths = self._continued(own, s)
        far, turned = self._leash
        near = all(path.join.distance <= far and path.join.angle <= turned for path in paths)
        return paths if near else None

    def _continued(self, paths: tuple[HandPath, ...], s: float) -> tuple[HandPath, ...]:
        """Paths from ``s`` on, joined to what the hands do."""
        rows = self._smoother.motion.rows
        return tuple(path.joined(HandMotion(row.copy()), s) for path, row in zip(paths, rows, strict=True))
