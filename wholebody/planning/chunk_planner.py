"""From an action chunk to a plan: hand paths that can be had, a posture to go with them, and how fast.

Slow down along the chunk first, shift the body second (the posture plan), bend the hand path last (the clamp).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from policy.chunk import ActionChunk
from policy.geometry.rotations import matrix_to_rotvec, quaternion_to_matrix, rotvec_to_matrix
from wholebody.config import PlannerConfig
from wholebody.planning.contact_feasibility import ContactFeasibility
from wholebody.planning.limit_projection import JUMP, continued
from wholebody.planning.trajectory import GRID, BodyState, SampledTrajectory, curve_through, track_along
from wholebody.planning.trajopt.centroidal import Centroidal
from wholebody.planning.trajopt.optimizer import KnotTrajectory, TrajectoryOptimizer
from wholebody.reference import HandLimits, HandMotion, HandPath, time_scaled
from wholebody.robot.state import Robot
from wholebody.types import Reason

GUESS_DISTANCE = 0.03
"""Up to which the plan before is worth beginning with [m]."""
GOOD_LOSS, GOOD_EXCESS = 0.004, 0.5
"""Distance of a palm from its target [m], and excess over a bound, above which another search is tried."""

DRIFT_MAX = 0.006
"""How far the capture point may drift where, between knots, the zero-moment point would have to leave that [m]."""
SLIP_MAX, SLIP_FAR = 0.3, 0.15
"""Impulse per mass that the floor may fail to give for lack of friction [m/s], and the same where a target is out of
reach, for which less is risked."""
FAR = 0.15
"""Distance of a palm from its target past which the target is out of reach, not just hard to follow [m]."""
START_MAX = (0.3, np.deg2rad(60.0))
"""A chunk that begins further from the hands than this is not the continuation of anything [m, rad]."""
UNHURRIED = 0.6
"""Share of the usual speed, acceleration and jerk with which such a chunk is joined."""
CLAMP_STEPS = 4
"""Points of the posture plan from knot to knot that a hand is led through where it cannot be on its own path."""
TEMPERED = 1e-3
"""How far steps are moved, to be steps that a hand can do, before that is worth a word [m]."""
TURN_LOSS = 0.008
"""Distance of a palm from its target above which its orientation gives way more [m]."""


@dataclass(frozen=True)
class PlanReport:
    """What had to be changed for a chunk to be feasible; K steps of the posture plan.

    Attributes:
        steps: Path parameters of the steps, shape (K,), [s].
        missed: Distance of each palm of the posture plan from where the chunk wants it, shape (K, 2), [m].
        clamped: How far each hand was moved at each step, shape (K, 2), [m].
        slowdown: Factor by which the chunk takes longer, at least 1.
        zmp_margin: Distance of the planned zero-moment point from the edge of the support, shape (K,), [m].
        reasons: Why it is not followed as given, most important first.
        excess: Largest excess of the posture plan over one of its bounds, in terms of the room behind the bound.
        safe: Whether the posture plan keeps its bounds and its balance, between its steps too.
        tempered: How far the steps of a chunk that jumps were moved to be steps that a hand can do [m].
    """

    steps: np.ndarray
    missed: np.ndarray
    clamped: np.ndarray
    slowdown: float
    zmp_margin: np.ndarray
    reasons: tuple[Reason, ...] = ()
    excess: float = 0.0
    safe: bool = True
    tempered: float = 0.0

    @property
    def hindered(self) -> bool:
        """Whether the way to a chunk that begins elsewhere is slow because of what the robot was doing."""
        return Reason.FAR_START in self.reasons and self.slowdown > 1.0

    def quicker(self, other: PlanReport) -> bool:
        """Whether this plan is balanced and quicker than another one."""
        return self.safe and self.slowdown < other.slowdown


@dataclass(frozen=True)
class ChunkPlan:
    """A chunk made feasible; parameters ``s`` are seconds since the chunk's observation, from ``start`` to ``end``."""

    paths: tuple[HandPath, HandPath]
    posture: SampledTrajectory
    start: float
    end: float
    report: PlanReport

    @property
    def rate(self) -> float:
        """Speed along the chunk, 1 being the chunk's own."""
        return 1.0 / self.report.slowdown


