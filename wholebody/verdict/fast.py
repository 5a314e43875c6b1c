"""Judge inputs by their plans alone: what would be commanded, chunk after chunk, if the robot followed every plan."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np

from models.spec import RobotSpec
from policy.base import Policy
from policy.chunk import ActionChunk
from policy.geometry.rotations import angle_between, quaternion_to_matrix
from policy.geometry.se3 import make_transform
from policy.joints import BODY_JOINTS
from policy.observation import Observation
from wholebody.config import ControllerConfig
from wholebody.config.bounds import require_run
from wholebody.config.description import describe
from wholebody.episode.result import EpisodeResult, Note, Refusal
from wholebody.episode.run import fingers_of
from wholebody.episode.tracking_error import FINGER_TOLERANCE, PalmErrors, demandable
from wholebody.execution.handover import ends_at_rest
from wholebody.planning.judgement.cause import causes
from wholebody.planning.judgement.chunk_judge import Begin, ChunkJudge, ChunkJudgement
from wholebody.planning.judgement.chunk_program import ChunkProgram
from wholebody.planning.judgement.limits import Limit, Margin
from wholebody.planning.plan import ChunkPlan
from wholebody.sim.limit_monitor import LimitExcess
from wholebody.types import Reason, RobotState, check_state
from wholebody.verdict.repair import Repairer
from wholebody.verdict.scene import SceneDistance
from wholebody.verdict.tick import TickProver
from wholebody.verdict.verdict import Verdict, blocked
from wholebody.verdict.verdict import judge as judge_episode
from wholebody.verdict.why import WouldDo, raised, why

REPLACE_EVERY = 25
"""Steps of a chunk after which the next one is asked for, as in an episode."""
SUSPECTS = 3
"""Chunks that were not followed as given among which the first with a cause is looked for."""
Start = Literal["first", "stance"]


@dataclass
class _Palms:
    """What is collected of the palms, a row a step."""

    times: list[float] = field(default_factory=list)
    moved: list[np.ndarray] = field(default_factory=list)
    turned: list[np.ndarray] = field(default_factory=list)
    fair: list[np.ndarray] = field(default_factory=list)
    reasons: list[Reason | None] = field(default_factory=list)
    fingers: dict[str, LimitExcess] = field(default_factory=dict)

    def errors(self) -> PalmErrors:
        moved, turned = np.reshape(self.moved, (-1, 2)), np.reshape(self.turned, (-1, 2))
        still, fair = np.zeros_like(moved), np.reshape(self.fair, (-1, 2)).astype(bool)
        return PalmErrors(
            np.array(self.times), moved, turned, moved, turned, still, still, fair, self.reasons, self.fingers
        )


class FastChecker:
    """Judges by plans; nothing is simulated.

    Args:
        config: Of the robot and its controller. scene: What stands around it: a name of `models.scenes`, or a file.
    """

    def __init__(self, config: ControllerConfig | None = None, scene: str = "floor") -> None:
        self.config = config or ControllerConfig()
        self.spec: RobotSpec = describe(self.config.robot)
        around = None if scene == "floor" else SceneDistance(self.spec, scene)
        self.judge = ChunkJudge(self.spec, self.config, around)
        self._settings = asdict(self.config)

    @cached_property
    def prover(self) -> TickProver:
        """What asks the tick's program."""
        return TickProver(self.spec, self.config)

    def check(
        self, policy: Policy, name: str, duration: float, *, start: Start = "first", ask_why: bool = False
    ) -> Verdict:
        """Judge what a policy would command if every plan was followed exactly.

        Args:
            policy: Source of the chunks; it sees the planned robot.
            name: What to call the input.
            duration: Time for which chunks are asked for [s].
            start: Whether the robot stands with its hands where the first chunk begins, or in the stance.
            ask_why: Look for causes, which takes seconds.

        Raises:
            InputError: If the duration is negative or longer than six hours.
        """
        require_run("duration", duration)
        policy.reset()
        run = _Run(self.judge, policy.spec.orientation_free)
        # A robot that stands elsewhere has its first plan when that is computed, and later ones as late.
        lead = self.config.planning.lead if start == "stance" else 0.0
        begin, time = self.judge.stance(), 0.0
        while time < max(duration, 1e-9) - 1e-9:
            chunk = policy.infer(self._observation(begin, time))
            if start == "first" and time == 0.0:
                begin = self.judge.first_pose(chunk)
            following = REPLACE_EVERY / chunk.fps
            last = time + following >= duration - 1e-9
            begin = run.follow(chunk, begin, time + lead, np.inf if last else time + following + lead)
            time += following
        return self._told(run, name, ask_why=ask_why)

    def of_chunk(
        self, chunk: ActionChunk, begin: Begin, name: str, free: tuple[bool, bool], *, ask_why: bool = False
    ) -> Verdict:
        """Judge a single chunk from where it is begun."""
        run = _Run(self.judge, free)
        run.follow(chunk, begin, chunk.t_obs, np.inf)
        return self._told(run, name, ask_why=ask_why)

    def of_plan(
        self, chunk: ActionChunk, plan: ChunkPlan, begin: Begin, now: float, free: tuple[bool, bool]
    ) -> Verdict:
        """Judge what a plan makes of the rest of a chunk, begun somewhere now [s], at the speed of the plan.

        A slow-down is told, and moves nothing. Hands that begin elsewhere, and are on their way for longer than the
        chunk lasts, come to its last step. Room to bounds is not looked at.
        """

        def judged(followed: ActionChunk) -> Verdict:
            run, none = _Run(self.judge, free, by_path=True), np.zeros((0, 2))
            run.follow(followed, begin, now, np.inf, ChunkJudgement(plan, followed.times, none, none, ()))
            return run.verdict(f"chunk {chunk.seq}", {})

        verdict, bounds = judged(chunk), self.config.verdict
        elsewhere = verdict.start_m > bounds.palm_feasible or verdict.start_rad > bounds.turn_feasible
        if verdict.verdict == "infeasible" and elsewhere and not verdict.approach_s:
            return judged(_held_until(chunk, plan.end))
        return verdict

    def repairer(
        self, chunk: ActionChunk, begin: Begin | None = None, free: tuple[bool, bool] = (False, False)
    ) -> Repairer:
        """What changes a chunk until it is feasible by its plan; begun as in `Repairer`."""

        def holds(changed: ActionChunk, start: Begin) -> bool:
            return self.of_chunk(changed, start, "", free).verdict == "feasible"

        return Repairer(self.judge, chunk, begin, holds)

    def _told(self, run: _Run, name: str, *, ask_why: bool) -> Verdict:
        verdict = run.verdict(name, self._settings)
        if not ask_why or verdict.verdict == "feasible":
            return verdict
        for chunk, begin, now in run.suspects[:SUSPECTS]:
            program = ChunkProgram(self.judge, chunk, begin, run.result.orientation_free, now)
            found = [why(one, chunk.t_obs - run.result.start, chunk.fps) for one in causes(program)]
            if found:
                changes = self.repairer(chunk, begin, run.result.orientation_free).singles()
                would_do = [WouldDo(x.kind, x.slower, x.moved, x.turned, x.lighter) for x in changes]
                would_do += raised(program, found, chunk.t_obs - run.result.start)
                tick = self.prover.of(program, chunk.t_obs - run.result.start)
                return replace(verdict, causes=found, would_do=would_do, tick=tick)
        return verdict

    def _observation(self, begin: Begin, time: float) -> Observation:
        q, motor = begin.body.q, self.judge.robot.pin_to_motor
        joints = q[7:][motor]
        T = make_transform(quaternion_to_matrix(q[3:7], "xyzw"), q[:3])
        return Observation(time, joints[: len(BODY_JOINTS)], *fingers_of(self.spec, joints), T)


