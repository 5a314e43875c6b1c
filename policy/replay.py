"""Policies that play back what was recorded."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from policy.chunk import ActionChunk
from policy.clock import EpisodeClock
from policy.layouts import builtin
from policy.motion_csv import DEFAULT_FPS, motion_chunk, read_motion_csv
from policy.observation import Observation
from policy.spec import ActionSpec


class ReplayPolicy:
    """Serves one long chunk in windows.

    Windows start on the recording's own steps, the last one at or before the observation, so nothing is resampled and
    successive chunks agree exactly. After the end the last pose is held. Episode time is 0 at the first observation
    after `reset`.

    Args:
        episode: The whole recording, anchored in world; its t_obs is ignored.
        name: What the CLI and reports call it.
        spec: Layout that it was decoded from; wbc32 if None.
        horizon: Steps per chunk.
    """

    sees_robot = False

    def __init__(
        self, episode: ActionChunk, *, name: str = "replay", spec: ActionSpec | None = None, horizon: int = 50
    ) -> None:
        episode.validate()
        self.name, self.episode, self.horizon = name, episode, horizon
        self.spec = builtin("wbc32") if spec is None else spec
        self.duration = (len(episode) - 1) / episode.fps
        self._clock = EpisodeClock()

    @classmethod
    def from_csv(cls, path: str | Path, *, fps: float = DEFAULT_FPS, horizon: int = 50) -> ReplayPolicy:
        """Play a motion CSV, anchored at the nominal stance.

        Raises:
            FileFormatError: If the file is malformed.
        """
        return cls(motion_chunk(read_motion_csv(path, fps)), name=Path(path).stem, horizon=horizon)

    def reset(self, task: str = "") -> None:
        """Begin the recording anew at the next observation."""
        self._clock.reset()

    def infer(self, observation: Observation) -> ActionChunk:
        """Window that starts at the observation's time or up to one step before it.

        Raises:
            ObservationError: If time goes back without a reset.
        """
        seq, elapsed = self._clock.tick(observation.time)
        # A time that is a step but for rounding must find that step.
        first = int(np.floor(elapsed * self.episode.fps + 1e-6))
        steps = np.minimum(first + np.arange(self.horizon), len(self.episode) - 1)
        t_obs = observation.time - elapsed + first / self.episode.fps
        window = {name: value[steps] for name, value in self.episode.arrays().items()}
        return dataclasses.replace(self.episode, seq=seq, t_obs=t_obs, **window)
