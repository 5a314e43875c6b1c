"""Between chunk and joint command: refuse, contain, slow down, hold, and stay on one's feet."""

from __future__ import annotations

import logging

import numpy as np

from models.spec import RobotSpec
from policy.chunk import ActionChunk
from policy.errors import ChunkError
from wholebody.backends.registry import make_controller
from wholebody.config import ControllerConfig
from wholebody.control.tick_report import TickLevel, TickReport
from wholebody.errors import InputError, PlanningError, StateError
from wholebody.execution.fallback import damping_command, held_command, standing_command
from wholebody.execution.plan_follower import PlanFollower
from wholebody.execution.standing import hands_as_measured, hands_at_rest, standing_plan
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.planning.plan import ChunkPlan, PlanReport
from wholebody.planning.trajectory import BodyState, SampledTrajectory
from wholebody.reference import HandMotion, ReferenceSmoother
from wholebody.robot.standing import has_lost_standing
from wholebody.types import JointCommand, Reason, RobotState, Status, StatusReport, check_state

RETRY = 0.2
"""Time from one attempt to join a chunk to the next [s]."""

TRACKING = StatusReport(Status.TRACKING)
"""Nothing to say."""
NO_CHUNK = StatusReport(Status.HOLD, Reason.NO_CHUNK, "no chunk yet: holding the stance")
STARVED = StatusReport(Status.HOLD, Reason.STARVED, "the chunk is over: holding its end")

logger = logging.getLogger(__name__)