@dataclass(frozen=True)
class _Attempt:
    """Plan of a chunk at one speed.

    ``steps`` are the parameters, ``wanted`` and ``palms`` the poses asked for; it ``guessed`` if its search began with
    a part of the plan before.
    """

    slowdown: float
    raw: tuple[HandPath, HandPath]
    tempered: float
    steps: np.ndarray
    wanted: np.ndarray
    palms: np.ndarray
    motion: KnotTrajectory
    distance: np.ndarray
    track: SampledTrajectory
    drift: float
    slip: float
    guessed: bool

    @property
    def loss(self) -> float:
        """Largest distance of a palm from where it should be [m]."""
        return float(self.distance.max())

    @property
    def error(self) -> float:
        """Mean distance of the palms from where the chunk wants them at its own times [m]."""
        behind = self.steps[0] + (self.steps - self.steps[0]) / self.slowdown
        reached = self.motion.T_palms[:, :, :3, 3].reshape(len(self.steps), -1).T
        late = np.stack([np.interp(behind, self.steps, x) for x in reached], axis=1).reshape(-1, 2, 3)
        return float(np.mean(np.linalg.norm(late - self.palms[:, :, :3, 3], axis=2)))

    @property
    def imbalance(self) -> float:
        """How much more the plan wants of the floor than it can give, 1 being all that may be lacking."""
        return max(self.drift / DRIFT_MAX, self.slip / (SLIP_MAX if self.loss <= FAR else SLIP_FAR))

    @property
    def excess(self) -> float:
        """Largest excess over a bound, in terms of the room behind it."""
        return float(self.motion.excess.max())


