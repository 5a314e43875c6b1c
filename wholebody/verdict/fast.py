"""Judge inputs by their plans alone: what would be commanded, chunk after chunk, if the robot followed every plan."""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.base import Policy
from policy.chunk import ActionChunk
from policy.observation import Observation
from policy.recorded.replay import ReplayPolicy, needed_until
from wholebody.config import ControllerConfig
from wholebody.config.bounds import require_run
from wholebody.config.description import describe
from wholebody.episode.observation import observation_of
from wholebody.execution.planted_feet import taken_to_stand
from wholebody.lending import Lending
from wholebody.planning.judgement.chunk_judge import Begin, ChunkJudge, ChunkJudgement
from wholebody.planning.judgement.limits import Surroundings
from wholebody.planning.judgement.sketch import Sketches
from wholebody.planning.plan import ChunkPlan
from wholebody.resources import processors
from wholebody.robot.feet import Feet
from wholebody.types import Reason, RobotState
from wholebody.verdict.calibration.model import shipped
from wholebody.verdict.calibration.odds import Odds
from wholebody.verdict.causes import WouldDo
from wholebody.verdict.input_steps import far_from_stance, last_step, row_rate, within
from wholebody.verdict.plan_run import PlanRun, Played, Suspect
from wholebody.verdict.repair import Repairer
from wholebody.verdict.verdict import Verdict

if TYPE_CHECKING:
    from wholebody.verdict.why.explainer import Explainer

