"""A stream of single targets whose hands are faster than plans: paths through what was said last, a little later.

A body plan that has to come to rest where its chunk ends, half a second on, brakes hands that do not mean to stop. So
hands that are fast follow what was said itself, and the body waits for them. A time a little back has said values on
both sides of it: what is said there is known, not foretold.
"""

from __future__ import annotations

from collections import deque
from math import inf

import numpy as np

from policy.chunk import ActionChunk
from wholebody.planning.preparation import PreparedChunk
from wholebody.reference import HandLimits, HandPath

SHORT = 0.6
"""Longest chunk of a stream of single targets [s]; derived: `policy.targets.stream` foretells for 0.47 s."""
GAP = 0.06
"""Longest time between two of its targets [s]; chosen: 20 Hz, and one of them late."""
FAST = 0.4
"""Speed of a hand, from two targets to the next ones, from which it is fast [m/s]; measured: what is slower is followed
within 4 mm along plans. A single target that jumps, as where a policy's chunks meet, is not fast."""
CALM = 0.6
"""Time without fast hands after which a plan leads again [s]; chosen: longer than a lissajous is slow at its turns."""
LAG = 0.022
"""How much later than said the hands are there [s]; measured: with it hands follow a lissajous at 30 Hz within 4 mm,
with 0 within 6.5 mm."""
KEPT = 5
"""Targets before the newest that a path goes through; chosen: what is further back changes its curve by nothing."""


class FastStream:
    """Notices a stream of single targets that are fast, and has their paths.

    Args:
        limits: Of the left and the right hand.
    """

    def __init__(self, limits: tuple[HandLimits, ...]) -> None:
        self._limits = limits
        self.forget()

    def forget(self) -> None:
        """Begin anew: nothing was said."""
        self._said: deque[tuple[float, tuple[np.ndarray, ...]]] = deque(maxlen=KEPT + 1)
        self._fast, self._jumped = -inf, False

    def is_fast(self, now: float) -> bool:
        """Whether hands were fast within `CALM` [s]."""
        return now - self._fast < CALM

    def add(self, chunk: ActionChunk) -> None:
        """Take a chunk; one of many steps, or after a gap, begins anew."""
        if chunk.times[-1] - chunk.t_obs > SHORT:
            self.forget()
            return
        if self._said and not 0.0 < chunk.t_obs - self._said[-1][0] <= GAP:
            self.forget()
        parts = chunk.T_world_lhand[0], chunk.T_world_rhand[0], chunk.q_lhand[0], chunk.q_rhand[0]
        if self._said:
            before, was = self._said[-1]
            way = max(float(np.linalg.norm(parts[i][:3, 3] - was[i][:3, 3])) for i in range(2))
            # Twice: a target that jumps is not fast.
            if way >= FAST * (chunk.t_obs - before):
                self._fast, self._jumped = (chunk.t_obs if self._jumped else self._fast), True
            else:
                self._jumped = False
        self._said.append((chunk.t_obs, parts))

    def paths(self, prepared: PreparedChunk) -> tuple[HandPath, HandPath] | None:
        """Paths of both hands through what was said and along the newest chunk, parameters from its observation on.

        None where too little was said, and for a chunk that is led out of the floor or scatters.
        """
        chunk = prepared.chunk
        if len(self._said) <= KEPT or prepared.lift.any() or prepared.smoothed:
            return None
        said = list(self._said)[:-1]
        times = np.concatenate([[time - chunk.t_obs for time, _ in said], prepared.times])
        parts = chunk.T_world_lhand, chunk.T_world_rhand, chunk.q_lhand, chunk.q_rhand
        T_l, T_r, q_l, q_r = (
            np.concatenate([np.stack([values[i] for _, values in said]), part]) for i, part in enumerate(parts)
        )
        left, right = self._limits
        return HandPath.through(times, T_l, q_l, left), HandPath.through(times, T_r, q_r, right)