class ChunkPlanner:
    """Plans chunks, each from where the plan before is."""

    def __init__(self, spec: RobotSpec, robot: Robot, config: PlannerConfig, friction: float) -> None:
        self.spec, self.config = spec, config
        self.model, self.data = robot.model, robot.model.createData()
        self.posture = TrajectoryOptimizer(spec, config.posture, friction)
        self.balance = ContactFeasibility(self.posture.body, friction)
        self.palm_ids = [robot.frame_id(tool.palm_frame) for tool in spec.tools]
        trunk = (spec.base_body, spec.torso_body)
        self._momenta = Centroidal(self.model, [robot.frame_id(name) for name in trunk])
        self.offsets = np.array([tool.palm_offset for tool in spec.tools])
        low, high = spec.position_min, spec.position_max
        fingers = [spec.indices(tool.finger_joints) for tool in spec.tools]
        self.caps = tuple(
            HandLimits(finger_lower=tuple(low[i]), finger_upper=tuple(high[i])) if len(i) else HandLimits()
            for i in fingers
        )

    def plan(
        self,
        chunk: ActionChunk,
        now: float,
        start: BodyState,
        commanded: HandMotion,
        before: np.ndarray | None = None,
        *,
        doubtful: bool = False,
    ) -> ChunkPlan:
        """Plan the rest of a chunk.

        Args:
            chunk: A valid chunk.
            now: Present time [s].
            start: Where the posture plan is now.
            commanded: What the two hands are commanded to do now, rows (2, 40).
            before: What the plan before would have done from now on, configurations one step of the posture plan apart,
                shape (k, nq), the first one a step from now; a good guess where both plans agree.
            doubtful: Whether the chunk is a guess at what somebody meant, which is no reason to hurry.
        """
        attempt = self._best(chunk, now, start, commanded, before, doubtful)
        paths, clamped = self._clamp(attempt)
        motion, steps = attempt.motion, attempt.steps
        margin = np.min(self.posture.body.pressure_offsets - motion.zmp @ self.posture.support.normals.T, axis=1)
        reasons = []
        if clamped.max() > 0.0:
            reasons.append(Reason.OUT_OF_REACH)
        if attempt.slowdown > 1.0:
            reasons.append(Reason.TOO_FAST_FOR_BALANCE)
        if attempt.tempered > TEMPERED:
            reasons.append(Reason.STEPS_JUMP)
        if _begins_elsewhere(chunk, now, commanded):
            reasons.append(Reason.FAR_START)
        safe = self._safe(attempt)
        if not safe:
            reasons.append(Reason.POSTURE_INFEASIBLE)
        report = PlanReport(
            steps=steps, missed=attempt.distance, clamped=clamped, slowdown=attempt.slowdown, zmp_margin=margin,
            reasons=tuple(reasons), excess=attempt.excess, safe=safe, tempered=attempt.tempered,
        )  # fmt: skip
        return ChunkPlan(paths, attempt.track, float(steps[0]), float(steps[-1]), report)

    def _best(self, chunk, now, start, commanded, before, doubtful) -> _Attempt:
        """At the chunk's own speed if that follows, else slower; else what comes nearest within the bounds."""
        c, tried = self.config, []
        for slowdown in (1.0, *c.slowdowns):
            attempt = self._attempt(chunk, now, start, commanded, slowdown, before if slowdown == 1.0 else None)
            if attempt.guessed and not self._good(attempt):
                # The plan before may have led to where the search cannot leave: begin anew.
                anew = self._attempt(chunk, now, start, commanded, slowdown)
                attempt = min(attempt, anew, key=lambda one: (not self._safe(one), one.motion.cost))
            if attempt.loss > TURN_LOSS:
                softer, guess = replace(c.posture, orientation=c.turning), attempt.motion.q[1:]
                turned = self._attempt(chunk, now, start, commanded, slowdown, guess, softer)
                attempt = min(attempt, turned, key=lambda one: (one.excess > c.excess_max, one.loss))
            wild = doubtful or attempt.tempered > JUMP
            if self._follows(attempt) and not wild:
                return attempt
            if wild or attempt.loss > FAR:
                # Nobody can be there, or means to: nothing is gained by hurrying with everything that there is.
                calm = self._attempt(chunk, now, start, commanded, slowdown, before, c.calm)
                if self._safe(calm) and calm.slip <= SLIP_FAR:
                    return attempt if self._follows(attempt) and attempt.imbalance < calm.imbalance else calm
            tried.append(attempt)
            # What is out of reach at the end stays so at any speed.
            if attempt.distance[-1].max() > c.loss_max:
                break
        safe = [attempt for attempt in tried if self._safe(attempt)]
        if safe:
            return min(safe, key=lambda attempt: attempt.error)
        # Hands that only pull: the bounds win over them by orders of magnitude.
        gentle = self._attempt(chunk, now, start, commanded, 1.0, before, c.gentle)
        if self._safe(gentle):
            return gentle
        others = (c.gentle, c.brake) if gentle.guessed else (c.brake,)
        tried += [gentle, *(self._attempt(chunk, now, start, commanded, 1.0, None, x) for x in others)]
        return max(tried, key=lambda one: (one.excess <= c.excess_max, -one.imbalance))

    def _good(self, attempt: _Attempt) -> bool:
        return attempt.loss <= GOOD_LOSS and attempt.excess <= GOOD_EXCESS

    def _follows(self, attempt: _Attempt) -> bool:
        c = self.config
        return (attempt.loss <= c.loss_max or attempt.error <= c.error_max) and self._safe(attempt)

    def _safe(self, attempt: _Attempt) -> bool:
        return attempt.excess <= self.config.excess_max and attempt.imbalance <= 1.0

    def _attempt(self, chunk, now, start, commanded, slowdown, before=None, posture=None) -> _Attempt:
        """The chunk planned at one speed; a slower path begins with more motion per parameter, so nothing jumps."""
        s0 = now - chunk.t_obs
        times = np.arange(len(chunk)) / chunk.fps
        sources = ((chunk.T_world_lhand, chunk.q_lhand), (chunk.T_world_rhand, chunk.q_rhand))
        # A chunk that begins elsewhere says nothing about the way there: no reason to hurry.
        share = UNHURRIED if _begins_elsewhere(chunk, now, commanded) else 1.0
        raw, tempered = zip(
            *(
                _joined(times, T, q, caps, share, _slower(row, slowdown), s0)
                for (T, q), caps, row in zip(sources, self.caps, commanded.rows, strict=True)
            ),
            strict=True,
        )
        dt = self.posture.config.dt / slowdown
        end = max(raw[0].span[1], raw[1].span[1], s0) + self.config.settle / slowdown
        steps = s0 + dt * np.arange(int(np.ceil((end - s0) / dt)) + 1)
        motions = [path.sample(steps) for path in raw]
        wanted = np.stack([motion.T_world_hand for motion in motions], axis=1)
        fingers = [
            motion.q_finger[:, : len(tool.finger_joints)] for motion, tool in zip(motions, self.spec.tools, strict=True)
        ]
        palms = wanted.copy()
        palms[:, :, :3, 3] += np.einsum("khij,hj->khi", wanted[:, :, :3, :3], self.offsets)
        guess = None if before is None else self._continued(before, palms)
        motion = self.posture.plan(start.q, start.v, palms, np.hstack(fingers), guess, posture)
        curve = curve_through(steps, motion.q, slowdown * start.v)
        distance = np.linalg.norm(motion.T_palms[:, :, :3, 3] - palms[:, :, :3, 3], axis=2)
        track = track_along(curve, steps[0], steps[-1] + steps[1] - steps[0], self._momenta)
        drift, slip = self.balance.drift(track, slowdown), self.balance.slip(track, slowdown)
        guessed = guess is not None and len(guess) > 0
        return _Attempt(
            slowdown, raw, max(tempered), steps, wanted, palms, motion, distance, track, drift, slip, guessed
        )

    def _continued(self, before: np.ndarray, palms: np.ndarray) -> np.ndarray:
        """Of the plan before, what is still near the palms wanted, (k, nq)."""
        same = 0
        for q, T in zip(before, palms[1:-1], strict=False):
            if np.linalg.norm(np.array(self._palms(q))[:, :3, 3] - T[:, :3, 3], axis=1).max() > GUESS_DISTANCE:
                break
            same += 1
        return before[:same]

    def _clamp(self, attempt: _Attempt) -> tuple[tuple[HandPath, HandPath], np.ndarray]:
        """Lead the hands along the plan wherever it does not reach the targets; a small remainder is left to the QP.

        Inside the tolerance the QP is left to close the gap; past it the path becomes the plan's own, whole, from a
        knot before to a knot after: near a straight arm, a target a few millimetres off the planned posture drives the
        arm far away from it, and so does a turn that is over before the next knot.
        """
        reached, palms, steps = attempt.motion.T_palms, attempt.palms, attempt.steps
        turn = matrix_to_rotvec(reached[:, :, :3, :3] @ np.swapaxes(palms[:, :, :3, :3], -1, -2))
        c, angle = self.config, np.linalg.norm(turn, axis=2)
        share = _widened(np.clip(2.0 * attempt.distance / c.clamp_tolerance - 1.0, 0.0, 1.0))
        turn_share = _widened(np.clip(2.0 * angle / c.turn_tolerance - 1.0, 0.0, 1.0))
        if not share.any() and not turn_share.any():
            return attempt.raw, np.zeros_like(attempt.distance)
        every = max(1, round((steps[1] - steps[0]) / (CLAMP_STEPS * GRID)))
        q = attempt.track.q[: round((steps[-1] - steps[0]) / GRID) + 1 : every]
        s = steps[0] + every * GRID * np.arange(len(q))
        share, turn_share = _between(s, steps, share), _between(s, steps, turn_share)
        led = np.flatnonzero((share > 0.0).any(axis=1) | (turn_share > 0.0).any(axis=1) | (s == s[0]))
        planned = np.array([self._palms(x) for x in q[led]])
        # The hands are not quite where the plan begins: that is made up for until the first knot.
        left = _between(s[led], steps[:2], np.array([[1.0], [0.0]]))
        paths = []
        for i, path in enumerate(attempt.raw):
            T = path.sample(s).T_world_hand
            R, palm = T[led, :3, :3], T[led, :3, 3] + T[led, :3, :3] @ self.offsets[i]
            turn, way = matrix_to_rotvec(planned[:, i, :3, :3] @ np.swapaxes(R, 1, 2)), planned[:, i, :3, 3] - palm
            R = rotvec_to_matrix(turn_share[led, i, None] * (turn - left * turn[0])) @ R
            palm += share[led, i, None] * (way - left * way[0])
            T[led, :3, :3], T[led, :3, 3] = R, palm - R @ self.offsets[i]
            paths.append(path.moved(s, T))
        return tuple(paths), attempt.distance * _between(steps, s, share)

    def _palms(self, q: np.ndarray) -> list[np.ndarray]:
        """Poses of both palms, (4, 4) each, at a configuration."""
        pin.forwardKinematics(self.model, self.data, q)
        return [pin.updateFramePlacement(self.model, self.data, frame).homogeneous for frame in self.palm_ids]


