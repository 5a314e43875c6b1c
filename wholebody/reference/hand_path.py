"""Path of one hand from knots at the chunk rate: C2 in position, orientation and fingers, defined at every parameter.

The path is one curve in R^14 (position 3, quaternion 4, fingers 7), piecewise quintic. Dividing the quaternion by its
length keeps the curve C2, meets the knots exactly and has the accuracy of the cubic spline. Before the first knot the
hand starts from rest, after the last one it brakes to rest. The parameter ``s`` [s] is the chunk's own time; who slows
down along the path maps time to it (`wholebody.reference.kernels.path_clock`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from policy.geometry.rotations import matrix_to_quaternion
from wholebody.errors import InputError
from wholebody.jit.entry import Entry
from wholebody.reference.hand_limits import HandLimits
from wholebody.reference.join import Join, join_curve
from wholebody.reference.kernels.path import curve_rows
from wholebody.reference.knots import POSITION, ROTATION, all_fingers, check_knots, curve_through
from wholebody.reference.layout import ROW, HandMotion
from wholebody.reference.spline import PiecewiseQuintic, knot_derivatives, quintic

CELL_WIDTH = 0.002
"""Width of a look-up cell [s]; chosen: one control tick at 500 Hz."""

_curve_rows = Entry(curve_rows)


@dataclass(frozen=True)
class HandPath:
    """C2 path of one hand; a value, never changed. Make it with `from_knots`, continue a motion with `joined`.

    Attributes:
        curve: The 14 channels of `wholebody.reference.knots` over ``s``.
        start, end: First and last knot, or the join and the last knot [s]; outside the hand starts and stops.
        limits: What start, stop and joins keep to; the knots are met whatever they demand.
        outliers: Indices of knots whose slope was limited because the motion around them is far beyond the limits.
        join: How the path continues an earlier motion, or None.
    """

    curve: PiecewiseQuintic
    start: float
    end: float
    limits: HandLimits
    outliers: tuple[int, ...] = ()
    join: Join | None = None

    @classmethod
    def from_knots(
        cls, times: np.ndarray, T_world_hand: np.ndarray, q_hand: np.ndarray, *, limits: HandLimits | None = None
    ) -> HandPath:
        """Path through knots.

        Args:
            times: Parameters of the knots, increasing, shape ``(H,)``, [s].
            T_world_hand: Poses, shape ``(H, 4, 4)``.
            q_hand: Finger joints in motor order, shape ``(H, n)``, n up to 7, [rad].
            limits: Limits of the hand; `HandLimits()` if not given.

        Raises:
            InputError: If a shape is wrong, a value is not finite, times do not increase, or a rotation is none.
        """
        return cls.through(*check_knots(times, T_world_hand, q_hand), HandLimits() if limits is None else limits)

    @classmethod
    def through(cls, times: np.ndarray, T_world_hand: np.ndarray, q_hand: np.ndarray, limits: HandLimits) -> HandPath:
        """Path through knots that are known to be valid, as those of a prepared chunk: `from_knots` without its checks.

        Args:
            times: Parameters of the knots, increasing, shape ``(H,)``, [s].
            T_world_hand: Poses, shape ``(H, 4, 4)``.
            q_hand: Finger joints in motor order, shape ``(H, n)``, n up to 7, [rad].
            limits: Limits of the hand.
        """
        curve, outliers = curve_through(times, T_world_hand, all_fingers(q_hand), limits)
        return cls(curve, float(times[0]), float(times[-1]), limits, tuple(np.flatnonzero(outliers).tolist()))

    def joined(self, motion: HandMotion, s: float, *, limits: HandLimits | None = None) -> HandPath:
        """The path from ``s`` on, beginning with ``motion`` (position, velocity, acceleration) instead of its own.

        Args:
            motion: What is commanded at ``s``, one row.
            s: Parameter of the join [s]; it may lie before the first or after the last knot.
            limits: Limits of the joining motion, half of which it uses; those of the path if not given.

        Raises:
            InputError: If the motion is not one finite row, or ``s`` is not finite.
        """
        if motion.rows.shape != (ROW,) or not np.isfinite(motion.rows).all() or not np.isfinite(s):
            raise InputError(
                f"a path joins one finite row of {ROW} values at a finite s; got shape {motion.rows.shape} at s {s}",
                field="motion",
            )
        curve, join = join_curve(self.curve, motion, float(s), limits or self.limits, self.limits)
        return replace(self, curve=curve, start=float(s), join=join)

    def moved(self, s: np.ndarray, T_world_hand: np.ndarray) -> HandPath:
        """The path led through other poses: the smooth difference is added, so what happens between them stays.

        The start is kept, with its rates, whatever the first pose; after the last one the difference stays as it is.

        Args:
            s: Increasing parameters from the start on, shape ``(K,)``, [s].
            T_world_hand: Where the hand is to be at them, shape ``(K, 4, 4)``.
        """
        own = self.curve(s, 0)[0]
        quat, size = matrix_to_quaternion(T_world_hand[:, :3, :3], "xyzw"), np.linalg.norm(own[:, ROTATION], axis=1)
        quat *= (size * np.where(np.sum(quat * own[:, ROTATION], axis=1) < 0.0, -1.0, 1.0))[:, None]
        change = np.zeros_like(own)
        change[1:, POSITION] = T_world_hand[1:, :3, 3] - own[1:, POSITION]
        change[1:, ROTATION] = quat[1:] - own[1:, ROTATION]
        jets = np.stack([change, *knot_derivatives(s, change, np.zeros(len(s), dtype=bool))])
        jets[1:, [0, -1]] = 0.0
        return replace(self, curve=self.curve + PiecewiseQuintic(s, quintic(np.diff(s), jets[:, :-1], jets[:, 1:])))

    @property
    def span(self) -> tuple[float, float]:
        """Where the hand leaves rest and where it is at rest again [s]."""
        return float(self.curve.breaks[0]), float(self.curve.breaks[-1])

    def sample(self, s: np.ndarray) -> HandMotion:
        """Motion at parameters ``s`` (n,) [s]; its derivatives are with respect to ``s``."""
        s = np.asarray(s, dtype=float)
        rows = np.empty((s.size, ROW))
        _curve_rows(self.curve.breaks, self.curve.coefficients.ravel(), s.ravel(), rows)
        return HandMotion(rows.reshape(*s.shape, ROW))

    @cached_property
    def flat(self) -> np.ndarray:
        """The path as one array, as `wholebody.reference.kernels.path` reads it."""
        breaks, coefficients = self.curve.breaks, self.curve.coefficients
        cells = np.arange(breaks[0], breaks[-1], CELL_WIDTH)
        segment = np.clip(np.searchsorted(breaks, cells, side="right") - 1, 0, len(coefficients) - 1)
        header = [len(coefficients), coefficients.shape[2], breaks[0], 1.0 / CELL_WIDTH, len(cells)]
        return np.concatenate([header, segment, breaks, coefficients.ravel()])