REPLACE_EVERY = 25
"""Steps of a chunk after which the next one is asked for, as in an episode."""
WHOLE_STEPS, WHOLE_TIME = 150, 5.0
"""Steps and time of a recording up to which causes, and what would do, are looked for in all of it and not in a window
[no unit, s]; chosen: three windows, a search of seconds."""
MOVING = 0.05
"""Speed of a hand from which a chunk is begun in motion [m/s]; chosen: what stops within a few millimetres."""
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
    def sketches(self) -> Sketches:
        """What says roughly what many chunks come to."""
        return Sketches(self.judge.planner, self.config.verdict.palm_feasible, self.config.verdict.turn_feasible)

    @cached_property
    def explainer(self) -> Explainer:
        """What looks for causes."""
        from wholebody.verdict.why.chunk_program import STARTS
        from wholebody.verdict.why.explainer import Explainer

        return Explainer(self.judge, [self._judge() for _ in range(min(len(processors()), STARTS) - 1)])

    def check(
        self,
        policy: Policy,
        name: str,
        duration: float,
        *,
        start: Start = "first",
        ask_why: bool = False,
        odds: bool = True,
    ) -> Verdict:
        """Judge what a policy would command if every plan was followed exactly.

        Args:
            policy: Source of the chunks; it sees the planned robot.
            name: What to call the input.
            duration: Time for which chunks are asked for [s].
            start: Whether the robot stands with its hands where the first chunk begins, or in the stance.
            ask_why: Look for causes, which takes seconds.
            odds: Tell the odds of a fall, which take a third of the time.

        Raises:
            InputError: If the duration is negative or longer than six hours.
        """
        require_run("duration", duration)
        # A robot that stands elsewhere has its first plan when that is computed, and later ones as late: the tick in
        # which a chunk comes is one of the lead. Of hands on their way a tick makes another plan.
        lead = max(self.config.planning.lead - self.config.dt, 0.0) if start == "stance" else 0.0
        episode = getattr(policy, "episode", None)
        end, rows = np.inf if episode is None else (len(episode) - 1) / episode.fps, row_rate(policy)
        run = PlanRun(self.judge, policy.spec.orientation_free, at_once=True, end=end, odds=odds)
        placed = start == "first"
        played, begin = self._play(run, policy, duration, None if placed else self.judge.stance(), lead)
        verdict, fps = self._verdict(run, played, name), played[0].opening.fps
        last = last_step(policy, duration, fps)
        if ask_why and verdict.verdict != "feasible":
            from wholebody.verdict.why.of_run import RunExplainer

            whole = self._whole(policy, duration, begin, lead)
            explain = RunExplainer(self.judge, self.explainer, run, played, self._play, whole, rows=rows)
            verdict = explain.explained(verdict, last / fps)
            if (episode := getattr(policy, "episode", None)) is not None:
                verdict = self._with_steps(verdict, episode, run.free)
        if not placed and verdict.verdict != "feasible" and any(x.code is Reason.FAR_START for x in verdict.violations):
            elsewhere = self.check(policy, name, duration, odds=False)
            begun = [WouldDo("start")] if elsewhere.verdict == "feasible" else []
            verdict = replace(verdict, would_do=[*begun, *verdict.would_do])
        return within(verdict, last, rows)

    def _whole(self, policy: Policy, duration: float, begin: Begin, lead: float) -> Suspect | None:
        """A short recording as one chunk, begun there."""
        episode = getattr(policy, "episode", None)
        if episode is None or len(episode) > WHOLE_STEPS or duration > WHOLE_TIME:
            return None
        chunk = replace(episode, t_obs=0.0)
        plan = self.judge.planner.plan(chunk, lead, begin.body, begin.hands, begin.before, quick=True, hold=True)
        return Suspect(chunk, begin, lead, plan)

    def _play(
        self, run: PlanRun, policy: Policy, duration: float, begin: Begin | None, lead: float = 0.0
    ) -> tuple[tuple[Played, ...], Begin]:
        """Chunk after chunk for a time [s], begun somewhere or with the hands at the first step; where it was begun."""
        policy.reset()
        first, played, state, notes = begin, list[Played](), None, tuple[str, ...]()
        time, last, needed = 0.0, False, needed_until(policy, duration)
        while not last:
            chunk = policy.infer(self._observation(begin or self.judge.stance(), time))
            if begin is None:
                begin = first = self.judge.first_pose(chunk)
                notes = far_from_stance(chunk, self.spec, run.free)
            following = REPLACE_EVERY / chunk.fps
            last = max(time + following, chunk.times[-1] - needed + duration) >= duration - 1e-9
            until = np.inf if last else time + following + lead
            one, state = run.follow(chunk, begin, time + lead, until, state, notes=notes)
            begin, notes = state.begin, ()
            played.append(one)
            time += following
        return tuple(played), first or self.judge.stance()

    def first_state(self, policy: Policy) -> RobotState:
        """State at rest, with the hands at the first step of what a policy answers to a robot in its stance."""
        policy.reset()
        body = self.judge.first_pose(policy.infer(self._observation(self.judge.stance(), 0.0))).body
        return RobotState(0.0, body.q, body.v)

    def stand(self, state: RobotState | None = None) -> None:
        """Judge with the feet where a state has them from now on; where the stance has them if it is not given."""
        if state is None:
            self.judge.stand_on(None)
            return
        feet = Feet.at(self.spec, self.judge.robot.model, state.q, self.judge.robot.scratch)
        self.judge.stand_on(taken_to_stand(self.spec, self.judge.contacts, feet))

    def of_chunk(
        self,
        chunk: ActionChunk,
        begin: Begin,
        name: str,
        free: tuple[bool, bool],
        *,
        notes: tuple[str, ...] = (),
        ask_why: bool = False,
        odds: bool = True,
    ) -> Verdict:
        """Judge a single chunk from where it is begun; notes are told along with its own, ``odds`` where asked for."""
        run = PlanRun(self.judge, free, odds=odds)
        one, state = run.follow(chunk, begin, chunk.t_obs, notes=notes)
        verdict, last = self._verdict(run, (one,), name), len(chunk) - 1
        if ask_why and verdict.verdict != "feasible":
            from wholebody.verdict.why.of_run import RunExplainer

            whole = Suspect(chunk, begin, chunk.t_obs, state.judged.plan)
            explainer = RunExplainer(self.judge, self.explainer, run, (one,), self._play, whole, at_once=True)
            verdict = self._with_steps(explainer.explained(verdict, last / chunk.fps), chunk, free)
        return within(verdict, last)

    def _with_steps(self, verdict: Verdict, chunk: ActionChunk, free: tuple[bool, bool]) -> Verdict:
        """A verdict with the steps to where a chunk is feasible, if that would do."""
        from wholebody.verdict.why.steps import with_steps

        def check(moved: ActionChunk) -> Verdict:
            return self.of_chunk(moved, self.judge.first_pose(moved), verdict.name, free, odds=False)

        return with_steps(verdict, chunk, self.judge, self.config, check)

    def of_plan(
        self, chunk: ActionChunk, plan: ChunkPlan, begin: Begin, now: float, free: tuple[bool, bool]
    ) -> Verdict:
        """Judge what a plan makes of the rest of a chunk, begun somewhere now [s], at the speed of the plan.

        A slow-down is told, and moves nothing. Hands that begin elsewhere, and are on their way for longer than the
        chunk lasts, come to its last step. Room to bounds is not looked at, but for that to the scene.
        """

        def judged(followed: ActionChunk) -> Verdict:
            run, none = PlanRun(self.judge, free, by_path=True), np.zeros((0, 2))
            found = ChunkJudgement(plan, followed.times, none, none, self.judge.around(followed, plan))
            one, _ = run.follow(followed, begin, now, found=found)
            return run.verdict((one,), f"chunk {chunk.seq}")

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
            return self.of_chunk(changed, start, "", free, odds=False).verdict == "feasible"

        def lasts(changed: ActionChunk, start: Begin) -> bool:
            run, policy = PlanRun(self.judge, free), ReplayPolicy(changed)
            played, _ = self._play(run, policy, policy.duration, start)
            return run.verdict(played).verdict == "feasible"

        return Repairer(self.judge, chunk, begin, holds, lasts)

    def _verdict(self, run: PlanRun, played: tuple[Played, ...], name: str) -> Verdict:
        """Verdict on a run, without causes."""
        return replace(run.verdict(played, name, self._settings), odds=self._odds(played))

    def _odds(self, played: tuple[Played, ...]) -> Odds | None:
        """What is likely to become of the chunks, each by itself; None of a body that was not learned."""
        if self.spec.body_joints != g1().body_joints:
            return None
        collected = [one.planned.quantities for one in played if one.planned.quantities]
        found = {
            "settings": not self._usual,
            "loads": max(self.judge.loads) > 0.0,
            "a start in motion": any(one["start_speed"] > MOVING for _, one in collected),
            "scene": self.judge.scene is not None,
        }
        return shipped().odds(collected, [name for name, unlike in found.items() if unlike])

    def _observation(self, begin: Begin, time: float) -> Observation:
        return observation_of(self.spec, self.judge.robot, RobotState(time, begin.body.q, begin.body.v))


def _held_until(chunk: ActionChunk, end: float) -> ActionChunk:
    """A chunk whose last step is held until a time after its first one [s]."""
    steps = np.minimum(np.arange(max(int(np.ceil(end * chunk.fps)) + 1, len(chunk))), len(chunk) - 1)
    return replace(chunk, **{name: value[steps] for name, value in chunk.arrays().items()})


checkers = Lending(FastChecker)
"""One for settings and a scene, lent to a thread at a time."""
