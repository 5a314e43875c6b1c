"""Targets that come one at a time, ten to a hundred times a second: chunks that go on where these are going."""

from __future__ import annotations

from collections import deque
from threading import Lock

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.codec import decode
from policy.action_spec.spec import ActionSpec
from policy.chunk import MAGNITUDE_MAX, ActionChunk
from policy.clock import Clock
from policy.errors import ChunkError
from policy.geometry.rotations import matrix_to_rotvec, nearest_rotation, rotation_residual, rotvec_to_matrix
from policy.geometry.se3 import make_transform
from policy.observation import Observation
from policy.prefix import Prefix
from policy.scripted.policy import minimum_jerk
from policy.targets.foretelling import Foretelling, braked

FPS, HORIZON = 30.0, 15
"""Of the chunks [Hz], [steps]; derived: a target that is not said again has come to rest within them."""
FREE, STOP = 0.2, 0.26
"""How long a target goes on as it was going, and in what time it comes to rest then [s]; derived: a plan is followed
from 0.1 to 0.2 s after it was asked for, and rests at the end of the chunk."""
LATE = 2.5
"""Intervals between two targets after which no more are expected; chosen: one may be lost, and the next late."""
WRIST, FINGERS = ((2.5, 0.15, 0.012), (12.0, 1.0, 0.08)), (10.0, 2.0)
"""Fastest motion of a target, and how far it goes on without being told: position [m/s, m], orientation [rad/s, rad]
and fingers; the limits of a hand in `wholebody.reference.HandLimits`, and measured: further on, plans lead fast hands
out of reach, with 0.1 m they brake too early. Last, steps aside [m], [rad]; measured: a trained policy's chunks meet
with 10 to 25 mm, which were foretold as 0.1 m; a lissajous of 1.1 m/s bends by 6 mm."""
ROTATION_TOLERANCE = 1e-3
"""Largest residual of a target's rotation; chosen: above float32 rounding, below any real fault."""
STAMPS = 256
"""Targets by which the two clocks are compared; chosen: 3 to 25 s, in which clocks drift by less than a millisecond."""
SAME = (1e-3, 0.01, 0.02)
"""Distance from what was foretold up to which a target says nothing new: position [m], orientation [rad], a finger
[rad]; chosen: a fifth of what streams are followed to."""
NAMES = ("lhand", "rhand", "q_lhand", "q_rhand")
"""What a target may say: wrist poses in world (4, 4) and fingers in motor order (7,)."""


class _Wrist:
    """A wrist pose that is told now and then."""

    def __init__(self) -> None:
        self._p, self._turn = (Foretelling(*bounds) for bounds in WRIST)
        self._R = np.eye(3)

    @property
    def last(self) -> tuple[float, np.ndarray]:
        """Time [s] and pose (4, 4) of the last one."""
        time, p = _last(self._p)
        return time, make_transform(self._R, p)

    def add(self, time: float, T: np.ndarray) -> None:
        """Take a pose (4, 4) at a time [s]; turns are told from the last one, whose own is zero."""
        R = nearest_rotation(T[:3, :3])
        turn = matrix_to_rotvec(R @ self._R.T)
        self._p.add(time, T[:3, 3])
        self._turn.add(time, turn)
        self._turn.shifted(turn)
        self._R = R

    def at(self, times: np.ndarray) -> np.ndarray:
        """Poses at times, shape (H, 4, 4)."""
        p, turn = (_ahead(track, times) for track in (self._p, self._turn))
        return make_transform(rotvec_to_matrix(turn) @ self._R, p)


class _Fingers:
    """Fingers that are told now and then."""

    def __init__(self) -> None:
        self._q = Foretelling(*FINGERS)

    @property
    def last(self) -> tuple[float, np.ndarray]:
        """Time [s] and joints (7,) of the last ones."""
        return _last(self._q)

    def add(self, time: float, q: np.ndarray) -> None:
        """Take joints (7,) at a time [s]."""
        self._q.add(time, q)

    def at(self, times: np.ndarray) -> np.ndarray:
        """Joints at times, shape (H, 7)."""
        return _ahead(self._q, times)


def _last(track: Foretelling) -> tuple[float, np.ndarray]:
    if track.last is None:
        raise ValueError("a track without a target has neither a past nor a future")
    return track.last


