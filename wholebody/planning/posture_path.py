"""Ways from one still posture to another that are balanced all along: curves in the space of postures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from policy.chunk import ActionChunk
from wholebody.config import TrajectoryConfig
from wholebody.planning.still_postures import EXCESS_NONE, PostureLimit, StillPostures, scattered
from wholebody.trajopt.robot_tables import RobotTables

CURVES, DETOUR = 200, 0.6
"""Most curves that are tried, and deviation of the last one's control point from the middle of the straight one, as a
share of each joint's range, for waist and arms; chosen, no trial is on record."""
POSTURES = 64
"""Postures at which a curve is judged: hands that move by a metre move by some 15 mm from one to the next."""


@dataclass(frozen=True)
class PosturePath:
    """A way from one posture to another, from rest to rest; H steps.

    Attributes:
        clear: Whether every posture on it keeps all bounds, or exceeds them by no more than its ends do. If not, it
            is the best one found.
        chunk: What the hands do, for `Supervisor.accept`.
        q: Postures, shape (H, nq), Pinocchio convention.
        margins: As in `Solution`, the least on the way.
    """

    clear: bool
    chunk: ActionChunk
    q: np.ndarray
    margins: dict[PostureLimit, float]


@dataclass(frozen=True)
class Way:
    """Postures (H, nq) with their palms (H, 2, 4, 4), and as in `PosturePath`."""

    q: np.ndarray
    T_palms: np.ndarray
    margins: dict[PostureLimit, float]
    clear: bool


class PosturePaths:
    """Finds ways.

    A curve is straight in the space of postures, or a quadratic Bezier curve about a control point. Its pelvis and
    legs are put where the feet are in the stance.

    Args:
        body: The robot. config: Bounds and margins.
    """

    def __init__(self, body: RobotTables, config: TrajectoryConfig) -> None:
        self._body, self._postures = body, StillPostures(body, config, POSTURES)

    def between(self, begin: np.ndarray, end: np.ndarray, shares: np.ndarray) -> Way:
        """The straight curve if it keeps the bounds, else the first one that does about random control points.

        The control points go further and further from the middle of the straight curve; their seed is fixed.

        Args:
            begin: Configuration, shape (nq,).
            end: The same.
            shares: Where to be on the curve, from 0 to 1, shape (H,).
        """
        body, generator = self._body, np.random.default_rng(0)
        middle = pin.interpolate(body.model, body.body_of(begin), body.body_of(end), 0.5)
        best, least = middle, np.inf
        for curve in range(CURVES):
            detour = DETOUR * np.sqrt(curve / CURVES)
            control = scattered(body, middle, detour, generator) if curve else middle
            self._place(begin, end, control, np.linspace(0.0, 1.0, POSTURES))
            excess = self._postures.excess()
            if excess.max() < least:
                best, least = control, excess.max()
            if least <= max(EXCESS_NONE, excess[0], excess[-1]):
                break
        return self._along(begin, end, best, shares)

    def _along(self, begin: np.ndarray, end: np.ndarray, control: np.ndarray, shares: np.ndarray) -> Way:
        body, postures, q, palms, margins = self._body, self._postures, [], [], []
        for first in range(0, len(shares), POSTURES):
            part = shares[first : first + POSTURES]
            fingers = self._place(begin, end, control, np.pad(part, (0, POSTURES - len(part)), mode="edge"))
            for k in range(len(part)):
                full = end.copy()
                body.put(full, postures.q[k])
                full[body.fingers] = fingers[k]
                q.append(full)
                palms.append(postures.T_palms[k].copy())
                margins.append(postures.margins(k))
        excess = [max(-room / postures.tolerance[name] for name, room in rooms.items()) for rooms in margins]
        least = {name: min(rooms[name] for rooms in margins) for name in margins[0]}
        return Way(np.array(q), np.array(palms), least, max(excess) <= max(EXCESS_NONE, excess[0], excess[-1]))

    def _place(self, begin: np.ndarray, end: np.ndarray, control: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """Put the postures on a curve; the finger joints there, (POSTURES, n_fingers)."""
        body = self._body

        def between(a: np.ndarray, b: np.ndarray, share: float) -> np.ndarray:
            return pin.interpolate(body.model, a, b, share)

        a, b = body.body_of(begin), body.body_of(end)
        q = [between(between(a, control, x), between(control, b, x), x) for x in shares.tolist()]
        fingers = begin[body.fingers] + shares[:, None] * (end[body.fingers] - begin[body.fingers])
        self._postures.place(np.array(q), fingers)
        return fingers
