"""Judge inputs by their plans alone: what would be commanded, chunk after chunk, if the robot followed every plan."""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import cached_property, partial
from typing import Literal

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.base import Policy
from policy.chunk import ActionChunk
from policy.joints import layout_robot
from policy.observation import Observation
from policy.recorded.replay import ReplayPolicy
from wholebody.config import ControllerConfig
from wholebody.config.bounds import require_run
from wholebody.config.description import describe
from wholebody.episode.observation import observation_of
from wholebody.episode.result import Note
from wholebody.errors import InputError
from wholebody.execution.planted_feet import taken_to_stand
from wholebody.lending import Lending
from wholebody.planning.judgement.chunk_judge import Begin, ChunkJudge, ChunkJudgement
from wholebody.planning.judgement.limits import Surroundings
from wholebody.planning.plan import ChunkPlan
from wholebody.planning.preparation import prepare
from wholebody.resources import processors
from wholebody.robot.feet import Feet
from wholebody.types import RobotState, check_state
from wholebody.verdict.calibration.model import shipped
from wholebody.verdict.calibration.odds import Odds
from wholebody.verdict.input_steps import far_from_stance, last_step, within
from wholebody.verdict.plan_run import PlanRun, Suspect
from wholebody.verdict.repair import (  # fmt: skip
    MORE,
    MORE_TRIES,
    Change,
    Repairer,
    changed,
    hands_of,
    slowed,
    slower_by,
    towards,
)
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.why.chunk_program import STARTS
from wholebody.verdict.why.explainer import Explainer, would_change
from wholebody.verdict.why.sentence import with_changes

REPLACE_EVERY = 25
"""Steps of a chunk after which the next one is asked for, as in an episode."""
LED_SLOWER, LED_SHARES, LED_MAX = (1.0, 1.5, 2.0, 3.0), (0.5, 1.0), 0.15
"""Slow-downs and shares of the way to a plan that are tried where no single change does, and how far a palm may be led
by an offer [m]; chosen: what a person would still call the same motion, slower or nearer."""
SUSPECTS = 3
"""Chunks that were not followed as given among which the first with a cause is looked for."""
Start = Literal["first", "stance"]


