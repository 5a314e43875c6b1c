"""What the supervisor says of a chunk, and of the plan that it follows."""

from __future__ import annotations

import numpy as np

from models.spec import RobotSpec
from policy.chunk import ActionChunk
from policy.errors import ChunkError
from policy.joints import layout_robot
from wholebody.control.tick_report import TickLevel, TickReport
from wholebody.errors import StateError
from wholebody.execution.ahead.hands_ahead import HandsAhead
from wholebody.execution.plan_follower import PlanFollower
from wholebody.execution.state_monitor import StateMonitor
from wholebody.execution.states import Machine, State
from wholebody.planning.plan import ChunkPlan, PlanReport
from wholebody.reference import HandMotion, ReferenceSmoother
from wholebody.types import Reason, RobotState, Status, StatusReport

RATE_SAID = 0.98
"""Share of its speed below which a chunk is said to be slowed; chosen, no trial is on record."""

TRACKING = StatusReport(Status.TRACKING)
"""Nothing to say: also of a chunk whose plan is being computed."""
NO_CHUNK = StatusReport(Status.HOLD, Reason.NO_CHUNK, "no chunk yet: holding the stance")
STARVED = StatusReport(Status.HOLD, Reason.STARVED, "the chunk is over: holding its end")
OFF_PLAN = StatusReport(Status.STOP, Reason.OFF_PLAN, "the robot left its plan: it stands where it is, hands let go of")
GOING_BACK = StatusReport(
    Status.STOP,
    Reason.OFF_PLAN,
    "no motion leads from here to a chunk: the robot goes slowly to its stance, hands let go of, until one does",
)
NO_HANDS = StatusReport(Status.STOP, Reason.HANDS_DROPPED, "balance needs everything: hands give way")
FAILED = StatusReport(Status.STOP, Reason.QP_FAILED, "no program had a solution: last torques held")
OF_LEVEL = {TickLevel.FAILED: FAILED, TickLevel.NO_HANDS: NO_HANDS}
"""What is said of a tick that could not do all of its program."""
STANDING_LOST = StatusReport(Status.DAMPING, Reason.STANDING_LOST, "the robot is no longer standing: joints damped")
HANGS = StatusReport(
    Status.DAMPING,
    Reason.STANDING_LOST,
    "its legs met no floor when it began, as of a robot that hangs: joints damped; put it down, then `reset`",
)
LOWERING = StatusReport(Status.HOLD, Reason.LOWERING, "the robot goes into its crouch")
LOWERED = StatusReport(
    Status.HOLD, Reason.LOWERED, "the robot crouches on stiff legs: the last command may be kept; `raise_` ends it"
)
RAISING = StatusReport(Status.HOLD, Reason.RAISING, "the robot stands up")
RIDING = StatusReport(Status.TRACKING, Reason.WALKING, "the robot walks, its hands along the chunk's own paths")
RISING = StatusReport(Status.HOLD, Reason.WALKING, "the robot goes to its stance, from where it walks")
WALKING = StatusReport(Status.HOLD, Reason.WALKING, "the robot walks; chunks are planned once it stands")
RECOVERING = StatusReport(
    Status.STOP, Reason.RECOVERING, "the robot would fall: it takes a step, hands let go of until it has come to rest"
)
DESCENDING = StatusReport(
    Status.STOP,
    Reason.DESCENDING,
    "nothing keeps the robot from falling: it folds, and comes down on knees and palms, or over hip and shoulder",
)
HANDS_YIELD = StatusReport(Status.STOP, Reason.HANDS_DROPPED, "hands would keep the body from its steps: they give way")
NOT_JOINED = StatusReport(
    Status.HOLD,
    Reason.NOT_JOINED,
    "no balanced motion leads from here to the chunk yet, so the one before is followed to its end: a chunk that "
    "begins nearer to the hands, or slower, would be joined at once",
)

GATE_LATE = StatusReport(Status.HOLD, Reason.GATE_LATE, "the chunk was not cleared in time: it is judged again")


def refused(reason: Reason | None, detail: str) -> StatusReport:
    """A chunk is not followed: what goes on instead is the one before."""
    return StatusReport(Status.HOLD, reason, detail)