class _Run:
    """Chunks planned one after the other, and what they come to."""

    def __init__(self, judge: ChunkJudge, free: tuple[bool, bool], *, by_path: bool = False) -> None:
        """Of palms whose orientation may be free, compared at the steps' own times, or else where the plan is then."""
        self.judge, self.palms, self.result = judge, _Palms(), EpisodeResult(orientation_free=free)
        self._by_path = by_path
        self.margins: dict[Limit, Margin] = {}
        self.suspects: list[tuple[ActionChunk, Begin, float]] = []
        self.followed: ChunkJudgement | None = None
        self.previewed, self._since, self._spent, self._travelled = True, 0.0, 0.0, 0.0

    def follow(
        self, chunk: ActionChunk, begin: Begin, now: float, until: float, found: ChunkJudgement | None = None
    ) -> Begin:
        """Plan a chunk from where the robot is then, now [s], and follow it until a time [s]; where that leads.

        What was ``found`` of it is not planned again.
        """
        chunk.validate()
        result, found = self.result, found or self.judge.judge(chunk, begin, now)
        self._note(chunk, found, begin)
        if found.plan.report.changes or not found.plan.report.safe or found.exceeded:
            self.suspects.append((chunk, begin, now))
        body, margin = self.judge.planner.optimizer.body, self.judge.config.safety.balance_margin
        if found.plan.report.safe and ends_at_rest(found.plan, body.footing.support, margin):
            self.followed, self._since = found, now
        else:
            result.refusals.append(Refusal(now, Reason.NOT_JOINED, Reason.NOT_JOINED.sentence))
        due = np.flatnonzero((chunk.times > now - 1e-9) & (chunk.times < until - 1e-9))
        self._score(chunk, due, begin)
        if self.followed is None or not np.isfinite(until):
            return begin
        return self.judge.later(self.followed.plan, until - self._since)

    def _note(self, chunk: ActionChunk, found: ChunkJudgement, begin: Begin) -> None:
        result, report = self.result, found.plan.report
        result.notes += [Note(chunk.t_obs, text) for text in chunk.notes]
        if not result.fps:
            (p, R), (at, turned) = self.judge.asked(chunk), self.judge.at(begin)
            first = min(int(np.ceil(found.plan.start * chunk.fps - 1e-6)), len(chunk) - 1)
            result.start, result.fps = chunk.t_obs, chunk.fps
            jump = np.linalg.norm(at - p[first], axis=1).max(), angle_between(turned, R[first]).max()
            result.start_jump = float(jump[0]), float(jump[1])
        self.previewed &= found.previewed
        if report.slowdown > result.slowdown:
            result.slowdown, result.slowed_time = report.slowdown, chunk.t_obs
        for one in found.margins:
            moved = replace(one, time=one.time + chunk.t_obs, step=one.step + round(chunk.t_obs * chunk.fps))
            if one.code not in self.margins or one.share < self.margins[one.code].share:
                self.margins[one.code] = moved

    def _score(self, chunk: ActionChunk, due: np.ndarray, begin: Begin) -> None:
        """Compare steps of a chunk with what is commanded then: by its plan, or by the one before."""
        palms, n, times = self.palms, len(due), chunk.times[due]
        asked = tuple(part[due] for part in self.judge.asked(chunk))
        if self.followed is None:
            commanded, reasons = self.judge.at(begin), [Reason.NOT_JOINED] * n
            self._fair(np.zeros((n, 2), dtype=bool))
        else:
            plan = self.followed.plan
            s = plan.start + (1.0 if self._by_path else plan.rate) * (times - self._since)
            commanded = self.judge.commanded(plan, np.minimum(s, plan.end + 10.0))
            reasons = [plan.report.moved_at(x) for x in s.tolist()]
            self._fair(demandable(chunk, plan.report)[due])
            self._spent += n / chunk.fps
            self._travelled += n / chunk.fps * plan.rate
        palms.times += times.tolist()
        palms.moved += list(np.linalg.norm(commanded[0] - asked[0], axis=-1))
        palms.turned += list(angle_between(commanded[1], asked[1]))
        palms.reasons += reasons
        self._look_at_fingers(chunk, due)

    def _fair(self, fair: np.ndarray) -> None:
        self.palms.fair += list(fair)

    def _look_at_fingers(self, chunk: ActionChunk, due: np.ndarray) -> None:
        spec, times = self.judge.spec, chunk.times[due]
        for tool, q in zip(spec.tools, (chunk.q_lhand[due], chunk.q_rhand[due]), strict=True):
            if not tool.finger_joints or not len(due):
                continue
            i = spec.indices(tool.finger_joints)
            inside = np.clip(q, spec.position_min[i], spec.position_max[i])
            excess = np.abs(q - inside)
            for joint in np.flatnonzero(excess.max(axis=0, initial=0.0) > FINGER_TOLERANCE).tolist():
                k, first = int(excess[:, joint].argmax()), int(np.argmax(excess[:, joint] > FINGER_TOLERANCE))
                one = LimitExcess(float(times[first]), 0.0, float(q[k, joint]), float(inside[k, joint]))
                self.palms.fingers.setdefault(tool.finger_joints[joint], one)

    def verdict(self, name: str, settings: dict) -> Verdict:
        """By the same rules as that of an episode."""
        result = self.result
        result.palms = self.palms.errors()
        result.time_factor = self._spent / self._travelled if self._travelled else 1.0
        verdict = judge_episode(name, result, settings, bounds=self.judge.config.verdict)
        if Limit.SCENE_DISTANCE in self.margins:
            verdict = blocked(verdict, self.margins[Limit.SCENE_DISTANCE], self.judge.config.verdict)
        tightest = sorted(self.margins.values(), key=lambda one: one.share)
        return replace(verdict, method="fast", decided_by="preview" if self.previewed else "plan", margins=tightest)


