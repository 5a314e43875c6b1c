"""Policies that play back what was recorded."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.codec import feet_stay
from policy.action_spec.slot_values import NOT_FOLLOWED
from policy.action_spec.spec import ActionSpec
from policy.chunk import ActionChunk
from policy.clock import EpisodeClock
from policy.dataset.inspection import action_findings, read_as_said, settled, spec_as_said, with_notes
from policy.errors import FileFormatError
from policy.geometry.rotations import matrix_to_quaternion
from policy.observation import Observation
from policy.recorded.array_file import RATE_ASSUMED, read_array_file
from policy.recorded.chunk_file import read_chunk_file
from policy.recorded.motion_csv import (
    DEFAULT_FPS,
    Motion,
    motion_chunk,
    named_rate,
    rate_note,
    read_motion_csv,
    travels,
)
from policy.recorded.motion_findings import motion_findings
from policy.recorded.motion_npz import is_motion_npz, read_motion_npz
from policy.recorded.walked_motion import WalkLimits, begun_before, walked_along, walked_chunk

BACK = 0.5
"""Rate with which a base that is off its recorded way comes back to it [1/s]; chosen: within three steps, and what the
soles are beside the base in the midst of one moves it by a centimetre."""

LATE = 0.12
"""Distance by which a base may be behind before the recording waits for it [m]; chosen: a base that is followed well is
within 0.09."""
MOST = 0.999
"""Share of its fastest walk that a robot is asked for at most [no unit]; chosen: what is beyond by rounding is said."""


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
        return self._playing(dataclasses.replace(self.episode, **longer))

    def _playing(self, episode: ActionChunk) -> ReplayPolicy:
        """Policy like this that plays another recording."""
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
        return self._window(seq, observation.time, elapsed)[0]

    def _window(self, seq: int, now: float, elapsed: float) -> tuple[ActionChunk, np.ndarray]:
        """Chunk of a number for a time [s] at which so much is over [s], and which steps those are, (n,)."""
        first = self._step(elapsed)
        left = len(self.episode) - first
        # A plan takes time: what is over before it is there cannot be followed.
        count = self.horizon if 2 * left < self.horizon else min(self.horizon, left)
        steps = np.minimum(first + np.arange(count), len(self.episode) - 1)
        t_obs = now - elapsed + first / self.episode.fps
        window = {name: value[steps] for name, value in self.episode.arrays().items()}
        notes = () if seq else self.episode.notes  # they are about the whole recording
        return dataclasses.replace(self.episode, seq=seq, t_obs=t_obs, notes=notes, **window), steps

    def _step(self, elapsed: float) -> int:
        """Step that is due after a time [s], or the last one before it."""
        # A time that is a step but for rounding must find that step.
        return int(np.floor(elapsed * self.episode.fps + 1e-6))


class WalkedReplay(ReplayPolicy):
    """Serves a recording that is walked, such as `policy.recorded.walked_motion.walked_chunk` has it, in windows.

    Hands are about the soles as they are seen, and the way of the base goes on from where these were before it began:
    what they are off it is made up for along the way, and the recording waits for a base that is far behind.

    Args:
        episode: The recording, in the frame between the soles; its ``base_velocity`` is the way of the base.
        limits: Of the robot.
        **settings: Those of a `ReplayPolicy`.
    """

    sees_robot = True

    def __init__(self, episode: ActionChunk, limits: WalkLimits, **settings: Any) -> None:
        super().__init__(episode, **settings)
        self.limits = limits
        way = np.asarray(episode.base_velocity)
        self._places, self._headings = walked_along(way, episode.fps)
        self._asked = begun_before(way, round(limits.shift * episode.fps))
        self._begins = int(np.argmax(np.abs(self._asked).max(axis=1) > 0.0))
        self._begin: tuple[complex, float] = 0j, 0.0
        self._waited, self._served = 0.0, 0

    def _playing(self, episode: ActionChunk) -> WalkedReplay:
        settings = {"name": self.name, "spec": self.spec, "horizon": self.horizon, "row_fps": self.row_fps}
        return WalkedReplay(episode, self.limits, **settings)

    def infer(self, observation: Observation) -> ActionChunk:
        """Window that starts at the observation's time or up to one step before it.

        Raises:
            ObservationError: If the observation is malformed, or time goes back without a reset.
        """
        T = Anchor.measured(observation, self.spec.robot).T_world_stance
        here, heading = complex(*T[:2, 3]), float(np.arctan2(T[1, 0], T[0, 0]))
        seq, elapsed = self._clock.tick(observation.time)
        if seq == 0:
            self._waited, self._served = 0.0, 0
        waits = self._waits(here, self._step(elapsed - self._waited))
        self._waited += waits
        chunk, steps = self._window(seq, observation.time, elapsed - self._waited)
        self._served = int(steps[0])
        if steps[0] <= self._begins:
            self._begin = here, heading
        velocity = self._asked[steps] + self._making_up(here, heading, steps)
        velocity /= np.maximum(self.limits.share(velocity) / MOST, 1.0)[:, None]
        hands = {name: T @ getattr(chunk, name) for name in ("T_world_lhand", "T_world_rhand")}
        notes = (*chunk.notes, *feet_stay(velocity))
        if waits > 0.0:
            late = f"the recording waits {waits:.2f} s for a base that is behind it, {self._waited:.2f} s by now"
            notes += (f"{late}: so much of its end {NOT_FOLLOWED}",)
        return dataclasses.replace(chunk, base_velocity=velocity, notes=notes, **hands)

    def _way(self, steps: np.ndarray | int) -> np.ndarray:
        """Places of the base at steps, in world, ``x + iy`` [m]."""
        begin, begun = self._begin
        return begin + self._places[steps] * np.exp(1j * begun)

    def _waits(self, here: complex, first: int) -> float:
        """Time for which a recording that has come to a step waits for a base that is seen there [s]."""
        if first <= self._begins:
            return 0.0
        since = np.arange(self._served, min(first, len(self.episode) - 1) + 1)
        away = np.abs(self._way(since) - here)
        near = np.flatnonzero(away <= max(LATE, away.min()))
        return float(since[-1] - since[near[-1]]) / self.episode.fps

    def _making_up(self, here: complex, heading: float, steps: np.ndarray) -> np.ndarray:
        """Velocities, shape (n, 3), that bring a base back to its way from where it is seen [m, rad]."""
        first, begun = steps[0], self._begin[1]
        away = self._way(first) - here
        turned = np.angle(np.exp(1j * (begun + self._headings[first] - heading)))
        rate = BACK * np.exp(-BACK * np.arange(len(steps)) / self.episode.fps)
        way = rate * away * np.exp(-1j * (heading + self._headings[steps] - self._headings[first]))
        return np.column_stack([way.real, way.imag, rate * turned])


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
    walks: WalkLimits | None = None,
) -> ReplayPolicy:
    """Policy that plays a file: chunk ``.npz``, array ``.npy``, or motion ``.csv`` or ``.npz``.

    The robot is the G1 with Dex3 hands if none is given. What the numbers may be instead of what they are called is in
    the notes of the episode, unless ``read_as`` says what they are (`policy.suspicion.corrections.READ_AS`). A motion
    or an array is anchored at the nominal stance; where its rate ``fps`` [Hz] is not given, it is that of the motion's
    file name, or else `DEFAULT_FPS`, or that of the array's layout, ``assume``, and a note says so. A motion whose
    feet travel is played for a robot that stays, or for one that walks with the limits ``walks``.

    Raises:
        FileFormatError: If the suffix is another, the file is malformed, or its numbers cannot be what they are called.
    """
    suffix, name = Path(path).suffix.lower(), Path(path).stem
    if suffix == ".csv" or (suffix == ".npz" and is_motion_npz(path)):
        motion, notes = read_motion(path, fps, robot, read_as)
        settings: dict[str, Any] = {"name": name, "spec": builtin("wbc32", robot), "row_fps": motion.fps}
        if walks is not None and travels(motion) is not None:
            return WalkedReplay(with_notes(walked_chunk(motion, walks), notes), walks, **settings)
        return ReplayPolicy(with_notes(motion_chunk(motion), notes), **settings)
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