def _ahead(track: Foretelling, times: np.ndarray) -> np.ndarray:
    """What a track says of times [s], one that has ended too: it comes to rest."""
    ages, late = times - _last(track)[0], min(LATE * track.interval, FREE)
    return track.at(braked(ages, late if ages[0] > late else FREE, STOP), FREE + STOP / 2.0)


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
            self._tracks: dict[str, _Wrist | _Fingers] = {}
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
            target: Any of ``lhand``, ``rhand``: wrist poses in world (4, 4); ``q_lhand``, ``q_rhand``: fingers (7,).

        Raises:
            ChunkError: If a number is not finite, a rotation none, a name unknown, or the stamp not after the last one;
                nothing is taken then.
        """
        values = {name: _checked(name, value) for name, value in target.items()}
        if not values:
            raise ChunkError(f"a target says nothing; it may say {', '.join(NAMES)}")
        with self._lock:
            now = None if self.clock is None else self.clock.now()
            text = now if stamp is None else float(stamp)
            if text is None:
                raise ChunkError("a target needs a stamp where the stream has no clock", slot="stamp")
            time = self._dated(text, now, owned=stamp is None)
            for name, value in values.items():
                if name not in self._said:
                    self._said.add(name)
                    self._tracks[name] = _Wrist() if value.ndim == 2 else _Fingers()
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
        chunk = decode(self.spec, np.asarray(action, dtype=float)[None], anchor)
        self.put(
            stamp, lhand=chunk.T_world_lhand[0], rhand=chunk.T_world_rhand[0],
            q_lhand=chunk.q_lhand[0], q_rhand=chunk.q_rhand[0],
        )  # fmt: skip

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
            T_l, T_r, q_l, q_r = (self._tracks[name].at(times) for name in NAMES)
            self._unused = False
            self._chunk = ActionChunk(self.spec.id, self._seq, float(observation.time), FPS, T_l, T_r, q_l, q_r)
            return self._chunk

    @property
    def news(self) -> bool:
        """Whether the newest target is elsewhere than the last chunk has it: there is a better chunk by now."""
        with self._lock:
            chunk = self._chunk
            if chunk is None or not self._unused:
                return chunk is None
            parts = (chunk.T_world_lhand, chunk.T_world_rhand, chunk.q_lhand, chunk.q_rhand)
            return any(
                _differs(rows, (time - chunk.t_obs) * chunk.fps, value)
                for rows, (time, value) in zip(parts, (self._tracks[name].last for name in NAMES), strict=True)
            )

    def infer_after(self, observation: Observation, prefix: Prefix) -> ActionChunk:
        """Chunk that repeats what is being executed for the inference delay, and is free from the horizon on.

        Raises:
            ObservationError: If the observation is malformed.
        """
        return after(self.infer(observation), prefix)

    def _stay(self, time: float, anchor: Anchor) -> None:
        """Where nothing was said, stay where the robot is."""
        here = {name: anchor.T_world_base @ anchor.poses[name] for name in NAMES[:2]}
        here |= {"q_lhand": anchor.q_lhand, "q_rhand": anchor.q_rhand}
        for name, value in here.items():
            if name not in self._tracks:
                self._tracks[name] = _Wrist() if value.ndim == 2 else _Fingers()
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
    return ActionChunk(chunk.spec_id, chunk.seq, chunk.t_obs, chunk.fps, **arrays)


def _differs(rows: np.ndarray, step: float, value: np.ndarray) -> bool:
    """Whether rows (H, ...) are elsewhere at a step, a fraction of one too; before the first they count as there."""
    step = min(max(step, 0.0), len(rows) - 1.0)
    k = min(int(step), len(rows) - 2)
    off = rows[k] + (step - k) * (rows[k + 1] - rows[k]) - value
    if value.ndim == 1:
        return bool(np.abs(off).max() > SAME[2])
    # Of two rotations that are near, the angle is the size of their difference over the root of two.
    return bool(np.linalg.norm(off[:3, 3]) > SAME[0] or np.linalg.norm(off[:3, :3]) > np.sqrt(2.0) * SAME[1])


def _checked(name: str, value: np.ndarray) -> np.ndarray:
    """A part of a target as an array.

    Raises:
        ChunkError: With its name.
    """
    if name not in NAMES:
        raise ChunkError(f"a target has no '{name}'; it may say {', '.join(NAMES)}", slot=name)
    value, shape = np.array(value, dtype=float), (4, 4) if name in NAMES[:2] else (7,)
    if value.shape != shape:
        raise ChunkError(f"{name} has shape {value.shape}; {shape} is expected", slot=name)
    bad = ~(np.abs(value) <= MAGNITUDE_MAX)
    if bad.any():
        index = [int(i) for i in np.argwhere(bad)[0]]
        raise ChunkError(f"{name} is {value[tuple(index)]} at {index}; finite numbers are expected", slot=name)
    if len(shape) == 2 and not rotation_residual(value[:3, :3]) <= ROTATION_TOLERANCE:
        residual = float(rotation_residual(value[:3, :3]))
        raise ChunkError(f"{name} has no rotation: residual {residual:.2g}, at most {ROTATION_TOLERANCE}", slot=name)
    return value
