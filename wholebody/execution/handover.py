"""From one plan to the next: asked for ahead of time, taken over exactly when it is due, dropped if it is late."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from policy.chunk import ActionChunk
from wholebody.config import PlanningConfig
from wholebody.execution.background_planner import BackgroundPlanner, PlanAnswer, PlanRequest
from wholebody.execution.states import Event, Machine, State
from wholebody.planning.plan import ChunkPlan
from wholebody.robot.support_polygon import SupportPolygon

REST_SPEED = 0.05
"""Speed of any joint or the base below which a plan ends at rest [rad/s, m/s]; chosen, no trial is on record."""
WAIT = 0.1
"""Time for which a plan waits for a robot that is slower along the present one than was foreseen [s]; chosen, no trial
is on record."""
RATE_MIN = 0.05
"""Share of its speed along a plan below which that is as good as at rest; chosen, no trial is on record."""
QUICK = 5
"""Plans in a row, each there in half of the lead, before that is halved; chosen: at one or two a second they see every
part of a motion that repeats itself. A single one says little: the next may take three times as long, and is cut short.
"""
NEAR = 0.02
"""Distance of a palm from the chunk up to which a plan that was cut short takes over from another one [m]; chosen: what
is further off is another place.
"""
ROUNDING = 1e-6
"""Difference of two parameters that is rounding [s]; chosen: far below a tick."""


@dataclass(frozen=True)
class Takeover:
    """A plan that takes over now.

    Attributes:
        chunk: What it follows.
        plan: The plan.
        beyond: How far past its start it is taken over [s].
        speed_fraction: Of its speed at which it is taken over: that of the foreseen speed that the robot has.
    """

    chunk: ActionChunk
    plan: ChunkPlan
    beyond: float
    speed_fraction: float


class Handover:
    """The plan that is being computed, and the one that waits for its time.

    Args:
        planner: Plans beside the control loop.
        config: When plans are asked for.
        dt: Control period [s].

    Attributes:
        lead: Time from asking for a plan to the instant at which it takes over [s].
        late: How many plans came too late, and were asked for again, since the reset.
        planning_time: CPU time that the last plan took [s]; 0 before the first.
    """

    def __init__(self, planner: BackgroundPlanner, config: PlanningConfig, dt: float) -> None:
        self._planner, self._config, self._dt = planner, config, dt
        self._states = Machine(State.IDLE)
        self.reset()

    def reset(self) -> None:
        """Begin an episode."""
        self.lead, self.late, self.planning_time, self._quick = self._config.lead, 0, 0.0, 0
        self.cancel()

    def cancel(self) -> None:
        """Nothing is wanted any more."""
        self._states.on(Event.CANCELLED)
        self._asked: PlanRequest | None = None
        self._ready: tuple[PlanRequest, ChunkPlan] | None = None
        self._dropped: ActionChunk | None = None
        self._outrun = False

    @property
    def busy(self) -> bool:
        """Whether a plan is being computed or waits for its time."""
        return self._states.now is not State.IDLE

    @property
    def is_slow(self) -> bool:
        """Whether plans have come late, so that they are asked for earlier than the configuration has it."""
        return self.lead > self._config.lead

    @property
    def cpu_limit(self) -> float:
        """CPU time that a plan may take to come in time [s]: the lead, on a computer that is `factor` times faster."""
        factor = self._config.factor
        return self.lead / factor if self._planner.measured and self.lead * factor > 0.0 else inf

    @property
    def ticks(self) -> int:
        """Control periods from asking to taking over."""
        return round(self.lead / self._dt)

    def ask(self, request: PlanRequest) -> None:
        """Have a plan computed, in time."""
        self._states.on(Event.ASKED)
        self._asked = replace(request, cpu_limit=self.cpu_limit)
        self._planner.submit(self._asked)

    def collect(self, now: float, followed: float) -> PlanAnswer | None:
        """What has come of the request, to be settled. A plan that is too late is dropped and doubles the lead.

        So does one that would have been another with more time; it is dropped if it is not safe, or leads the palms
        elsewhere while there is a plan to go on with.

        Args:
            now: Present time [s].
            followed: Time up to which the present plan has been followed [s].
        """
        answer = self._planner.poll(now)
        request = self._asked
        if answer is None or request is None or answer.request is not request:
            return None
        self._asked, self.planning_time = None, answer.took
        late, plan = followed > request.due + 0.5 * self._dt and answer.elsewhere is None, answer.plan
        short = plan is not None and plan.report.timed_out and self.lead < self._config.lead_max
        bad = plan is not None and not plan.report.safe
        if short and request.before is not None:
            bad = bad or plan.report.tracking_error.max() > NEAR
        self._quick = 0 if late or short or now - request.asked >= 0.5 * self.lead else self._quick + 1
        if late or short:
            self.lead = min(2.0 * max(self.lead, self._dt), self._config.lead_max)
        if late or (short and bad):
            self._states.on(Event.LATE)
            self.late += 1
            self._dropped = request.chunk
            return None
        if self._quick == QUICK:
            self.lead, self._quick = max(0.5 * self.lead, self._config.lead), 0
        return answer

    def settle(
        self, request: PlanRequest, plan: ChunkPlan | None, newer: ActionChunk | None = None, now: float = 0.0
    ) -> None:
        """Keep the plan of a request that was collected until it is due; None where it is not to be followed.

        Where plans come late, one that would be over before another could follow it is left for that of a newer chunk,
        once in a row: asked for now [s] instead of when the first one is due, it is there before its chunk is over, and
        so are all later ones.
        """
        ends = float(request.chunk.times[-1])
        over = self.is_slow and newer is not None and ends < request.due + self.lead
        self._outrun = over and float(newer.times[-1]) > max(ends, now + self.lead) and not self._outrun
        plan = None if self._outrun else plan
        self._states.on(Event.REFUSED if plan is None else Event.CLEARED)
        self._ready = None if plan is None else (request, plan)

    def take(self, followed: float, s: float | None, rate: float) -> Takeover | None:
        """The plan that takes over now, once: from exactly the point of the present one at which it begins.

        A robot that is slower along its plan than was foreseen comes to that point later; where it does not come there
        for `WAIT`, the plan is dropped.

        Args:
            followed: Time up to which the present plan has been followed [s].
            s: Parameter of the present plan [s]; None if none is followed.
            rate: Its derivative.
        """
        if self._ready is None or followed < self._ready[0].due - 0.5 * self._dt:
            return None
        (request, plan), start = self._ready, self._ready[0].start
        late, fraction = max(followed - request.due, 0.0), 1.0
        if s is not None:
            if s < start.s - ROUNDING:
                if late >= WAIT:
                    self._states.on(Event.MISSED)
                    self._ready, self._dropped = None, request.chunk
                return None
            late = (s - start.s) / max(rate, RATE_MIN)
            fraction = min(rate / start.rate, 1.0) if start.rate > RATE_MIN else 1.0
        self._ready = None
        self._states.on(Event.DUE)
        return Takeover(request.chunk, plan, max(late, 0.0) * plan.rate * fraction, fraction)

    def take_dropped(self) -> ActionChunk | None:
        """The chunk whose plan was dropped, once: it is to be planned anew."""
        chunk, self._dropped = self._dropped, None
        return chunk


def ends_at_rest(plan: ChunkPlan, support: SupportPolygon, margin: float) -> bool:
    """Whether a plan is finite, and ends at rest with the centre of mass that far inside the support [m].

    Going on with such a plan is safe for as long as nothing better comes.
    """
    trajectory = plan.trajectory
    if not plan.is_finite:
        return False
    rests = np.abs(trajectory.v[-2:]).max() <= REST_SPEED
    return bool(rests and support.margin(trajectory.com[0, -1, :2]) >= margin)
