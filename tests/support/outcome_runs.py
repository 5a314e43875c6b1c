"""What becomes of a case in a simulation, and no more of it than that takes."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from policy.chunk import ActionChunk
from tests.support.outcome_cases import Case
from wholebody.episode.tracking_error import TrackingError
from wholebody.robot.support_polygon import SupportPolygon, convex_polygon
from wholebody.sim.fall import detect_fall
from wholebody.types import RobotState
from wholebody.verdict.check import Checker
from wholebody.verdict.trial import HOLD

FOLLOWED = 0.02
"""Distance of a palm from a step up to which it is followed [m]; definition."""
STILL, SLOW, LOOK = 0.5, (0.02, 0.05, 0.15), 0.02
"""How long [s] pelvis [m/s], [rad/s] and joints [rad/s] are slow until a robot is at rest, looked at so often [s]."""
BEYOND = 0.15
"""How far the capture point is past the soles when a fall is decided [m]; chosen: of 152 runs that went on, none stood
that had been past 0.015 m, and of 49 that fell 48 came past 0.25 m."""


class AtRest:
    """Whether a robot has been slow for `STILL`; `since` when [s]."""

    def __init__(self, until: float = STILL) -> None:
        self.since, self._until, self._slow, self._next = None, until, None, 0.0

    def __call__(self, state: RobotState) -> bool:
        if state.time < self._next:
            return False
        self._next = state.time + LOOK - 1e-9
        parts = state.v[:3], state.v[3:6], state.v[6:]
        slow = all(np.abs(part).max() < bound for part, bound in zip(parts, SLOW, strict=True))
        self._slow = (self._slow or state.time) if slow else None
        at_rest = slow and state.time > self._slow + STILL
        if at_rest and self.since is None:
            self.since = state.time
        return at_rest and state.time > self._slow + self._until


class Falling:
    """Whether a fall is decided: no step is taken, and the capture point is `BEYOND` the soles, where it runs away."""

    def __init__(self, checker: Checker) -> None:
        self._plant, self._next = checker.plant, 0.0
        self._support: SupportPolygon = convex_polygon(self._plant.contact_points()[:, :2])

    def __call__(self, state: RobotState) -> bool:
        if state.time < self._next:
            return False
        self._next = state.time + LOOK - 1e-9
        model, data = self._plant.model, self._plant.data
        mujoco.mj_subtreeVel(model, data)
        com, speed = data.subtree_com[0], data.subtree_linvel[0]
        point = com[:2] + speed[:2] * np.sqrt(max(com[2], 0.1) / -model.opt.gravity[2])
        support = self._support
        return bool((support.normals @ point - support.offsets).max() > BEYOND)


@dataclass(frozen=True)
class Run:
    """What became of a case.

    Attributes:
        fell: Whether a fall happened, or was decided. early: Before the chunk came: it has no part in that.
        time, cause: When, in simulated time [s], and why.
        rest_s: Since when the robot was at rest [s].
        worst_m: The farthest that a palm was from a step that was looked at [m]; None if none was.
        followed: Whether all steps were looked at, and none missed.
    """

    fell: bool
    early: bool = False
    time: float | None = None
    cause: str = ""
    rest_s: float | None = None
    worst_m: float | None = None
    followed: bool = False


class Palms:
    """How far palms are from the steps of a case's chunk, from when a plan of it may be there."""

    def __init__(self, checker: Checker, case: Case) -> None:
        self._follower, self._errors, fps = checker.supervisor, TrackingError(checker.supervisor), case.chunk.fps
        lead = self._follower.config.planning.lead
        self._since = case.begins + lead + (0.5 / fps if case.before is not None else -1e-6)
        self._due, self._next, self._joined = len(case.chunk) - int(lead * fps) - 2, 0.0, False

    def look(self, state: RobotState, chunk: ActionChunk | None) -> None:
        """Compare with a step that is due; ``chunk`` is the case's once it was handed over."""
        follower = self._follower
        self._joined |= chunk is not None and follower.chunk is chunk
        self._errors.follow(follower.chunk, follower.plan_report)
        self._errors.measure(state, follower.palm_reference())

    def missed(self, state: RobotState) -> bool:
        """Whether a step was missed; looked at now and then."""
        if state.time < self._next:
            return False
        self._next = state.time + 0.1
        return (self.worst() or 0.0) > FOLLOWED

    def _off(self) -> np.ndarray:
        found = self._errors.result()
        return found.errors[found.times > self._since]

    def worst(self) -> float | None:
        """The farthest [m]; None of no steps."""
        off = self._off()
        return float(off.max()) if len(off) else None

    def followed(self) -> bool:
        """Whether all steps have been looked at, and none was missed."""
        off = self._off()
        return self._joined and len(off) >= self._due and float(off.max()) <= FOLLOWED


def run_case(checker: Checker, case: Case, begin: RobotState, *, whole: bool = False) -> Run:
    """Execute a case from a state on in a checker's world, until what is asked of it is decided.

    As given, that is whether the robot falls; with plans, whether the palms follow the chunk and it stands, so that
    nothing more is simulated once a step is missed.

    Args:
        checker: What follows chunks, and where.
        case: Its chunk comes after ``case.begins`` [s] of the one before, if there is one.
        begin: Where the robot is.
        whole: Go on until 4 s after the last step, or the fall, whatever is decided before.
    """
    follower, plant, sensors = checker.supervisor, checker.plant, checker.sensors
    state = plant.reset(begin)
    if sensors is not None:
        sensors.reset()
    told = state if sensors is None else sensors.measure(state)
    follower.reset(told, state.time)
    palms = Palms(checker, case) if checker.follow == "planned" else None
    rest, falling, sent = AtRest(np.inf if whole else STILL), Falling(checker), None
    waiting = ([] if case.before is None else [(0.0, case.before)]) + [(case.begins, case.chunk)]
    last = case.begins + (len(case.chunk) - 1) / case.chunk.fps
    while state.time < last + HOLD - 1e-9:
        if waiting and state.time > waiting[0][0] - 1e-9:
            coming = replace(waiting.pop(0)[1], t_obs=state.time)
            sent = None if waiting else coming
            follower.accept(coming, state.time)
        command = follower.step(told, state.time)
        if palms is not None and state.time < last + LOOK:
            palms.look(state, sent)
        state = plant.step(command)
        told = state if sensors is None else sensors.measure(state)
        fall = detect_fall(plant, state, follower.status.status)
        if fall is not None or (falling(state) and not whole):
            cause = "capture point past the soles" if fall is None else fall.cause
            return Run(True, state.time < case.begins, state.time, cause, rest.since, palms and palms.worst())
        if palms is not None and not whole and palms.missed(state):
            return Run(False, rest_s=rest.since, worst_m=palms.worst())
        if state.time > last and rest(state):
            break
    return Run(False, rest_s=rest.since, worst_m=palms and palms.worst(), followed=bool(palms and palms.followed()))
