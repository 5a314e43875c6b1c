"""Policies that play back what was recorded."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from math import inf
from pathlib import Path

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.builtin import builtin
from policy.action_spec.spec import ActionSpec
from policy.chunk import ActionChunk
from policy.clock import EpisodeClock
from policy.dataset.inspection import action_findings, read_as_said, settled, spec_as_said, with_notes
from policy.errors import FileFormatError
from policy.geometry.rotations import matrix_to_quaternion
from policy.observation import Observation
from policy.recorded.array_file import RATE_ASSUMED, read_array_file
from policy.recorded.chunk_file import read_chunk_file
from policy.recorded.motion_csv import DEFAULT_FPS, Motion, motion_chunk, named_rate, rate_note, read_motion_csv
from policy.recorded.motion_findings import motion_findings
from policy.recorded.motion_npz import is_motion_npz, read_motion_npz


class ReplayPolicy:
    """Serves one long chunk in windows.

    Windows start on the recording's own steps, the last one at or before the observation, so nothing is resampled and
    successive chunks agree exactly. The last window ends with the recording, in motion if that does: to stop is no part
    of it. After that, and where less than half a window is left, the last pose is held. Episode time is 0 at the first
    observation after `reset`.

    Args:
        episode: The whole recording, anchored in world; its t_obs is ignored.
        name: What the CLI and reports call it.
        spec: Layout that it was decoded from; wbc32 if None.
        horizon: Steps per chunk.
        row_fps: Rows a second of the file that it is of, where those are not its steps [Hz]; 0 where they are.
    """

    sees_robot = False

    def __init__(
        self, episode: ActionChunk, *, name: str = "replay", spec: ActionSpec | None = None, horizon: int = 50,
        row_fps: float = 0.0,
    ) -> None:  # fmt: skip
        self.spec = builtin("wbc32") if spec is None else spec
        episode.validate(robot=self.spec.robot)
        self.name, self.episode, self.horizon, self.row_fps = name, episode, horizon, row_fps
        self.duration = (len(episode) - 1) / episode.fps
        self._clock = EpisodeClock()

    def held(self, seconds: float) -> ReplayPolicy:
        """Recording with its first step held for the fewest steps that last so long [s]."""
        more = int(np.ceil(seconds * self.episode.fps - 1e-6))
        steps = np.maximum(np.arange(-more, len(self.episode)), 0)
        longer = {name: value[steps] for name, value in self.episode.arrays().items()}
        episode = dataclasses.replace(self.episode, **longer)
        return ReplayPolicy(episode, name=self.name, spec=self.spec, horizon=self.horizon, row_fps=self.row_fps)

    @classmethod
    def from_npz(
        cls,
        path: str | Path,
        *,
        assume: ActionSpec | None = None,
        horizon: int = 50,
        robot: RobotSpec | None = None,
    ) -> ReplayPolicy:
        """Play a chunk file, anchored once where the file says, or at the nominal stance of the robot (g1() if None).

        Raises:
            FileFormatError: If the file is malformed.
            ChunkError: If its actions are.
        """
        file = read_chunk_file(path, assume=assume, robot=robot)
        return cls(file.chunk(), name=Path(path).stem, spec=file.spec, horizon=horizon)

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
        left = len(self.episode) - first
        # A plan takes time: what is over before it is there cannot be followed.
        count = self.horizon if 2 * left < self.horizon else min(self.horizon, left)
        steps = np.minimum(first + np.arange(count), len(self.episode) - 1)
        t_obs = observation.time - elapsed + first / self.episode.fps
        window = {name: value[steps] for name, value in self.episode.arrays().items()}
        notes = () if seq else self.episode.notes  # they are about the whole recording
        return dataclasses.replace(self.episode, seq=seq, t_obs=t_obs, notes=notes, **window)


def needed_until(policy: object, duration: float) -> float:
    """Time after which nothing more is asked of a policy that is run for a time [s].

    A recording that is not run for longer than it lasts needs no chunk after the one that goes so far; others always
    do, and what they answer may change: inf.
    """
    length = getattr(policy, "duration", None) if hasattr(policy, "episode") else None
    return inf if length is None or duration > length + 1e-9 else duration


def open_recording(
    path: str | Path,
    *,
    fps: float | None = None,
    assume: ActionSpec | None = None,
    robot: RobotSpec | None = None,
    read_as: Sequence[str] = (),
) -> ReplayPolicy:
    """Policy that plays a file: chunk ``.npz``, array ``.npy``, or motion ``.csv`` or ``.npz``.

    The robot is the G1 with Dex3 hands if none is given. What the numbers may be instead of what they are called is in
    the notes of the episode, unless ``read_as`` says what they are (`policy.suspicion.corrections.READ_AS`). A motion
    or an array is anchored at the nominal stance; where its rate ``fps`` [Hz] is not given, it is that of the motion's
    file name, or else `DEFAULT_FPS`, or that of the array's layout, ``assume``, and a note says so.

    Raises:
        FileFormatError: If the suffix is another, the file is malformed, or its numbers cannot be what they are called.
    """
    suffix, name = Path(path).suffix.lower(), Path(path).stem
    if suffix == ".csv" or (suffix == ".npz" and is_motion_npz(path)):
        motion, notes = read_motion(path, fps, robot, read_as)
        chunk = with_notes(motion_chunk(motion), notes)
        return ReplayPolicy(chunk, name=name, spec=builtin("wbc32", robot), row_fps=motion.fps)
    if suffix in (".npz", ".npy"):
        bare = suffix == ".npy"
        file = read_array_file(path, assume, fps, robot) if bare else read_chunk_file(path, assume=assume, robot=robot)
        actions, rate = read_as_said(file.spec, file.actions, file.fps, read_as)
        file = dataclasses.replace(file, actions=actions, fps=rate, spec=spec_as_said(file.spec, read_as))
        found = action_findings(file.spec, actions, file.anchor(), rate, file.q0_joints)
        notes = settled(found, read_as, str(path))
        if bare and fps is None:
            notes = *notes, RATE_ASSUMED.format(rate, file.spec.name)
        return ReplayPolicy(with_notes(file.chunk(), notes), name=name, spec=file.spec)
    raise FileFormatError(
        f"has the suffix '{suffix}'; chunk .npz, array .npy and motion .csv can be played", path=str(path)
    )


def read_motion(
    path: str | Path, fps: float | None, robot: RobotSpec | None, read_as: Sequence[str]
) -> tuple[Motion, tuple[str, ...]]:
    """Read a motion ``.csv`` or ``.npz``, and what is to be said of it; a rate [Hz] that is not given is assumed.

    Raises:
        FileFormatError: If it is malformed, or its numbers cannot be what they are called.
    """
    rate = named_rate(path) or DEFAULT_FPS if fps is None else fps
    if Path(path).suffix.lower() == ".csv":
        motion = read_motion_csv(path, rate, robot, read_as=read_as)
        notes: tuple[str, ...] = (rate_note(motion, path),) if fps is None else ()
    else:
        motion, notes = read_motion_npz(path, rate, robot, read_as=read_as)
    quaternion = matrix_to_quaternion(motion.T_world_base[:, :3, :3], "xyzw")
    return motion, (*settled(motion_findings(motion, quaternion), read_as, str(path)), *notes)
