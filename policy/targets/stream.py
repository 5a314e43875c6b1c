"""Targets that come one at a time, ten to a hundred times a second: chunks that go on where these are going."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from threading import Lock

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.codec import decode
from policy.action_spec.spec import ActionSpec
from policy.chunk import ActionChunk
from policy.clock import Clock
from policy.errors import ChunkError
from policy.geometry.rotations import matrix_to_rotvec, rotvec_to_matrix
from policy.geometry.se3 import make_transform
from policy.observation import Observation
from policy.prefix import Prefix
from policy.scripted.policy import minimum_jerk
from policy.targets.parts import FORCES, SHAPES, checked, differs, rows_of
from policy.targets.tracks import Track, track_of

FPS, HORIZON = 30.0, 15
"""Of the chunks [Hz], [steps]; derived: a target that is not said again has come to rest within them."""
STAMPS = 256
"""Targets by which the two clocks are compared; chosen: 3 to 25 s, in which clocks drift by less than a millisecond."""


class TargetStream:
    """A policy whose targets come from outside, one at a time: teleoperation, `send_action`, another program.

    A target is absolute and may be partial: what it does not say stays as it was said last, and what was never said
    stays where the robot had it at the first `infer`. Each goes on as its last values foretell, for `FREE` seconds, and
    comes to rest in `STOP` more: also where no more come. Nothing is summed up, so a target that is repeated does not
    drift, however long.

    Args:
        spec: Layout of `put_action`; wbc32 of the robot if not given.
        clock: The robot's, by which targets are dated whose own clock is another one. Without it stamps are robot time.
        robot: Whose hands they are; the G1 with Dex3 hands if none is given.
    """

    sees_robot = True

    def __init__(
        self, spec: ActionSpec | None = None, *, clock: Clock | None = None, robot: RobotSpec | None = None
    ) -> None:
        self.spec, self.clock, self.robot = spec or builtin("wbc32", robot), clock, robot or g1()
        self._lock = Lock()
        self.reset()

    def reset(self, task: str = "") -> None:
        """Forget all targets."""
        with self._lock:
            self._tracks: dict[str, Track] = {name: track_of(name) for name in FORCES}
            self._said: set[str] = set()
            self._stamp, self._seq = -np.inf, -1
            self._offsets: deque[float] = deque(maxlen=STAMPS)
            self._anchor: Anchor | None = None
            self._chunk: ActionChunk | None = None
            self._unused = False

    def put(self, stamp: float | None = None, **target: np.ndarray) -> None:
        """Say where hands are to be now.

        Args:
            stamp: When that was meant, on the clock of the targets [s]: of the clock's two readings, the least
                difference counts as no delay. The robot's time if not given.
            target: Any of ``lhand``, ``rhand``: wrist poses in world (4, 4); ``q_lhand``, ``q_rhand``: fingers (7,);
                ``f_lpalm``, ``f_rpalm``: forces that the palms are to meet, in world axes (3,) [N], none at first.

        Raises:
            ChunkError: If a number is not finite, a rotation none, a name unknown, or the stamp not after the last one;
                nothing is taken then.
        """
        values = {name: checked(name, value) for name, value in target.items()}
        if not values:
            raise ChunkError(f"a target says nothing; it may say {', '.join(SHAPES)}")
        with self._lock:
            now = None if self.clock is None else self.clock.now()
            text = now if stamp is None else float(stamp)
            if text is None:
                raise ChunkError("a target needs a stamp where the stream has no clock", slot="stamp")
            time = self._dated(text, now, owned=stamp is None)
            for name, value in values.items():
                if name not in self._said:
                    self._said.add(name)
                    self._tracks[name] = track_of(name)
                self._tracks[name].add(time, value)
            self._unused = True

    def put_action(self, action: np.ndarray, stamp: float | None = None, anchor: Anchor | None = None) -> None:
        """Say it in the numbers of the layout, shape (A,).

        Args:
            action: Un-normalised, in the units of the spec.
            stamp: As in `put`.
            anchor: What the numbers are relative to; the pelvis at the first `infer` if not given, so that a robot that
                leans does not move its own target on.

        Raises:
            ChunkError: As `put`, and if the numbers are none of the layout, or nothing is known of the robot yet.
        """
        anchor = anchor or self._anchor
        if anchor is None:
            raise ChunkError("the robot has not been observed yet: give an anchor, or call infer first", slot="anchor")
        rows = rows_of(decode(self.spec, np.asarray(action, dtype=float)[None], anchor))
        self.put(stamp, **{name: part[0] for name, part in rows.items()})

    def infer(self, observation: Observation) -> ActionChunk:
        """Chunk from the observation's time on.

        Raises:
            ObservationError: If the observation is malformed.
        """
        with self._lock:
            if self._anchor is None:
                self._anchor = Anchor.measured(observation, self.robot)
            self._stay(observation.time, self._anchor)
            self._seq += 1
            times = observation.time + np.arange(HORIZON) / FPS
            rows = {name: self._tracks[name].at(times) for name in SHAPES}
            left, right = (rows[name] if rows[name].any() else None for name in FORCES)
            self._unused = False
            self._chunk = ActionChunk(
                self.spec.id, self._seq, float(observation.time), FPS, rows["lhand"], rows["rhand"], rows["q_lhand"],
                rows["q_rhand"], f_world_lpalm=left, f_world_rpalm=right,
            )  # fmt: skip
            return self._chunk

    @property
    def news(self) -> bool:
        """Whether the newest target is elsewhere than the last chunk has it: there is a better chunk by now."""
        with self._lock:
            chunk = self._chunk
            if chunk is None or not self._unused:
                return chunk is None
            lasts = {name: self._tracks[name].last for name in SHAPES}
            return any(
                differs(name, rows, (lasts[name][0] - chunk.t_obs) * chunk.fps, lasts[name][1])
                for name, rows in rows_of(chunk).items()
            )

    def infer_after(self, observation: Observation, prefix: Prefix) -> ActionChunk:
        """Chunk that repeats what is being executed for the inference delay, and is free from the horizon on.

        Raises:
            ObservationError: If the observation is malformed.
        """
        return after(self.infer(observation), prefix)

    def _stay(self, time: float, anchor: Anchor) -> None:
        """Where nothing was said, stay where the robot is."""
        here = {name: anchor.T_world_base @ anchor.poses[name] for name in ("lhand", "rhand")}
        here |= {"q_lhand": anchor.q_lhand, "q_rhand": anchor.q_rhand}
        for name, value in here.items():
            if name not in self._tracks:
                self._tracks[name] = track_of(name)
                self._tracks[name].add(time, value)

    def _dated(self, stamp: float, now: float | None, *, owned: bool) -> float:
        """Time of a target on the robot's clock [s]; a stamp of another clock by the least delay so far."""
        if not np.isfinite(stamp):
            raise ChunkError(f"the stamp is {stamp}; a finite number of seconds is expected", slot="stamp")
        if stamp <= self._stamp:
            raise ChunkError(
                f"the stamp {stamp:.4f} s is not after that of the target before it, {self._stamp:.4f} s: a repeated "
                "or late target",
                slot="stamp",
            )
        self._stamp = stamp
        if now is None or owned:
            return stamp
        self._offsets.append(now - stamp)
        return stamp + min(self._offsets)


def after(chunk: ActionChunk, prefix: Prefix) -> ActionChunk:
    """A chunk that begins as the prefix: its steps of the delay, then over to the chunk's own until its horizon."""
    executed, n = prefix.executed, min(len(chunk), len(prefix.executed))
    k = np.arange(n)
    free = minimum_jerk((k + 1 - prefix.inference_delay) / max(prefix.execution_horizon - prefix.inference_delay, 1))
    arrays = {name: getattr(chunk, name).copy() for name in ("T_world_lhand", "T_world_rhand", "q_lhand", "q_rhand")}
    for name, own in arrays.items():
        theirs = getattr(executed, name)[:n]
        if own.ndim == 3:
            turn = matrix_to_rotvec(own[:n, :3, :3] @ np.swapaxes(theirs[:, :3, :3], 1, 2))
            R = rotvec_to_matrix(free[:, None] * turn) @ theirs[:, :3, :3]
            p = theirs[:, :3, 3] + free[:, None] * (own[:n, :3, 3] - theirs[:, :3, 3])
            own[:n] = make_transform(R, p)
        else:
            own[:n] = theirs + free[:, None] * (own[:n] - theirs)
    return replace(chunk, **arrays)