class FastChecker:
    """Judges by plans; nothing is simulated. One thread at a time.

    Args:
        config: Of the robot and its controller. scene: What stands around it: a name of `models.scenes`, or a file.
    """

    def __init__(self, config: ControllerConfig | None = None, scene: str = "floor") -> None:
        self.config = config or ControllerConfig()
        self.spec: RobotSpec = describe(self.config.robot)
        self._scene = scene
        self.judge = self._judge()
        self._settings, usual = asdict(self.config), ControllerConfig()
        self._usual = replace(self.config, loads=usual.loads) == usual

    def _judge(self) -> ChunkJudge:
        return ChunkJudge(self.spec, self.config, None if self._scene == "floor" else self._surroundings())

    def _surroundings(self) -> Surroundings:
        from wholebody.verdict.scene import SceneDistance  # MuJoCo, which nothing else here needs

        return SceneDistance(self.spec, self._scene)

    @cached_property
    def explainer(self) -> Explainer:
        """What looks for causes."""
        return Explainer(self.judge, [self._judge() for _ in range(min(len(processors()), STARTS) - 1)])

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
        # A robot that stands elsewhere has its first plan when that is computed, and later ones as late.
        lead = self.config.planning.lead if start == "stance" else 0.0
        run = PlanRun(self.judge, policy.spec.orientation_free, at_once=True)
        self._play(run, policy, duration, None if start == "first" else self.judge.stance(), lead)
        return within(self._told(run, name, ask_why=ask_why), last_step(policy, duration, run.result.fps))

    def _play(self, run: PlanRun, policy: Policy, duration: float, begin: Begin | None, lead: float = 0.0) -> None:
        """Chunk after chunk for a time [s], begun somewhere or else with the hands at the first step."""
        policy.reset()
        time, end = 0.0, max(duration - 1e-9, 1e-9)  # even the shortest input is asked for once
        while time < end:
            chunk = policy.infer(self._observation(begin or self.judge.stance(), time))
            if begin is None:
                begin = self.judge.first_pose(chunk)
                far = far_from_stance(chunk, self.spec, run.result.orientation_free)
                run.result.notes += [Note(chunk.t_obs, text) for text in far]
            following = REPLACE_EVERY / chunk.fps
            last = time + following >= duration - 1e-9
            begin = run.follow(chunk, begin, time + lead, np.inf if last else time + following + lead)
            time += following

    def first_state(self, policy: Policy) -> RobotState:
        """State at rest, with the hands at the first step of what a policy answers to a robot in its stance."""
        policy.reset()
        body = self.judge.first_pose(policy.infer(self._observation(self.judge.stance(), 0.0))).body
        return RobotState(0.0, body.q, body.v)

    def stand(self, state: RobotState | None = None) -> None:
        """Judge with the feet where a state has them from now on; where the stance has them if it is not given."""
        feet = state and Feet.at(self.spec, self.judge.robot.model, state.q)
        self.judge.stand_on(feet and taken_to_stand(self.spec, self.judge.contacts, feet))

    def of_chunk(
        self,
        chunk: ActionChunk,
        begin: Begin,
        name: str,
        free: tuple[bool, bool],
        *,
        notes: tuple[str, ...] = (),
        ask_why: bool = False,
    ) -> Verdict:
        """Judge a single chunk from where it is begun; notes are told along with its own."""
        run = PlanRun(self.judge, free)
        run.result.notes += [Note(chunk.t_obs, text) for text in notes]
        run.follow(chunk, begin, chunk.t_obs, np.inf)
        return within(self._told(run, name, ask_why=ask_why), len(chunk) - 1)

    def of_plan(
        self, chunk: ActionChunk, plan: ChunkPlan, begin: Begin, now: float, free: tuple[bool, bool]
    ) -> Verdict:
        """Judge what a plan makes of the rest of a chunk, begun somewhere now [s], at the speed of the plan.

        A slow-down is told, and moves nothing. Hands that begin elsewhere, and are on their way for longer than the
        chunk lasts, come to its last step. Room to bounds is not looked at, but for that to the scene.
        """

        def judged(followed: ActionChunk) -> Verdict:
            run, none = PlanRun(self.judge, free, by_path=True), np.zeros((0, 2))
            around = self.judge.around(followed, plan)
            run.follow(followed, begin, now, np.inf, ChunkJudgement(plan, followed.times, none, none, around))
            return run.verdict(f"chunk {chunk.seq}", {})

        verdict, bounds = judged(chunk), self.config.verdict
        elsewhere = verdict.start_m > bounds.palm_feasible or verdict.start_rad > bounds.turn_feasible
        if verdict.verdict == "infeasible" and elsewhere and not verdict.approach_s:
            return judged(_held_until(chunk, plan.end))
        return verdict

    def repairer(
        self, chunk: ActionChunk, begin: Begin | None = None, free: tuple[bool, bool] = (False, False)
    ) -> Repairer:
        """What changes a chunk until it is feasible as `check` plays it; begun as in `Repairer`."""

        def holds(changed: ActionChunk, start: Begin) -> bool:
            return self.of_chunk(changed, start, "", free).verdict == "feasible"

        def lasts(changed: ActionChunk, start: Begin) -> bool:
            run, policy = PlanRun(self.judge, free), ReplayPolicy(changed)
            self._play(run, policy, policy.duration, start)
            return run.verdict("", {}).verdict == "feasible"

        return Repairer(self.judge, chunk, begin, holds, lasts)

    def _told(self, run: PlanRun, name: str, *, ask_why: bool) -> Verdict:
        verdict = replace(run.verdict(name, self._settings), odds=self._odds(run))
        if not ask_why or verdict.verdict == "feasible":
            return verdict
        every = len(run.suspects) <= SUSPECTS
        for suspect in run.suspects[:SUSPECTS]:
            free = run.result.orientation_free
            sound = partial(self._sound, suspect, free)
            told = self.explainer.explained(verdict, suspect, free, run.result.start, sound)
            if told.causes:
                return self._with_some_change(told, suspect, free)
            every = every and told.why_complete
        finds = every and len(run.suspects) > 0 and self.judge.scene is None
        return replace(verdict, search_finds=finds, why_complete=every)

    def _with_some_change(self, verdict: Verdict, suspect: Suspect, free: tuple[bool, bool]) -> Verdict:
        """A verdict whose causes no single change cures, with one of all: slower, and led to where plans have hands."""
        if any(one.chunk is not None for one in verdict.would_do):
            return verdict
        change = self._led(suspect, free)
        if change is None:
            return verdict
        would_do = [would_change(self.judge, suspect.chunk, change), *verdict.would_do]
        alone = len(verdict.causes) == 1
        return replace(
            verdict,
            would_do=would_do,
            causes=[
                with_changes(replace(one, sentence=one.told), would_do) if alone else one for one in verdict.causes
            ],
        )

    def _led(self, suspect: Suspect, free: tuple[bool, bool]) -> Change | None:
        """The chunk led to where plans at several speeds have the hands, half the way if that holds."""
        judge, inside = self.judge, prepare(suspect.chunk, self.judge.planner.hand_limits).chunk
        for factor in LED_SLOWER:
            slow = slowed(inside, factor)
            begin = suspect.begin
            if judge.begins_with(suspect.chunk, begin):
                begin = judge.first_pose(slow)
            plan = judge.planner.plan(slow, suspect.now, begin.body, begin.hands, quick=True)
            goal, given = hands_of(plan, slow), slowed(suspect.chunk, factor)

            def led(share: float, slow: ActionChunk = slow, goal: list = goal, given: ActionChunk = given) -> Change:
                chunk = towards(slow, goal, share, share, judge.planner.offsets)
                return Change("led", factor, *changed(judge, given, chunk), chunk)  # noqa: B023 - called in this round

            for share in LED_SHARES:
                one = led(share)
                if one.moved <= LED_MAX and self._sound(suspect, free, one) is not None:
                    return one
        return None

    def _sound(self, suspect: Suspect, free: tuple[bool, bool], change: Change) -> Change | None:
        """A change, or up to a sixth more of a slow-down, that is feasible when the changed chunk is checked."""
        for more in (MORE**k for k in range(MORE_TRIES)):
            tried = change if more == 1.0 else slower_by(suspect.chunk, change, more)
            begin = suspect.begin
            if self.judge.begins_with(suspect.chunk, begin):
                begin = self.judge.first_pose(tried.chunk)
            run = PlanRun(self.judge, free)
            run.follow(tried.chunk, begin, suspect.now, np.inf)
            if run.verdict("", {}).verdict == "feasible":
                return tried
            if change.kind != "slower":
                break
        return None

    def _odds(self, run: PlanRun) -> Odds | None:
        """What is likely to become of the chunks, each by itself; None of a body that was not learned."""
        if self.spec.body_joints != g1().body_joints:
            return None
        found = {
            "settings": not self._usual,
            "loads": max(self.judge.loads) > 0.0,
            "a start in motion": run.moving,
            "scene": self.judge.scene is not None,
        }
        return shipped().odds(run.quantities, [name for name, unlike in found.items() if unlike])

    def _observation(self, begin: Begin, time: float) -> Observation:
        return observation_of(self.spec, self.judge.robot, RobotState(time, begin.body.q, begin.body.v))


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
    """Judge one chunk without simulating it: a function of its arguments alone, in as many threads as there are.

    Args:
        chunk: What the hands are to do.
        state: Where the robot is and its feet stand; at rest with its hands at the chunk's first step if not given.
        config: Of the robot and its controller.
        scene: What stands around it: a name of `models.scenes`, or a MuJoCo file (.xml).
        orientation_free: Whether nothing is asked of the left and the right palm's orientation.
        ask_why: Look for causes where it is not feasible, which takes seconds.

    Raises:
        ChunkError: If the chunk is malformed.
        InputError: If the state is, or there is no chunk.
    """
    if not isinstance(chunk, ActionChunk):
        raise InputError(
            f"a {type(chunk).__name__} is no ActionChunk; `policy.decode` makes one of actions, and "
            "`policy.ReplayPolicy.from_npz(path).episode` is that of a file"
        )
    with checkers.lend(config or ControllerConfig(), scene) as checker:
        chunk.validate(robot=layout_robot(checker.spec))
        checker.stand(None if state is None else check_state(state, checker.spec.n_joints))
        if state is None:
            begin, notes = checker.judge.first_pose(chunk), far_from_stance(chunk, checker.spec, orientation_free)
        else:
            begin, notes = checker.judge.present(state), ()
        return checker.of_chunk(chunk, begin, f"chunk {chunk.seq}", orientation_free, notes=notes, ask_why=ask_why)


checkers = Lending(FastChecker)
"""One for settings and a scene, lent to a thread at a time."""