def _widened(share: np.ndarray) -> np.ndarray:
    """What the knots (K, 2) before and after ask for as well."""
    padded = np.pad(share, ((1, 1), (0, 0)))
    return np.maximum(share, np.maximum(padded[:-2], padded[2:]))


def _between(s: np.ndarray, steps: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Shares (K, 2) at ``steps``, smoothly in between: (n, 2) at ``s``."""
    at = np.clip((s - steps[0]) / (steps[1] - steps[0]), 0.0, len(steps) - 1.0)
    low = np.minimum(at.astype(int), len(steps) - 2)
    x = (at - low)[:, None]
    return share[low] + x**3 * (10.0 + x * (6.0 * x - 15.0)) * (share[low + 1] - share[low])


def _begins_elsewhere(chunk: ActionChunk, now: float, commanded: HandMotion) -> bool:
    """Whether a hand would have to jump to where the chunk has it now."""
    step = int(np.clip(round((now - chunk.t_obs) * chunk.fps), 0, len(chunk) - 1))
    T = np.stack([chunk.T_world_lhand[step], chunk.T_world_rhand[step]])
    distance = np.linalg.norm(T[:, :3, 3] - commanded.p, axis=1)
    turn = matrix_to_rotvec(np.swapaxes(quaternion_to_matrix(commanded.quat, "xyzw"), 1, 2) @ T[:, :3, :3])
    return bool(distance.max() > START_MAX[0] or np.linalg.norm(turn, axis=1).max() > START_MAX[1])


def _joined(
    times: np.ndarray, T: np.ndarray, q: np.ndarray, caps: HandLimits, share: float, motion: HandMotion, s: float
) -> tuple[HandPath, float]:
    """The path through a chunk's steps that goes on from a motion at ``s``.

    Where no hand could do them, the path goes through the nearest that one can do, which are so far away at most [m].
    Both keep that share of the caps.
    """
    calm = caps.scaled(share)
    path = HandPath.from_knots(times, T, q, caps=caps).joined(motion, s, caps=calm)
    if len(times) < 2:
        return path, 0.0
    tempered = continued(times, T, q, calm, motion, s)
    if not (path.join.rough or tempered.changed):
        return path, 0.0
    path = HandPath.from_knots(tempered.times, tempered.T, tempered.q, caps=caps).joined(motion, s, caps=calm)
    return path, tempered.moved


def _slower(row: np.ndarray, slowdown: float) -> HandMotion:
    """The motion of one hand [per s] as derivatives of a path that is run through ``slowdown`` times slower."""
    return time_scaled(HandMotion(row.copy()), slowdown, 0.0)
