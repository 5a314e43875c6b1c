"""A whole episode made feasible by its plans: slowed down first, else its hands led to where its plans command them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.rotations import angle_between
from policy.recorded.replay import ReplayPolicy
from wholebody.planning.judgement.chunk_judge import Begin
from wholebody.planning.preparation import prepare
from wholebody.verdict.fast import REPLACE_EVERY, FastChecker, Start
from wholebody.verdict.repair import slowed

SLOWER_FACTORS = (1.25, 1.6, 2.0, 3.0, 4.0)
"""Each a factor on the time of an episode, of which the least that does is taken; chosen: steps of a quarter."""


@dataclass(frozen=True)
class EpisodeRepair:
    """What an episode becomes.

    Attributes:
        episode: As changed, feasible by its plans.
        slower: Factor on its time; 1 is unslowed.
        moved, turned: How far a palm is at most from where it was asked to be [m], [rad].
    """

    episode: ActionChunk
    slower: float
    moved: float
    turned: float


class EpisodeRepairer:
    """Changes one episode.

    Args:
        checker: Judges by plans.
        policy: Plays the episode.
        start: Where the robot is, as in `FastChecker.check`.
    """

    def __init__(self, checker: FastChecker, policy: ReplayPolicy, start: Start) -> None:
        self._checker, self._policy, self._start = checker, policy, start

    def holds(self, episode: ActionChunk) -> bool:
        """Whether an episode is feasible unchanged."""
        played = ReplayPolicy(episode, name=self._policy.name, spec=self._policy.spec, horizon=self._policy.horizon)
        verdict = self._checker.check(played, played.name, played.duration, start=self._start, odds=False)
        return verdict.verdict == "feasible"

    def slower(self) -> float | None:
        """Least of `SLOWER_FACTORS` with which it is feasible; None without any."""
        episode = self._policy.episode

        def does(factor: float) -> bool:
            return self.holds(slowed(episode, factor))

        return next(filter(does, SLOWER_FACTORS[:-1]), SLOWER_FACTORS[-1]) if does(SLOWER_FACTORS[-1]) else None

    def repaired(self, factor: float | None, *, retimed: bool = True) -> EpisodeRepair | None:
        """Slower by a factor that makes it feasible, else led; None if that would be another motion.

        Args:
            factor: As of `slower`; None if no speed makes it feasible.
            retimed: Whether it may take longer.
        """
        if factor is not None and retimed:
            return EpisodeRepair(slowed(self._policy.episode, factor), factor, 0.0, 0.0)
        speeds = (1.0, *self._checker.config.planner.slowdowns) if retimed else (1.0,)
        return next(filter(None, map(self._moved, speeds)), None)

    def _moved(self, factor: float) -> EpisodeRepair | None:
        """The episode at a speed, with its hands where its plans command them."""
        asked, judge = slowed(self._policy.episode, factor), self._checker.judge
        led = self._commanded(prepare(asked, judge.planner.hand_limits).chunk)
        if led is None:
            return None
        (p, R), (q, S) = judge.asked(asked), judge.asked(led)
        moved, turned = float(np.linalg.norm(p - q, axis=2).max()), float(angle_between(R, S).max())
        bounds = self._checker.config.verdict
        if moved > bounds.palm_repair or turned > bounds.turn_repair or not self.holds(led):
            return None
        return EpisodeRepair(led, factor, moved, turned)

    def _commanded(self, episode: ActionChunk) -> ActionChunk | None:
        """Where the plans of an episode command the hands, chunk after chunk; None where there is no safe plan."""
        judge, n = self._checker.judge, len(episode)
        out = [episode.T_world_lhand.copy(), episode.T_world_rhand.copy()]
        begin: Begin | None = judge.stance() if self._start == "stance" else None
        for first in range(0, n, REPLACE_EVERY):
            chunk = _window(episode, first, self._policy.horizon)
            begin = judge.first_pose(chunk) if begin is None else begin
            plan = judge.judge(chunk, begin).plan
            if not plan.report.safe:
                return None
            steps = np.arange(first, min(first + REPLACE_EVERY, n))
            s = plan.start + plan.rate * (steps - first) / episode.fps
            for T, path in zip(out, plan.paths, strict=True):
                T[steps] = path.sample(s).T_world_hand
            begin = judge.later(plan, REPLACE_EVERY / episode.fps)
        return replace(episode, T_world_lhand=out[0], T_world_rhand=out[1])


def _window(episode: ActionChunk, first: int, horizon: int) -> ActionChunk:
    """The steps from one on, the last one held after the end, as `ReplayPolicy` serves them."""
    steps = np.minimum(first + np.arange(horizon), len(episode) - 1)
    arrays = {name: values[steps] for name, values in episode.arrays().items()}
    return replace(episode, seq=first, t_obs=first / episode.fps, notes=(), **arrays)