def _held_until(chunk: ActionChunk, end: float) -> ActionChunk:
    """A chunk whose last step is held until a time after its first one [s]."""
    steps = np.minimum(np.arange(max(int(np.ceil(end * chunk.fps)) + 1, len(chunk))), len(chunk) - 1)
    return replace(chunk, **{name: value[steps] for name, value in chunk.arrays().items()})


def judge(
    chunk: ActionChunk,
    state: RobotState | None = None,
    config: ControllerConfig | None = None,
    *,
    scene: str = "floor",
    orientation_free: tuple[bool, bool] = (False, False),
    ask_why: bool = False,
) -> Verdict:
    """Judge one chunk without simulating it: a function of its arguments alone.

    Args:
        chunk: What the hands are to do.
        state: Where the robot is; at rest with its hands at the chunk's first step if not given.
        config: Of the robot and its controller.
        scene: What stands around it: a name of `models.scenes`, or a MuJoCo file (.xml).
        orientation_free: Whether nothing is asked of the left and the right palm's orientation.
        ask_why: Look for causes where it is not feasible, which takes seconds.

    Raises:
        ChunkError: If the chunk is malformed.
        InputError: If the state is.
    """
    checker = shared_checker(config or ControllerConfig(), scene)
    chunk.validate()
    if state is None:
        begin = checker.judge.first_pose(chunk)
    else:
        begin = checker.judge.present(check_state(state, checker.spec.n_joints))
    return checker.of_chunk(chunk, begin, f"chunk {chunk.seq}", orientation_free, ask_why=ask_why)


@lru_cache(maxsize=1)
def shared_checker(config: ControllerConfig, scene: str = "floor") -> FastChecker:
    """The same one for the same settings, as long as no others are asked for."""
    return FastChecker(config, scene)
