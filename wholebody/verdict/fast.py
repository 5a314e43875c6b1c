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
from policy.observation import Observation
from policy.recorded.replay import ReplayPolicy
from wholebody.config import ControllerConfig
from wholebody.config.bounds import require_run
from wholebody.config.description import describe
from wholebody.episode.observation import observation_of
from wholebody.episode.result import Note
from wholebody.execution.planted_feet import taken_to_stand
from wholebody.lending import Lending
from wholebody.planning.judgement.chunk_judge import Begin, ChunkJudge, ChunkJudgement
from wholebody.planning.judgement.limits import Surroundings
from wholebody.planning.plan import ChunkPlan
from wholebody.planning.preparation import prepare
from wholebody.resources import processors
from wholebody.robot.feet import Feet
from wholebody.types import RobotState
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
from wholebody.verdict.why.single_changes import MOVED_MOST

REPLACE_EVERY = 25
"""Steps of a chunk after which the next one is asked for, as in an episode."""
LED_SLOWER, LED_SHARES, LED_ROUNDS = (1.0, 1.5, 2.0, 3.0), (0.5, 1.0), 2
"""Slow-downs and shares of the way to a plan that are tried where no single change does, and how often: what is led to
a plan may have another one, nearer by [no unit]; chosen, no trial is on record."""
WHOLE_STEPS, WHOLE_TIME = 150, 5.0
"""Steps and time of a recording up to which causes, and what would do, are looked for in all of it and not in a window
[no unit, s]; chosen: three windows, a search of seconds."""
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

        return SceneDistance(self.spec, self._scene, self.config.verdict.palm_feasible)

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
        run.placed = start == "first"
        begin = self._play(run, policy, duration, None if run.placed else self.judge.stance(), lead)
        if ask_why and (whole := self._whole(run, policy, duration, begin, lead)) is not None:
            run.suspects.insert(0, whole)
        return self._told(run, name, last_step(policy, duration, run.result.fps), ask_why=ask_why)

    def _whole(self, run: PlanRun, policy: Policy, duration: float, begin: Begin, lead: float) -> Suspect | None:
        """A short recording as one chunk, begun there, where a chunk of it is not followed as given."""
        episode = getattr(policy, "episode", None)
        if not run.suspects or episode is None or len(episode) > WHOLE_STEPS or duration > WHOLE_TIME:
            return None
        chunk = replace(episode, t_obs=run.result.start)
        now = chunk.t_obs + lead
        plan = self.judge.planner.plan(chunk, now, begin.body, begin.hands, begin.before, quick=True, hold=True)
        return Suspect(chunk, begin, now, plan)

    def _play(self, run: PlanRun, policy: Policy, duration: float, begin: Begin | None, lead: float = 0.0) -> Begin:
        """Chunk after chunk for a time [s], begun somewhere or with the hands at the first step; where it was begun."""
        policy.reset()
        first = begin
        time, end = 0.0, max(duration - 1e-9, 1e-9)  # even the shortest input is asked for once
        while time < end:
            chunk = policy.infer(self._observation(begin or self.judge.stance(), time))
            if begin is None:
                begin = first = self.judge.first_pose(chunk)
                far = far_from_stance(chunk, self.spec, run.result.orientation_free)
                run.result.notes += [Note(chunk.t_obs, text) for text in far]
            following = REPLACE_EVERY / chunk.fps
            last = time + following >= duration - 1e-9
            begin = run.follow(chunk, begin, time + lead, np.inf if last else time + following + lead)
            time += following
        return first or self.judge.stance()

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
        placed: bool = True,
        ask_why: bool = False,
    ) -> Verdict:
        """Judge a single chunk from where it is begun; notes are told along with its own.

        A robot that was ``placed`` with its hands at the first step is so for a changed chunk, too.
        """
        run = PlanRun(self.judge, free)
        run.placed = placed
        run.result.notes += [Note(chunk.t_obs, text) for text in notes]
        run.follow(chunk, begin, chunk.t_obs, np.inf)
        return self._told(run, name, len(chunk) - 1, ask_why=ask_why)

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

    def _told(self, run: PlanRun, name: str, last: int, *, ask_why: bool) -> Verdict:
        """What is told of a run whose input has its last step there; then it is held."""
        verdict = replace(run.verdict(name, self._settings), odds=self._odds(run))
        if ask_why and verdict.verdict != "feasible":
            verdict = self._explained(verdict, run, last / run.result.fps)
        return within(verdict, last)

    def _explained(self, verdict: Verdict, run: PlanRun, end: float) -> Verdict:
        """A verdict with the causes of the first chunk that has any, and what would do for it, or for the first one."""
        free, every = run.result.orientation_free, len(run.suspects) <= SUSPECTS
        for suspect in run.suspects[:SUSPECTS]:
            sound = partial(self._sound, run, suspect)
            told = self.explainer.explained(verdict, suspect, free, run.result.start, sound, end)
            if told.causes:
                return self._with_some_change(told, run, suspect)
            every = every and told.why_complete
        finds = every and len(run.suspects) > 0 and self.judge.scene is None
        verdict = replace(verdict, search_finds=finds, why_complete=every)
        return self._with_some_change(verdict, run, run.suspects[0]) if run.suspects else verdict

    def _with_some_change(self, verdict: Verdict, run: PlanRun, suspect: Suspect) -> Verdict:
        """A verdict that no single change cures, with one of all: slower, and led to where plans have the hands."""
        if any(one.chunk is not None for one in verdict.would_do):
            return verdict
        change = self._led(run, suspect)
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

    def _led(self, run: PlanRun, suspect: Suspect) -> Change | None:
        """The chunk led to where plans at several speeds have the hands, half the way if that holds."""
        judge, inside = self.judge, prepare(suspect.chunk, self.judge.planner.hand_limits).chunk
        for factor in LED_SLOWER:
            chunk, given = slowed(inside, factor), slowed(suspect.chunk, factor)
            for _ in range(LED_ROUNDS):
                begin = self._begun(run, suspect, chunk)
                plan = judge.planner.plan(chunk, suspect.now, begin.body, begin.hands, quick=True, hold=True)
                goal = hands_of(plan, chunk)
                for share in LED_SHARES:
                    led = towards(chunk, goal, share, share, judge.planner.offsets)
                    one = Change("led", factor, *changed(judge, given, led), led)
                    if one.moved <= MOVED_MOST and self._sound(run, suspect, one) is not None:
                        return one
                chunk = led
        return None

    def _begun(self, run: PlanRun, suspect: Suspect, changed: ActionChunk) -> Begin:
        """Where a changed chunk is begun: with its own first step where the robot was placed there."""
        placed = run.placed and self.judge.begins_with(suspect.chunk, suspect.begin)
        return self.judge.first_pose(changed) if placed else suspect.begin

    def _sound(self, run: PlanRun, suspect: Suspect, change: Change) -> Change | None:
        """A change, or up to a sixth more of a slow-down, that is feasible as the changed chunk is played."""
        lead = suspect.now - suspect.chunk.t_obs
        for more in (MORE**k for k in range(MORE_TRIES)):
            tried = change if more == 1.0 else slower_by(suspect.chunk, change, more)
            again, policy = PlanRun(self.judge, run.result.orientation_free, at_once=True), ReplayPolicy(tried.chunk)
            self._play(again, policy, policy.duration, self._begun(run, suspect, tried.chunk), lead)
            if again.verdict("", {}).verdict == "feasible":
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


checkers = Lending(FastChecker)
"""One for settings and a scene, lent to a thread at a time."""