def chunk_fault(chunk: ActionChunk, after: ActionChunk | None, now: float, robot: RobotSpec) -> StatusReport | None:
    """Why a chunk cannot be used by a robot now [s], or None; ``after`` is the one accepted before it."""
    try:
        chunk.validate(after=after, robot=layout_robot(robot))
    except (ChunkError, ValueError) as error:
        return refused(Reason.CHUNK_INVALID, str(error))
    if chunk.times[-1] <= now:
        age = now - chunk.t_obs
        return refused(Reason.CHUNK_STALE, f"the chunk's last step is over: it is {age:.2f} s old")
    if chunk.t_obs > now + 1.0 / chunk.fps:
        return refused(Reason.CHUNK_FROM_FUTURE, f"t_obs {chunk.t_obs:.3f} s is after now, {now:.3f} s")
    return None


def plan_status(report: PlanReport, rate: float, s: float | None = None, *, waits: bool = False) -> StatusReport:
    """Status while a plan is followed.

    Args:
        report: Of the plan.
        rate: Speed along the chunk, 1 being its own.
        s: Where it is followed [s]: the status is of what a person sees there. If not given, it is of the whole chunk.
        waits: Whether it is slow for the next plan, which would come after its chunk is over.
    """
    reason = next(iter(report.changes), None) if s is None else report.seen_at(s)
    if reason is not None:
        return StatusReport(Status.SLOWED, reason, report.changes[reason].detail)
    if rate < RATE_SAID:
        why = ", for the next plan comes late" if waits else ""
        return StatusReport(Status.SLOWED, Reason.PALM_MISSED, f"slowed to {rate:.2f} of chunk speed{why}")
    return TRACKING


class Following:
    """What a supervisor follows, for those who watch it."""

    chunk: ActionChunk | None
    plan: ChunkPlan | None
    plan_report: PlanReport | None
    last_tick: TickReport | None
    monitor: StateMonitor
    _newest: ActionChunk | None
    _waiting: ActionChunk | None
    _refused: StatusReport | None
    _refusal: StatusReport | None
    _last_state: RobotState
    _smoother: ReferenceSmoother
    _follower: PlanFollower
    _ahead: HandsAhead
    _states: Machine
    _now: float
    _chunk_end: float

    def _seen(self, tick: TickReport, off_plan: StatusReport | None) -> StatusReport:
        """Status after a tick, worst first; ``off_plan`` is that of a robot that follows none."""
        if (worst := OF_LEVEL.get(tick.level, off_plan)) is not None:
            return worst
        if self.plan is None or self.chunk is None:
            return self._refused or NO_CHUNK
        if self._ahead.is_there:
            return TRACKING
        if self._follower.s > self.plan.end or self._now > self._chunk_end + 0.5:
            return self._refused or STARVED
        return self._refused or plan_status(self.plan.report, self.rate, self._follower.s, waits=self._follower.waits)

    def _following(self) -> PlanFollower:
        """The follower of this episode; a `StateError` before the first one."""
        if self._states.now is State.NEW:
            raise StateError("the supervisor has no state yet: call `reset` with a measured state of standing first")
        return self._follower

    @property
    def time_factor(self) -> float:
        """Time spent on chunks over chunk time covered; 1 is unslowed."""
        return self._following().time_factor

    @property
    def moved_for(self) -> Reason | None:
        """Why a hand is commanded elsewhere than the chunk has it, however little a person would see of that."""
        return None if self.plan is None else self.plan.report.moved_at(self._follower.s)

    @property
    def state(self) -> State:
        """What the robot follows; docs/architecture.md draws what leads from one state to the other."""
        return self._states.now

    @property
    def rate(self) -> float:
        """Speed along the plan, 1 at the chunk's own."""
        return self._following().rate

    def palm_reference(self) -> dict[str, np.ndarray]:
        """Commanded palm poses in world, 4x4, by side."""
        return dict(zip(("left", "right"), self._following().palm_poses(), strict=True))

    def ahead(self, times: np.ndarray) -> tuple[HandMotion, HandMotion] | None:
        """What both hands will be commanded at times near the present, as planned and at the present speed.

        Args:
            times: Shape (n,), [s]; past the end of the plan its last pose is held.

        Returns:
            Rows (n, 40) a hand, derivatives with respect to the path; None while no chunk is followed.
        """
        if self.plan is None or self.chunk is None:
            return None
        follower = self._follower
        s = follower.s + follower.rate * (np.asarray(times) - self.monitor.clock.shift - self._now)
        return self._ahead.hands(np.clip(s, self.plan.start, self.plan.end))
