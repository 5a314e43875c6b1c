"""A part of a target as it is told now and then, and where it will be: wrists and fingers go on, forces stay."""

from __future__ import annotations

import numpy as np

from policy.geometry.rotations import matrix_to_rotvec, nearest_rotation, rotvec_to_matrix
from policy.geometry.se3 import make_transform
from policy.targets.foretelling import Foretelling, braked

FREE, STOP = 0.2, 0.26
"""How long a target goes on as it was going, and in what time it comes to rest then [s]; derived: a plan is followed
from 0.1 to 0.2 s after it was asked for, and rests at the end of the chunk."""
LATE = 2.5
"""Intervals between two targets after which no more are expected; chosen: one may be lost, and the next late."""
WRIST, FINGERS = ((2.5, 0.15, 0.002), (12.0, 1.0, 0.015)), (10.0, 2.0, 0.03)
"""Fastest motion of a target, and how far it goes on without being told: position [m/s, m], orientation [rad/s, rad]
and fingers; the limits of a hand in `wholebody.reference.HandLimits`, and measured: further on, plans lead fast hands
out of reach, with 0.1 m they brake too early. Last, what may be a step aside [m], [rad]; measured: a trained policy's
chunks meet with 7 to 21 mm, and 8 mm were foretold as 0.1 m; less than 2 mm lead nowhere."""


class WristTrack:
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


class FingersTrack:
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


class ForceTrack:
    """A force that is told now and then, and stays as it was told last."""

    def __init__(self) -> None:
        self.last = -np.inf, np.zeros(3)

    def add(self, time: float, force: np.ndarray) -> None:
        """Take a force (3,) at a time [s]."""
        self.last = time, force

    def at(self, times: np.ndarray) -> np.ndarray:
        """Forces at times, shape (H, 3)."""
        return np.tile(self.last[1], (len(times), 1))


Track = WristTrack | FingersTrack | ForceTrack
"""A part of a target over time."""


def track_of(name: str) -> Track:
    """An empty track of a part, by its name in `policy.targets.parts.SHAPES`; a force is none before it is told."""
    if name.startswith("f_"):
        return ForceTrack()
    return FingersTrack() if name.startswith("q_") else WristTrack()


def _last(track: Foretelling) -> tuple[float, np.ndarray]:
    if track.last is None:
        raise ValueError("a track without a target has neither a past nor a future")
    return track.last


def _ahead(track: Foretelling, times: np.ndarray) -> np.ndarray:
    """What a track says of times [s], one that has ended too: it comes to rest."""
    ages, late = times - _last(track)[0], min(LATE * track.interval, FREE)
    return track.at(braked(ages, late if ages[0] > late else FREE, STOP), FREE + STOP / 2.0)
