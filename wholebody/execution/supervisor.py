"""Between chunk and joint command: refuse, contain, slow down, hold, and keep the balance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from models.spec import RobotSpec
from policy.chunk import ActionChunk
from wholebody.backends.registry import make_controller
from wholebody.config import ControllerConfig
from wholebody.control.motor_watch import MotorWatch
from wholebody.execution import standing, statuses
from wholebody.execution.ahead.hands_ahead import HandsAhead
from wholebody.execution.ahead.ready import ReadyBody
from wholebody.execution.background_planner import BackgroundPlanner, Compute, PlanAnswer, PlanRequest, SimulatedPlanner
from wholebody.execution.carrying import Carrying
from wholebody.execution.ending.falling import Falling
from wholebody.execution.ending.lowering import Lowering
from wholebody.execution.ending.stiff_legs import StiffLegs
from wholebody.execution.feet.commands import Commands
from wholebody.execution.feet.elsewhere import ends
from wholebody.execution.feet.stepping import Stepping
from wholebody.execution.gate import Gate, gated, why_not
from wholebody.execution.handover import Handover, Takeover, ends_at_rest
from wholebody.execution.kernels.plan_follower import TRUST_MIN
from wholebody.execution.plan_follower import PlanFollower
from wholebody.execution.planted_feet import PlantedFeet
from wholebody.execution.state_monitor import GO_ON, StateMonitor
from wholebody.execution.states import Event, Machine, State
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.planning.plan import ChunkPlan
from wholebody.planning.trajectory import SampledTrajectory
from wholebody.reference import ReferenceSmoother
from wholebody.types import JointCommand, Reason, RobotState, StatusReport, check_state

RETRY = 0.2
"""Time from one attempt to join a chunk, or to stand off the plan, to the next [s]; chosen: twice the default
`planning.lead`."""


class Supervisor(Commands):
    """Owns planner and controller; the only thing a runtime talks to.

    `accept` takes chunks as they come, `step` answers every control period. Neither raises on bad input: a chunk that
    cannot be used is refused with a reason and the robot goes on, or holds. A plan is computed beside the control loop,
    from where the present one will be when it takes over; the present one ends balanced and at rest.

    Args:
        spec: The robot.
        config: Settings; the defaults if not given.
        planner: Makes who plans beside the loop from a function that plans; simulated if not given.
        gate: Judges each chunk by its plan there; what it does not clear is rejected.

    Attributes:
        chunk: The chunk that is being followed, or None. plan: Its plan.
        handover: The plan on its way, and how many came too late. carrying: What the hands carry.
        monitor: Says which states are used. touch: What the hands touch. motors: How they answer.
    """

    def __init__(
        self,
        spec: RobotSpec,
        config: ControllerConfig | None = None,
        *,
        planner: Callable[[Compute], BackgroundPlanner] | None = None,
        gate: Gate | None = None,
    ) -> None:
        self.spec, self.config = spec, config or ControllerConfig()
        self.controller = make_controller(spec, self.config)
        self.robot = self.controller.robot
        self.planner = ChunkPlanner(spec, self.robot, self.config)
        planning = self.config.planning
        compute = gated(lambda request: request.plan_with(self.planner), gate)
        beside = SimulatedPlanner(compute, planning) if planner is None else planner(compute)
        self.handover, self._gated = Handover(beside, planning, self.config.dt), gate is not None
        self.carrying, self._legs = Carrying(self.controller, self.config), StiffLegs(spec)
        self.monitor, self.motors = StateMonitor(self.robot, self.config.dt), MotorWatch(self.controller)
        self._planted, self._states = PlantedFeet(self.controller), Machine(State.NEW)
        self.touch, self.contacts = self.carrying.touch, self._planted.contacts
        self._forget(0.0)

    def _forget(self, now: float) -> None:
        """Nothing is planned, refused or waiting."""
        self.status, self.last_tick = statuses.NO_CHUNK, None
        self._now, self._retry, self._chunk_end = now, now, 0.0
        self.plan = self.plan_report = self.chunk = self._newest = self._waiting = None
        self._refused = self._refusal = None
        self.handover.reset()

    def reset(self, state: RobotState, now: float | None = None) -> None:
        """Start an episode, now [s], from a measured state of standing; `InputError` if it is none of this robot."""
        check_state(state, self.robot.n_joints)
        for part in (self.carrying, self.motors, self._legs):
            part.reset()
        self.controller.reset(state)
        self.contacts = self._planted.reset(state)
        self.monitor.reset(state, now)
        trajectory, rows = SampledTrajectory.still(self.robot, state.q), standing.hands_at_rest(self.robot, state.q)
        self._smoother = ReferenceSmoother(rows, [limits.outer for limits in self.planner.hand_limits])
        self._follower = PlanFollower(self.controller, self.config, trajectory, self._smoother, rows, touch=self.touch)
        owned = self._follower, self._smoother, self._planted, self._states
        self._reflex = standing.Reflex(self.controller, self.config, *owned)
        ready = ReadyBody(self.controller, self._planted)
        hands = self._smoother, self.planner.hand_limits, self.touch
        self._ahead = HandsAhead(self._follower, *hands, ready, gated=self._gated)
        self._lowering = Lowering(self.controller, self._reflex, self._planted, self._states)
        self._stepping = Stepping(self.controller, self.config, *owned, self._reflex, self.planner.hand_limits)
        self._falling = Falling(self.controller, self.monitor, self._planted, self._stepping, self._states)
        self._states.on(Event.RESET)
        self._last_state = self.monitor.clock.placed(state)
        self._forget(self.monitor.clock.now)

    def accept(self, chunk: ActionChunk, now: float | None = None) -> StatusReport:
        """Take a chunk, or refuse it with a reason; a refused chunk changes nothing.

        Its plan is computed beside the loop; what then speaks against the chunk is in `take_refusal`. A chunk that
        cannot be joined yet is tried again until it is, is over, or another one comes.

        Args:
            chunk: What the hands are to do.
            now: Present time on the clock of its observation [s]; that of the last `step` if not given.

        Raises:
            StateError: Before the first `reset`.
        """
        self._following()
        if now is not None and not np.isfinite(now):
            return self._refuse(statuses.refused(Reason.CLOCK_INVALID, f"the present time is {now}"))
        if self._lowering.active:
            return statuses.refused(self.status.reason, f"{self.status.detail}; chunks are followed after `raise_`")
        chunk, shift = self.monitor.clock.chunk(chunk), self.monitor.clock.shift
        now = self._now if now is None else now - shift
        if (fault := statuses.chunk_fault(chunk, self._newest, now, self.spec)) is not None:
            return self._refuse(fault)
        self._newest, self._refusal = chunk, None
        if self._walks_with(chunk):
            return self.status
        self._ahead.offer(chunk, self.plan, self._now, waits=self.handover.busy)
        stays = self._reflex.active and self._ahead.streams  # off its plan, whatever a stream says meanwhile
        self._waiting, self._retry = chunk, self._retry if stays else self._now
        self._try_waiting(self._now)
        plan = None if self.handover.busy else self.plan
        return self.take_refusal() or (statuses.plan_status(plan.report, self.rate) if plan else statuses.TRACKING)

    def take_refusal(self) -> StatusReport | None:
        """Why the chunk that was accepted last is not followed after all, said once; None if there is nothing."""
        refusal, self._refusal = self._refusal, None
        return refusal

    def _try_waiting(self, now: float) -> None:
        """Ask for a plan of the chunk that is waiting, unless it is over or another plan is on its way."""
        chunk = self._waiting
        if chunk is None or self.handover.busy or now < self._retry or self._stepping.coming:
            return
        self._waiting = None
        if chunk.end > now:
            self._ask(chunk)
        else:
            self._go_back()

    def _ask(self, chunk: ActionChunk) -> None:
        """Have a chunk planned from where the robot will be once the lead is over; its plan is to last until then."""
        self._retry, ticks, follower = self._now + RETRY, self.handover.ticks, self._follower
        state, due = self._last_state, self._now + ticks * self.config.dt
        late = self.handover.is_slow and self.plan is not None and chunk is not self.chunk and not self._ahead.fast
        follower.stretch(due - self._now if late else 0.0)
        start = self._reflex.foreseen(state, ticks) if self._reflex.active else follower.foreseen(ticks, state)
        if self.plan is not None:
            start = replace(start, body=replace(start.body, pushes=self.plan.pushes_at(start.s)))
        # On its plan, the robot only asks whether there is a quicker one by now.
        ahead = self.plan is not None and self._follower.s < self.plan.end
        changed = self.carrying.changed or self.motors.weaker
        again = ahead and chunk is self.chunk and self._follower.trust == 1.0 and not changed
        before = None if self.plan is None else self.plan.rest(start.s, start.rate, self.config.planner.posture.dt)
        self.contacts, loads, torques = self._planted.planned(state), self.carrying.planned(), self.motors.planned()
        wanted = PlanRequest(chunk, self._now, due, start, before, again, contacts=self.contacts)
        walks = self.config if self._stepping.may_walk_for(chunk) and not (self._gated or self.touch.active) else None
        self.handover.ask(replace(wanted, loads=loads, surfaces=self.touch.met(), torques=torques, walks=walks))
        self._exchange(self._now)

    def _exchange(self, now: float) -> None:
        """Judge a plan that has come, and take one over that is due; a chunk whose plan came too late waits again."""
        handover, follower, late = self.handover, self._follower, self.handover.late
        if (answer := handover.collect(now, self._now)) is not None:
            handover.settle(answer.request, self._cleared(answer), self._waiting, self._now)
        if (taken := handover.take(self._now, None if self.plan is None else follower.s, follower.rate)) is not None:
            self._take_over(taken)
        if (dropped := handover.take_dropped()) is not None:
            if handover.late > late:  # a base that is found never comes too late
                self._stepping.beyond = ends(dropped)
            self._waiting, self._retry = self._waiting or dropped, self._now
        if self._gated and handover.late > late:
            self._refuse(statuses.GATE_LATE)

    def _cleared(self, answer: PlanAnswer) -> ChunkPlan | None:
        """The plan that has come, to be followed in its time; None where it is not, and its chunk is refused."""
        request, plan, chunk = answer.request, answer.plan, answer.request.chunk
        if answer.elsewhere is not None:
            self._walk_for(answer.elsewhere)
            if not self._stepping.coming:  # planned from here
                self._stepping.beyond, self._waiting = ends(chunk), self._waiting or chunk
            return None
        if request.walks is not None and plan is not None and Reason.OUT_OF_REACH in plan.report.changes:
            self._stepping.beyond = ends(chunk)
        if plan is None:
            self._refuse_planned(chunk, why_not(answer))
            if self._reflex.active:
                self._waiting = self._waiting or chunk
            self._go_back()
            return None
        balanced = plan.report.safe and ends_at_rest(plan, self.controller.support, self.config.safety.balance_margin)
        if not balanced or plan.report.hindered:
            self._waiting = self._waiting or chunk
        followed = self.plan_report if request.again else None
        if followed is not None and not (balanced and plan.report.quicker(followed)):
            return None
        if not balanced:
            self._refuse_planned(chunk, statuses.NOT_JOINED)
            self._go_back()
        return plan if balanced else None

    def _take_over(self, taken: Takeover) -> None:
        """Follow a plan whose time has come, unless the robot, off its last one, is not where it begins."""
        if self._reflex.is_elsewhere(self._last_state, taken.plan.trajectory.q[0]):
            self._waiting, self._retry = self._waiting or taken.chunk, self._now
            return
        self.plan, self._refused, last = taken.plan, None, 0.0
        self._states.on(Event.TAKEN_OVER)
        self._reflex.end()
        if told := not standing.is_hold(taken.chunk):
            self.chunk, self.plan_report, self._chunk_end = taken.chunk, taken.plan.report, float(taken.chunk.times[-1])
            last = self._chunk_end - taken.chunk.t_obs
            self.touch.expect(taken.chunk)
        self._follower.begin(taken.plan, last, beyond=taken.beyond, speed_fraction=taken.speed_fraction)
        self._ahead.begin(taken.chunk, taken.plan, self._now, cleared=told)

    def _stand(self) -> None:
        """Follow no plan: stand, until there is one from there."""
        self.handover.cancel()
        self._ahead.end(None)
        self.plan, self._waiting = None, self._waiting or self._newest
        self._retry = self._now + self._reflex.stand(self._last_state, self._now)

    def _go_back(self) -> None:
        """Where no plan leads on, towards the stance, until one is asked for again."""
        if self.plan is None and self._reflex.is_away(self._last_state):
            self._retry = self._now + self._reflex.go_back(self._last_state)

    def step(self, state: RobotState, now: float | None = None) -> JointCommand:
        """Command for one control period.

        Args:
            state: As measured, carried on over its age; one that cannot be used is bridged, the reason in `status`.
            now: Present time on the clock of the states [s]; the state's own if not given.

        Raises:
            StateError: Before the first `reset`.
        """
        follower = self._following()
        ahead = self.motors.arrival(0.0)
        state, elapsed, fault = self.monitor.seen(state, now, self.last_tick, ahead)
        measured, blind = self.monitor.clock.now, self.monitor.bridged > GO_ON
        now = measured + ahead
        if (let_down := self._falling.command(state, blind)) is not None:
            self._now, self._last_state, self.status = now, state, self._falling.status
            self.handover.cancel()
            return let_down
        stepping = self._look_at_feet(state, now, blind)
        led = not (blind or self._lowering.active or stepping.coming)
        if not led:
            self.handover.cancel()
        self._exchange(now)
        follows = not (self._reflex.active or stepping.active)
        self.touch.asked.counted[:] = 0.0 if self.plan is None else self.plan.pushes_at(follower.s).reshape(2, 3)
        self.carrying.look(state, follower.row, elapsed, self.monitor.age, follows)
        self.motors.look(self.monitor.fresh, measured)
        if led:
            self._keep_planning()
        self._reflex.advance(elapsed)
        self._ahead.advance(elapsed)
        self._lowering.look(state)
        self._last_state, self._now = state, max(now, self._now)
        reference = follower.reference(state.q, elapsed, allowed=0.0 if blind else stepping.allowed)
        if stepping.active:
            reference, self.contacts = stepping.reference(state, elapsed, now), stepping.contacts
        command, self.last_tick = self.controller.step(state, reference, elapsed)
        off_plan = self._reflex.status if self._reflex.active else stepping.status if stepping.active else None
        seen = self._seen(self.last_tick, off_plan)
        self.status = fault or (seen if self._lowering.active else self.touch.status(seen))
        self.controller.command = self._legs.stiffened(
            command, (blind and not stepping.active) or self._lowering.stays, elapsed
        )
        return self.controller.command

    def _keep_planning(self) -> None:
        """Stand where the plan is lost; ask for the plan that is wanted now."""
        follower = self._follower
        if (self.carrying.changed or self.motors.weaker) and not self.handover.busy:
            self._waiting = self._waiting or standing.to_hold(self._newest, self._smoother.motion, self._now)
        lost = follower.trust <= TRUST_MIN or (follower.trust < 1.0 and follower.near_edge)
        if self.plan is not None and (lost or follower.sinks or self._ahead.is_lost):
            self._stand()
        elif self.plan is not None and follower.trust < 1.0 and not self.handover.busy:
            self._waiting = self._waiting or self._newest
        self._try_waiting(self._now)

    def _refuse(self, refusal: StatusReport) -> StatusReport:
        self._refused = self.status = refusal
        return refusal

    def _refuse_planned(self, chunk: ActionChunk, refusal: StatusReport) -> None:
        """Refuse a chunk that had been accepted: the one that is followed counts as the last one again."""
        self._refuse(refusal)
        self._ahead.end(self.plan)
        if chunk is self._newest:
            self._newest, self._refusal = self.chunk, refusal