class Supervisor:
    """Owns planner and controller; the only thing a runtime talks to.

    `accept` takes chunks as they come, `step` answers every control period. Neither raises on bad input: a chunk that
    cannot be used is refused with a reason code and the robot goes on, or holds. Both raise `StateError` before the
    first `reset`.
    """

    def __init__(self, spec: RobotSpec, config: ControllerConfig | None = None) -> None:
        self.spec, self.config = spec, config or ControllerConfig()
        self.controller = make_controller(spec, self.config)
        self.robot = self.controller.robot
        self.planner = ChunkPlanner(spec, self.robot, self.config)
        self._smoother: ReferenceSmoother | None = None
        self._follower: PlanFollower | None = None
        self._last_state: RobotState | None = None
        self._last_command: JointCommand | None = None
        self._forget()

    def _forget(self) -> None:
        """Nothing is planned, refused or waiting."""
        self.status = NO_CHUNK
        self.plan_report: PlanReport | None = None
        self.last_tick: TickReport | None = None
        self._plan: ChunkPlan | None = None
        self._chunk: ActionChunk | None = None
        self._chunk_end = 0.0
        self._fallen = False
        self._refused: StatusReport | None = None
        self._waiting: ActionChunk | None = None
        self._retry = 0.0

    def reset(self, state: RobotState) -> None:
        """Start an episode from a measured state of standing.

        Raises:
            InputError: If the state is not a finite state of this robot.
        """
        check_state(state, self.robot.n_joints)
        self.controller.reset(state)
        trajectory, rows = SampledTrajectory.still(self.robot, state.q), hands_at_rest(self.robot, state.q)
        self._smoother = ReferenceSmoother(rows, [caps.outer for caps in self.planner.hand_limits])
        self._follower = PlanFollower(self.controller, self.config, trajectory, self._smoother, rows)
        self._last_state, self._last_command = state, standing_command(self.spec, self.robot, state)
        self._forget()

    def _following(self) -> PlanFollower:
        """The follower of this episode.

        Raises:
            StateError: Before the first episode.
        """
        if self._follower is None:
            raise StateError("the supervisor has no state yet: call `reset` with a measured state of standing first")
        return self._follower

    @property
    def time_factor(self) -> float:
        """Time spent on chunks over chunk time covered; 1 is unslowed."""
        return self._following().time_factor

    @property
    def chunk(self) -> ActionChunk | None:
        """The chunk that was accepted last."""
        return self._chunk

    def palm_reference(self) -> dict[str, np.ndarray]:
        """Commanded palm poses in world, 4x4, by side."""
        left, right = self._following().palm_poses()
        return {"left": left, "right": right}

    def ahead(self, times: np.ndarray) -> tuple[HandMotion, HandMotion] | None:
        """What both hands will be commanded at times near the present, as planned and at the present speed.

        Args:
            times: Shape (n,), [s]; past the end of the plan its last pose is held.

        Returns:
            Rows (n, 40) a hand, derivatives with respect to the path; None before the first chunk.
        """
        if self._plan is None:
            return None
        follower = self._follower
        s = follower.s + follower.rate * (np.asarray(times) - self._last_state.time)
        left, right = (path.sample(np.clip(s, self._plan.start, self._plan.end)) for path in self._plan.paths)
        return left, right

    def accept(self, chunk: ActionChunk) -> StatusReport:
        """Take a chunk, or refuse it with a reason; a refused chunk changes nothing.

        A chunk that cannot be joined yet is tried again until it is, is over, or another one comes.

        Raises:
            StateError: Before the first `reset`.
        """
        self._following()
        now, self._waiting = self._last_state.time, None
        try:
            chunk.validate(after=self._chunk)
        except (ChunkError, ValueError) as error:
            return self._refuse(Reason.CHUNK_INVALID, str(error))
        if chunk.times[-1] <= now:
            age = now - chunk.t_obs
            return self._refuse(Reason.CHUNK_STALE, f"the chunk's last step is over: it is {age:.2f} s old")
        if chunk.t_obs > now + 1.0 / chunk.fps:
            return self._refuse(Reason.CHUNK_FROM_FUTURE, f"t_obs {chunk.t_obs:.3f} s is after now, {now:.3f} s")
        return self._join(chunk)

    def _join(self, chunk: ActionChunk) -> StatusReport:
        """Follow a valid chunk from here on, if that is safe; what cannot be joined yet waits."""
        now, self._waiting = self._last_state.time, None
        self._retry, reference = now + RETRY, self._smoother.state.copy()
        # On its plan, the robot only asks whether there is a quicker one by now.
        again = chunk is self._chunk and self._is_safe_ahead() and self._follower.trust == 1.0
        try:
            start, before = self._start()
            commanded = HandMotion(self._smoother.motion.rows.copy())
            plan = self.planner.plan(chunk, now, start, commanded, before)
        except (InputError, PlanningError) as error:
            logger.warning("no plan for chunk %d at %.3f s", chunk.seq, now, exc_info=True)
            self._smoother.state[:] = reference
            return self._refuse(Reason.PLANNING_FAILED, str(error))
        if not plan.report.safe or plan.report.hindered:
            self._waiting = chunk
        if again and not plan.report.quicker(self.plan_report):
            self._smoother.state[:] = reference
            return self.status
        if not plan.report.safe and self._is_safe_ahead():
            self._smoother.state[:] = reference
            return self._refuse(
                Reason.NOT_JOINED,
                "no balanced motion leads from here to the chunk yet, so the one before is followed to its end: "
                "a chunk that begins nearer to the hands, or slower, would be joined at once",
            )
        if not plan.report.safe and self._lost():
            middle, hands = self.planner.optimizer.body.tables.com_stance, self._measured_hands()
            plan = standing_plan(plan, self.robot, self._last_state.q, middle, hands)
        self._plan, self._chunk, self._refused = plan, chunk, None
        self.plan_report = plan.report
        self._chunk_end = float(chunk.times[-1])
        self._follower.begin(plan, self._chunk_end - chunk.t_obs)
        return self._report_plan(plan.report)

    def _is_safe_ahead(self) -> bool:
        """Whether the present plan is balanced, not over, and near enough to come back to."""
        plan, far = self._plan, self.config.safety.posture_stop
        near = self._follower.distance(self._last_state.q) < far
        return plan is not None and plan.report.safe and self._follower.s < plan.end and near

    def _start(self) -> tuple[BodyState, np.ndarray | None]:
        """Where the next plan begins, and what the present one would have done from now on.

        A plan continues the one before, so that nothing jumps; a robot that has left its plan is planned from where it
        is. The rest of the plan is configurations one step of the posture plan apart.
        """
        state = self._last_state
        if self._lost():
            self._smoother.reset(self._measured_hands())
            return BodyState(state.q.copy(), state.v.copy()), None
        if self._plan is None:
            return self._follower.planned, None
        track, clock = self._plan.trajectory, self._follower
        step = clock.rate * self.config.planner.posture.dt
        s = clock.s + step * np.arange(1.0, 1.0 + (self._plan.end - clock.s) / max(step, 1e-3))
        return self._follower.planned, track.q[[track.row(x) for x in s]]

    def _measured_hands(self) -> np.ndarray:
        return hands_as_measured(self.robot, self._smoother.motion.rows)

    def _lost(self) -> bool:
        """Whether the robot has left its plan."""
        return self._follower.distance(self._last_state.q) > self.config.safety.posture_lost

    def step(self, state: RobotState) -> JointCommand:
        """Command for one control period.

        Raises:
            StateError: Before the first `reset`.
        """
        follower = self._following()
        try:
            check_state(state, self.robot.n_joints)
        except InputError as error:
            self.status = StatusReport(Status.HOLD, Reason.STATE_INVALID, str(error))
            return held_command(self._last_command, self._last_state.time)
        self._last_state = state
        if self._fallen or has_lost_standing(state):
            self._fallen = True
            self.status = StatusReport(
                Status.DAMPING, Reason.STANDING_LOST, "the robot is no longer standing: joints damped"
            )
            return damping_command(self.spec, self.robot, state)
        if follower.trust < 1.0 and self._waiting is None:
            self._waiting = self._chunk
        if self._waiting is not None and state.time >= self._retry:
            self._try_again()
        self._last_command, self.last_tick = self.controller.step(state, follower.reference(state.q))
        self._judge()
        return self._last_command

    def _try_again(self) -> None:
        """Join the chunk that is waiting, unless it is over."""
        if self._waiting.times[-1] > self._last_state.time:
            self._join(self._waiting)
        else:
            self._waiting = None

    def _judge(self) -> None:
        """Status after a tick, worst first."""
        if self.last_tick.level is TickLevel.FAILED:
            self.status = StatusReport(Status.STOP, Reason.QP_FAILED, "no program had a solution: last torques held")
        elif self.last_tick.level is TickLevel.NO_HANDS:
            self.status = StatusReport(Status.STOP, Reason.HANDS_DROPPED, "balance needs everything: hands give way")
        elif self._plan is None:
            self.status = self._refused or NO_CHUNK
        elif self._follower.s > self._plan.end or self._last_state.time > self._chunk_end + 0.5:
            self.status = self._refused or STARVED
        else:
            self._report_plan(self._plan.report.at(self._follower.s))

    def _report_plan(self, report: PlanReport) -> StatusReport:
        """Status while a plan is followed: of a chunk that was taken all that it needs, of a tick what is done then."""
        if self._refused is not None:
            self.status = self._refused
        elif report.lift.any():
            detail = f"the hands were to go into the floor: targets lifted by {report.lift.max():.3f} m"
            self.status = StatusReport(Status.SLOWED, Reason.INTO_FLOOR, detail)
        elif report.implausible or (report.smoothed and not report.reasons):
            detail = f"steps scatter: followed the curve through them in {', '.join(report.smoothed)}"
            self.status = StatusReport(Status.SLOWED, Reason.NOISY_CHUNK, detail)
        elif report.reasons:
            moved = max(float(report.clamped.max()), report.projected)
            detail = f"targets moved by up to {moved:.3f} m, slowed {report.slowdown:.2f} times"
            self.status = StatusReport(Status.SLOWED, report.reasons[0], detail)
        elif self._follower.rate < 0.98:
            detail = f"slowed to {self._follower.rate:.2f} of chunk speed"
            self.status = StatusReport(Status.SLOWED, Reason.TRACKING, detail)
        else:
            self.status = TRACKING
        return self.status

    def _refuse(self, reason: Reason, detail: str) -> StatusReport:
        self._refused = self.status = StatusReport(Status.HOLD, reason, detail)
        return self.status
