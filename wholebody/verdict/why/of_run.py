"""Why an input is not done as given, and what would do: of its chunks the first that has a cause, changes of it all."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from policy.base import Policy
from policy.chunk import ActionChunk
from policy.recorded.replay import ReplayPolicy
from wholebody.planning.judgement.chunk_judge import Begin, ChunkJudge
from wholebody.planning.preparation import prepare
from wholebody.verdict.plan_run import PlanRun, Played, Suspect
from wholebody.verdict.repair import (  # fmt: skip
    MORE,
    MORE_TRIES,
    Change,
    changed,
    hands_of,
    in_range,
    slowed,
    slower_by,
    towards,
)
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.why.explainer import Explainer, would_change
from wholebody.verdict.why.single_changes import MOVED_MOST

LED_SLOWER, LED_SHARES, LED_ROUNDS = (1.0, 1.5, 2.0, 3.0), (0.5, 1.0), 2
"""Slow-downs and shares of the way to a plan that are tried where no single change does, and how often: what is led to
a plan may have another one, nearer by [no unit]; chosen, no trial is on record."""
HALVINGS = 4
"""Halvings of a slow-down between two of those; derived: to 3 % of it."""
ROUNDING = 1e-8
"""How far a wrist is from where it is meant when a file rounds it [m]; derived: numbers of 32 bits within half a metre.
Searches that end within their budget may come to another plan by that, with palms turned by 2 degrees more."""
SUSPECTS = 3
"""Chunks that were not followed as given among which the first with a cause is looked for."""

Play = Callable[[PlanRun, Policy, float, Begin, float], tuple[Sequence[Played], Begin]]
"""Chunk after chunk of a policy, for a time [s], begun somewhere, so much before its plan [s]; where it was begun."""


@dataclass(frozen=True)
class RunExplainer:
    """Explains one run.

    Attributes:
        judge: What planned it.
        explainer: Looks for causes of one chunk.
        run: How it was played.
        played: The run.
        play: Plays an input as that was played.
        whole: All of the input as one chunk, where it is short enough: what would do is a change of all of it. None
            where that is too long: a change is of the one chunk then, begun where that is.
        at_once: Whether the input is that one chunk, planned at once, and is not played window after window.
        rows: Rows of the input a second, where those are not the steps [Hz].
    """

    judge: ChunkJudge
    explainer: Explainer
    run: PlanRun
    played: Sequence[Played]
    play: Play
    whole: Suspect | None
    at_once: bool = False
    rows: float = 0.0

    def explained(self, verdict: Verdict, end: float) -> Verdict:
        """A verdict with the causes of the first chunk that has any, and what would do.

        Args:
            verdict: On the input, which is not feasible.
            end: Time of its last step since its first one [s]; then it is held.
        """
        suspects = [one.planned.suspect for one in self.played if one.planned.suspect]
        every_own, start = [] if self.at_once else suspects, self.played[0].opening.start
        asked = [self._own(one) for one in every_own[:SUSPECTS]]
        asked = asked if self.whole is None else [self._clean(self.whole), *asked]
        if not asked:
            return verdict
        if not suspects:
            return self._with_change(verdict, asked[0], self._as_it_is(asked[0]))
        of_all, every = asked[0], len(every_own) <= SUSPECTS
        for suspect in asked[:SUSPECTS]:
            sound = None if self.whole is not None and suspect is not of_all else partial(self._sound, suspect)
            found = self.explainer.explained(verdict, suspect, self.run.free, start, sound, end, self.rows)
            if found.causes:
                return self._with_some_change(found, suspect if self.whole is None else of_all)
            every = every and found.why_complete
        verdict = replace(verdict, search_finds=every and self.judge.scene is None, why_complete=every)
        return self._with_some_change(verdict, of_all)

    def _own(self, suspect: Suspect) -> Suspect:
        """A chunk without what only holds the end of the input."""
        clean = self._clean(suspect)
        chunk, begin = self.run.own(clean.chunk, self.played[0].opening), suspect.begin
        if chunk is clean.chunk:
            return clean
        plan = self.judge.planner.plan(chunk, suspect.now, begin.body, begin.hands, begin.before, quick=True, hold=True)
        return Suspect(chunk, begin, suspect.now, plan)

    def _clean(self, suspect: Suspect) -> Suspect:
        """A chunk whose numbers are those in their range: a change of it is no longer of the others."""
        return replace(suspect, chunk=in_range(suspect.chunk))

    def _with_some_change(self, verdict: Verdict, suspect: Suspect) -> Verdict:
        """A verdict that no single change cures, with one of all: slower, and led to where plans have the hands."""
        if any(one.chunk is not None for one in verdict.would_do):
            return verdict
        change = self._as_it_is(suspect) or (None if verdict.causes else self._slower(suspect)) or self._moved(suspect)
        return self._with_change(verdict, suspect, change)

    def _with_change(self, verdict: Verdict, suspect: Suspect, change: Change | None) -> Verdict:
        if change is None:
            return verdict
        since = suspect.chunk.t_obs - self.played[0].opening.start
        return replace(verdict, would_do=[would_change(self.judge, suspect.chunk, change, since), *verdict.would_do])

    def _as_it_is(self, suspect: Suspect) -> Change | None:
        """The chunk with no more than its numbers in their range."""
        inside = prepare(suspect.chunk, self.judge.planner.hand_limits).chunk
        one = Change("combined", 1.0, *changed(self.judge, suspect.chunk, inside), inside)
        return self._sound(suspect, one) if one.moved <= MOVED_MOST else None

    def _slower(self, suspect: Suspect) -> Change | None:
        """The least slow-down, where searches find a motion and windows one after the other do not."""

        def at(factor: float) -> Change:
            return Change("slower", factor, 0.0, 0.0, slowed(suspect.chunk, factor))

        factors = [x for x in LED_SLOWER if x > 1.0]
        high = next((x for x in factors if self._plays(suspect, at(x).chunk)), None)
        if high is None:
            return None
        low = max(x for x in LED_SLOWER if x < high)
        for _ in range(HALVINGS):
            middle = float(np.sqrt(low * high))
            low, high = (low, middle) if self._plays(suspect, at(middle).chunk) else (middle, high)
        return at(high)

    def _moved(self, suspect: Suspect) -> Change | None:
        """The chunk led to where plans at several speeds have the hands, half the way if that holds."""
        judge, inside = self.judge, prepare(suspect.chunk, self.judge.planner.hand_limits).chunk
        for factor in LED_SLOWER:
            chunk, given = slowed(inside, factor), slowed(suspect.chunk, factor)
            for _ in range(LED_ROUNDS):
                begin = self._begun(suspect, chunk)
                plan = judge.planner.plan(chunk, suspect.now, begin.body, begin.hands, quick=True, hold=True)
                goal = hands_of(plan, chunk)
                for share in LED_SHARES:
                    led = towards(chunk, goal, share, share, judge.planner.offsets)
                    one = Change("combined", factor, *changed(judge, given, led), led)
                    if one.moved <= MOVED_MOST and self._sound(suspect, one) is not None:
                        return one
                chunk = led
        return None

    def _begun(self, suspect: Suspect, changed: ActionChunk) -> Begin:
        """Where a changed chunk is begun: with its own first step where the robot was placed there."""
        return self.judge.first_pose(changed) if suspect.begin.placed else suspect.begin

    def _sound(self, suspect: Suspect, change: Change) -> Change | None:
        """A change, or up to a sixth more of a slow-down, that is feasible as the changed chunk is judged."""
        for more in (MORE**k for k in range(MORE_TRIES)):
            tried = change if more == 1.0 else slower_by(suspect.chunk, change, more)
            if self._plays(suspect, tried.chunk):
                return tried
            if change.kind != "slower":
                break
        return None

    def _plays(self, suspect: Suspect, chunk: ActionChunk) -> bool:
        """Whether a changed chunk is feasible, and stays so when it is rounded, which may lead to other plans."""
        return all(self._plays_so(suspect, one) for one in (chunk, *rounded(chunk)))

    def _plays_so(self, suspect: Suspect, chunk: ActionChunk) -> bool:
        """Whether a chunk is feasible as it is played, and at once where the input is judged so."""
        policy, begin = ReplayPolicy(chunk), self._begun(suspect, chunk)
        run = PlanRun(self.judge, self.run.free, at_once=True)
        played, _ = self.play(run, policy, policy.duration, begin, suspect.now - suspect.chunk.t_obs)
        if run.verdict(played).verdict != "feasible":
            return False
        if not self.at_once:
            return True
        run = PlanRun(self.judge, self.run.free)
        one, _ = run.follow(chunk, begin, chunk.t_obs)
        return run.verdict((one,)).verdict == "feasible"


def rounded(chunk: ActionChunk) -> Iterator[ActionChunk]:
    """The chunk as files may have it: wrists in numbers of 32 bits, and `ROUNDING` to either side."""
    T = np.stack([chunk.T_world_lhand, chunk.T_world_rhand])
    p = T[..., :3, 3].copy()
    for points in (p.astype(np.float32), p + ROUNDING, p - ROUNDING):
        T[..., :3, 3] = points
        left, right = T.copy()
        yield replace(chunk, T_world_lhand=left, T_world_rhand=right)
