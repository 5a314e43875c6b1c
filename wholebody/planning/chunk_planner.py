"""From an action chunk to a plan: hand paths that the robot can follow, a whole-body trajectory, and how fast.

Slow down along the chunk first, shift the body second (the trajectory), bend the hand path last (the clamp).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, cached_property, lru_cache
from math import inf

import numpy as np

from models.spec import RobotSpec
from policy.chunk import ActionChunk
from wholebody.config import ControllerConfig
from wholebody.planning.attempt import Attempt, Followed, Modes, Targets
from wholebody.planning.changes import PlanChange, changes
from wholebody.planning.contact_feasibility import ContactFeasibility
from wholebody.planning.effort import Effort
from wholebody.planning.hand_clamp import clamped
from wholebody.planning.hands_apart import HandHulls, HandsApart
from wholebody.planning.limit_projection import JUMP
from wholebody.planning.plan import ChunkPlan, PlanReport
from wholebody.planning.preparation import PreparedChunk, prepare
from wholebody.planning.reachability.holdable import HoldablePath, HoldablePlaces, arms_spent
from wholebody.planning.reachability.reach_map import ReachabilityMap, basis, map_for
from wholebody.planning.strategies import choice
from wholebody.planning.strategies.rows import ARMS_SPENT_MAX, Asked, Overlap, Try
from wholebody.planning.strategies.strategy import HOLDABLE, PARTED, PREVIEW, BeginAt, Strategy
from wholebody.planning.trajectory import BodyState, centroidal_along, curve_through
from wholebody.reference import HandLimits, HandMotion
from wholebody.robot.contact_schedule import ContactSchedule
from wholebody.robot.hand_loads import Loads
from wholebody.robot.palms import palm_offsets, palm_poses
from wholebody.robot.state import Robot
from wholebody.trajopt.budget import Budget
from wholebody.trajopt.centroidal import Centroidal
from wholebody.trajopt.optimizer import KnotTrajectory, TrajectoryOptimizer
from wholebody.types import Reason

SEARCH_SHARE = 0.7
"""Share of a limit on CPU time in which attempts are made; chosen: the rest is for judging the last one, and for the
hands."""
KNOTS_AT_REST = 7
"""Knots at the end of a plan at which the arms are to hold what they carry; derived: `planner.settle` and rounding."""
PREVIEW_WORK = 4.0
"""Most linearisations and steps of a preview [no unit]; chosen: the first motion, one step."""


class ChunkPlanner:
    """Plans chunks, each from where the plan before is.

    Args:
        spec: The robot. robot: Its model.
        config: Of the controller, whose friction and least contact forces plans count on.

    Attributes:
        hand_limits: What the left and the right hand can do.
        optimizer: The whole-body trajectory optimiser.
        offsets: Palm points in the axes of the wrists, shape (2, 3), [m].
        centroidal, effort: What the whole curve of a trajectory is judged by.
    """

    def __init__(self, spec: RobotSpec, robot: Robot, config: ControllerConfig) -> None:
        self._settings, self._loads, self._loaded = config, (0.0, 0.0), False
        self.spec, self.config, self._budget, self.model = spec, config.planner, config.planning.budget, robot.model
        self.optimizer = TrajectoryOptimizer(spec, self.config.posture, config.friction, config.force_min)
        self._friction, self._holdable = config.friction, None
        self._apart = HandsApart(HandHulls(spec, self.optimizer.body))
        self.balance = ContactFeasibility(self.optimizer.body, config.friction)
        self.effort = Effort(self.optimizer.body)
        self.palm_ids = [robot.frame_id(tool.palm_frame) for tool in spec.tools]
        self.centroidal = Centroidal(spec, self.model, [robot.frame_id(x) for x in (spec.base_body, spec.torso_body)])
        self.offsets = palm_offsets(spec)
        low, high = spec.position_min, spec.position_max
        fingers = [spec.indices(tool.finger_joints) for tool in spec.tools]
        self.hand_limits = tuple(HandLimits.of_fingers(low[i], high[i]) for i in fingers)

    def carry(self, loads: Loads, torques: np.ndarray | None = None) -> None:
        """Plan with these masses in the hands and shares (n_joints,) of the motors' torques, all if None, from now on.

        Bounds hold with the reserve, centres are without it.
        """
        weak = torques is not None and bool((torques < 1.0).any())
        self._loads, self._loaded = loads.most, weak or max(loads.masses) > 0.0
        self.optimizer.body.weaken(torques)
        self.optimizer.body.carry(loads.most)
        self.centroidal.carry(loads.masses)

    def stand_on(self, contacts: ContactSchedule) -> None:
        """Plan with the feet there from now on; an `InputError` for a schedule in which one steps."""
        if not contacts.same(self.optimizer.body.footing.contacts):
            self.optimizer.stand_on(contacts)
            # The support may have another number of edges.
            self._holdable, self.balance = None, ContactFeasibility(self.optimizer.body, self._friction)

    def plan(
        self,
        chunk: ActionChunk,
        now: float,
        start: BodyState,
        commanded: HandMotion,
        before: np.ndarray | None = None,
        cpu_limit: float = inf,
        *,
        quick: bool = False,
        hold: bool = False,
    ) -> ChunkPlan:
        """Plan the rest of a chunk, within the budget of linearisations and steps of the settings.

        It counts on the forces that the chunk tells the hands; on none where no plan does that leaves them in place.

        Args:
            chunk: A valid chunk.
            now: Present time [s].
            start: Where the body's trajectory is now.
            commanded: What the two hands are commanded to do now, rows (2, 40).
            before: What the plan before would have done from now on, configurations one knot apart, shape (k, nq), the
                first one a knot from now; the search begins with it where both plans agree.
            cpu_limit: CPU time of this thread in which the plan is wanted [s]; with it, plans depend on the machine.
            quick: Take the first safe motion near the chunk at its own speed.
            hold: Lead hands to where a still robot holds what they carry, if they cannot be where the chunk has them.
        """
        modes, prepared = Modes(hold and self._loaded, self._loaded), self._prepared(chunk)
        budget = Budget(self._budget, SEARCH_SHARE * cpu_limit)
        targets, attempt, asked = self._search(prepared, now, start, commanded, before, budget, modes)
        chosen = self._preview(targets(1.0), start, modes) if quick and not prepared.implausible else None
        chosen = chosen or choice.best(self.config, attempt, budget, asked)
        moves = chosen.tracking_error > self.config.clamp_tolerance or not chosen.is_safe(self.config)
        if chosen.knots.pushes is not None and moves:
            untold, start = replace(chunk, f_world_lpalm=None, f_world_rpalm=None), replace(start, pushes=np.zeros(6))
            return self.plan(untold, now, start, commanded, before, cpu_limit, quick=quick, hold=hold)
        return self._as_followed(chosen, prepared, now, commanded, budget)

    def previewed(self, chunk: ActionChunk, now: float, start: BodyState, commanded: HandMotion) -> ChunkPlan | None:
        """What `plan` answers, where that is quick, may hold, and a preview decides; else None."""
        modes, prepared = Modes(self._loaded, self._loaded), self._prepared(chunk)
        targets = self.targets(prepared, now, commanded, 1.0)
        chosen = None if prepared.implausible else self._preview(targets, start, modes)
        return chosen and self._as_followed(chosen, prepared, now, commanded, Budget(self._budget))

    def as_given(
        self, chunk: ActionChunk, now: float, start: BodyState, commanded: HandMotion, work: float = inf
    ) -> ChunkPlan | None:
        """What `plan` answers, where that is quick and an attempt follows the chunk within some work; else None."""
        modes, prepared = Modes(self._loaded, self._loaded), self._prepared(chunk)
        budget = Budget(min(self._budget, work))
        if prepared.implausible:
            return None
        targets, attempt, asked = self._search(prepared, now, start, commanded, None, budget, modes)
        chosen = self._preview(targets(1.0), start, modes)
        chosen = chosen or choice.as_given(self.config, attempt, budget, asked)
        return chosen and self._as_followed(chosen, prepared, now, commanded, budget)

    def previews(self, chunk: ActionChunk, now: float, start: BodyState, commanded: HandMotion, far: float) -> bool:
        """Whether a preview follows the chunk, no step of which is changed by more than ``far`` [m] before it."""
        modes, prepared = Modes(self._loaded, self._loaded), self._prepared(chunk)
        targets = self.targets(prepared, now, commanded, 1.0)
        changed = np.append(prepared.lift + prepared.moved + targets.projected, prepared.turned)
        return bool(changed.max() <= far) and self._preview(targets, start, modes) is not None

    def _prepared(self, chunk: ActionChunk) -> PreparedChunk:
        return prepare(chunk, self.hand_limits, self.optimizer.body.footing.floor.rise)

    def _search(
        self,
        prepared: PreparedChunk,
        now: float,
        start: BodyState,
        commanded: HandMotion,
        before: np.ndarray | None,
        budget: Budget,
        modes: Modes,
    ) -> tuple[Callable[[float], Targets], Try, Asked]:
        """What a prepared chunk asks for at a speed, what plans it by a strategy, and what strategies are chosen by."""

        @cache
        def targets(slowdown: float) -> Targets:
            return self.targets(prepared, now, commanded, slowdown)

        @lru_cache(maxsize=1)
        def held(slowdown: float) -> HoldablePath:
            return self._held(targets(slowdown), start.q, budget)

        @cache
        def overlap(slowdown: float) -> Overlap:
            return self._overlap(targets(slowdown))

        def lacking(slowdown: float) -> float:
            return held(slowdown).off if modes.holding else 0.0

        def attempt(strategy: Strategy, slowdown: float, last: np.ndarray | None) -> Attempt:
            first = {BeginAt.PLAN_BEFORE: before, BeginAt.LAST_ATTEMPT: last, BeginAt.START: None}[strategy.begin]
            path = held(slowdown) if strategy is HOLDABLE else None
            nonlocal modes
            one = self._attempt(targets(slowdown), start, strategy, first, budget, modes, path)
            # What one attempt needs, the next ones will.
            modes = modes._replace(strained=modes.strained or one.knots.between)
            return one

        return targets, attempt, Asked(prepared.implausible, overlap, lacking)

    def _as_followed(
        self, chosen: Attempt, prepared: PreparedChunk, now: float, commanded: HandMotion, budget: Budget
    ) -> ChunkPlan:
        """An attempt as it is followed: hands led along it where it does not reach the targets."""
        paths, moved = clamped(chosen, self.config, self.optimizer.palms, self.offsets)
        elsewhere, distance = prepared.begins_elsewhere(now, commanded), prepared.distance_at(now, commanded)
        changed = changes(chosen, prepared, moved, self.config, elsewhere=elsewhere, distance=distance)
        report = self._report(chosen, changed, budget, implausible=prepared.implausible)
        steps, contacts = chosen.targets.steps, self.optimizer.body.footing.contacts
        return ChunkPlan(paths, chosen.trajectory, float(steps[0]), float(steps[-1]), report, chosen.knots, contacts)

    def _preview(self, targets: Targets, start: BodyState, modes: Modes) -> Attempt | None:
        """Postures from knot to knot and a step from there, if that is safe and nearer than what is left to the QP."""
        # Where the map has great odds against the palms a preview would be in vain.
        out = self.map is not None and self.map.surely_out(targets.T_palms[:, :, :3, 3], self._loads)
        if targets.projected.max() > JUMP or out:
            return None
        one = self._attempt(targets, start, PREVIEW, None, Budget(PREVIEW_WORK), modes)
        near = one.tracking_error <= self.config.clamp_tolerance and one.arms_spent <= ARMS_SPENT_MAX
        return one if near and one.is_safe(self.config) else None

    @cached_property
    def map(self) -> ReachabilityMap | None:
        """Map of this robot with these bounds, if there is one."""
        return map_for(basis(self.spec, self._settings))

    def _report(
        self, chosen: Attempt, changed: dict[Reason, PlanChange], budget: Budget, *, implausible: bool
    ) -> PlanReport:
        footing = self.optimizer.body.footing
        return PlanReport(
            steps=chosen.targets.steps,
            tracking_error=chosen.distance,
            slowdown=chosen.targets.slowdown,
            zmp_margin=np.min(footing.pressure_offsets - chosen.knots.zmp @ footing.support.normals.T, axis=1),
            changes=changed,
            strategy=chosen.strategy,
            violation=chosen.violation,
            safe=chosen.is_safe(self.config),
            work=budget.spent,
            timed_out=budget.timed_out,
            implausible=implausible,
        )

    def targets(self, prepared: PreparedChunk, now: float, commanded: HandMotion, slowdown: float) -> Targets:
        """Targets of a prepared chunk at one speed; slower paths begin faster per parameter: nothing jumps."""
        paths, projected = prepared.paths(now, commanded, slowdown)
        begin, dt = now - prepared.chunk.t_obs, self.config.posture.dt / slowdown
        # Until the body is at rest after the hands' end.
        end = max(begin, *(path.span[1] for path in paths)) + self.config.settle / slowdown
        steps = begin + dt * np.arange(int(np.ceil((end - begin) / dt)) + 1)
        motions = [path.sample(steps) for path in paths]
        T_palms = palm_poses(np.stack([motion.T_world_hand for motion in motions], axis=1), self.offsets)
        fingers = [m.q_finger[:, : len(tool.finger_joints)] for m, tool in zip(motions, self.spec.tools, strict=True)]
        own = int(np.searchsorted(steps, prepared.times[-1], "right"))
        pushes = prepared.pushes(steps, T_palms[:, :, :3, 3], self.optimizer.body)
        return Targets(slowdown, paths, projected, steps, T_palms, np.hstack(fingers), own, pushes)

    def _attempt(
        self,
        targets: Targets,
        start: BodyState,
        strategy: Strategy,
        first: np.ndarray | None,
        budget: Budget,
        modes: Modes,
        held: HoldablePath | None = None,
    ) -> Attempt:
        """The targets planned for by one strategy, its search begun with configurations ``first`` (k, nq) if given."""
        slowdown, body = targets.slowdown, self.optimizer.body
        warm_start, wanted = first, targets.T_palms
        if first is not None:
            warm_start = first[: targets.near(self.optimizer.palms(first), self.config.warm_start_distance)]
        if held is not None:
            wanted, warm_start = held.T_palms, held.blended(body, start.q, self.config.posture.dt)
        if strategy.name == PARTED.name:
            wanted = self._apart.parted(targets.T_palms, targets.q_fingers)
        weights, search = strategy.weights(self.config), (start.q, start.v, wanted, targets.q_fingers)
        pushes = start.counted(targets.pushes, self.config.posture.dt)
        knots = self.optimizer.plan_against(pushes, *search, warm_start, weights, budget, between=modes.strained)
        curve, centroidal, strain = self._followed(knots, targets, start)
        worth = strategy is not PREVIEW and targets.off(knots.T_palms).max() <= self.config.unreachable
        if strain > 1.0 and worth and not knots.between:
            knots = self.optimizer.plan_against(pushes, *search, knots.q[1:], weights, budget, between=True)
            curve, centroidal, strain = self._followed(knots, targets, start)
        return Attempt(
            strategy=strategy.name,
            targets=targets,
            knots=knots,
            distance=targets.off(knots.T_palms),
            curve=curve,
            centroidal=centroidal,
            drift=self.balance.capture_point_drift(centroidal, slowdown),
            deficit=self.balance.friction_impulse_deficit(centroidal, slowdown),
            warm_started=warm_start is not None and len(warm_start) > 0,
            strain=strain,
            arms_spent=arms_spent(body, body.body_of(knots.q[-KNOTS_AT_REST:])) if modes.holding else 0.0,
        )

    def _followed(self, knots: KnotTrajectory, targets: Targets, start: BodyState) -> Followed:
        """The curve of a motion from a start, where the mass goes along it, and the torques that it asks for."""
        steps, step = targets.steps, targets.steps[1] - targets.steps[0]
        curve = curve_through(steps, knots.q, targets.slowdown * start.v)
        track = centroidal_along(curve, steps[0], steps[-1] + step, self.centroidal).pushed(steps, knots)
        return curve, track, self.effort.strain(track, targets.slowdown, step)

    def _overlap(self, targets: Targets) -> Overlap:
        T_palms, fingers, n = targets.T_palms, targets.q_fingers, targets.asked
        near = Overlap.IN_THE_WAY if self._apart.overlap(T_palms[:n], fingers[:n]) else Overlap.TOLERATED
        return Overlap.NONE if self._apart.parted(T_palms, fingers) is None else near

    def _held(self, targets: Targets, q: np.ndarray, budget: Budget) -> HoldablePath:
        """Where a still robot holds what the hands carry, seen from a configuration (nq,)."""
        body = self.optimizer.body
        self._holdable = self._holdable or HoldablePlaces(body, self.config.posture)
        return self._holdable.near(targets.T_palms, targets.q_fingers, body.body_of(q), budget)
