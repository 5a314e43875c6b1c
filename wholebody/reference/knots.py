"""From the knots of a chunk to one C2 curve in R^14: which knots are outliers, and how the hand starts and stops.

Channels: position 3 [m], quaternion xyzw 4, fingers 7 [rad].
"""

from __future__ import annotations

import numpy as np

from policy.geometry.rotations import rotation_residual
from wholebody.errors import InputError
from wholebody.reference.hand_limits import HandLimits, MotionLimits
from wholebody.reference.kernels.smoother_memory import FINGERS
from wholebody.reference.rotation import continuous_quaternions
from wholebody.reference.spline import PiecewiseQuintic, knot_derivatives, quintic

POSITION, ROTATION, FINGER = slice(0, 3), slice(3, 7), slice(7, 14)
PARTS = (POSITION, ROTATION, FINGER)

OUTLIER_SPEED = 2.0
"""Times the speed limit that the hand would need between knots that are outliers; chosen, no trial is on record."""
OUTLIER_ACCELERATION = 3.0
"""Times the acceleration limit that the second difference of a knot has that is an outlier; chosen, no trial is on
record."""
BRAKE_MIN = 0.05
"""Shortest start from rest and shortest stop [s]; chosen, no trial is on record."""
ROTATION_TOLERANCE = 1e-3
"""Largest residual of a knot's rotation matrix [no unit]; chosen: above float32 rounding, below any real fault."""


def part_size(values: np.ndarray, part: slice) -> np.ndarray:
    """Size of a change of one part of the channels ``(..., 14)``: distance [m], angle [rad], largest joint [rad].

    The angle is twice the change of the quaternion, exact where that is small and of unit length.
    """
    x = values[..., part]
    if part == FINGER:
        return np.abs(x).max(axis=-1)
    return np.sqrt((x * x).sum(axis=-1)) * (2.0 if part == ROTATION else 1.0)


def check_knots(
    times: np.ndarray, T_world_hand: np.ndarray, q_hand: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The knots as float arrays; fingers that a hand does not have are 0.

    Raises:
        InputError: If a shape is wrong, a value is not finite, times do not increase, or a rotation is none.
    """
    times, T, q = (np.array(x, dtype=float) for x in (times, T_world_hand, q_hand))
    count = times.size
    for name, x, shape in (
        ("times", times, (max(count, 1),)),
        ("T_world_hand", T, (count, 4, 4)),
        ("q_hand", q, (count, q.shape[-1] if q.ndim == 2 and q.shape[-1] <= FINGERS else FINGERS)),
    ):
        if x.shape != shape:
            raise InputError(f"{name} has shape {x.shape}; {shape} is expected", field=name)
        if not np.isfinite(x).all():
            knot = int(np.argwhere(~np.isfinite(x))[0][0])
            raise InputError(f"{name} is not finite at knot {knot}; finite values are expected", field=name, knot=knot)
    if not np.all(np.diff(times) > 0.0):
        knot = int(np.flatnonzero(~(np.diff(times) > 0.0))[0]) + 1
        raise InputError(
            f"times[{knot}] = {times[knot]:.6g} s is not after {times[knot - 1]:.6g} s; knots must increase in time",
            field="times",
            knot=knot,
        )
    residual = rotation_residual(T[:, :3, :3])
    if not np.all(residual <= ROTATION_TOLERANCE):
        knot = int(np.argmax(residual))
        raise InputError(
            f"T_world_hand[{knot}] has no rotation: residual {residual[knot]:.2g}, at most {ROTATION_TOLERANCE} is "
            "expected",
            field="T_world_hand",
            knot=knot,
        )
    return times, T, q


def all_fingers(q_hand: np.ndarray) -> np.ndarray:
    """Finger joints (H, n) as those of a hand with all fingers, shape (H, 7); fingers that it does not have are 0."""
    lacking = FINGERS - q_hand.shape[1]
    return np.pad(q_hand, ((0, 0), (0, lacking))) if lacking else q_hand


def curve_through(
    times: np.ndarray, T: np.ndarray, q: np.ndarray, limits: HandLimits
) -> tuple[PiecewiseQuintic, np.ndarray]:
    """The C2 curve through checked knots, with its start from rest and its stop; and which are outliers, ``(H,)``."""
    y = np.concatenate([T[:, :3, 3], continuous_quaternions(T[:, :3, :3]), q], axis=1)
    outliers = np.zeros(len(times), dtype=bool)
    jets = np.stack([y, *knot_derivatives(times, y, outliers)])
    for part, limit in zip(PARTS, limits.motions, strict=True):
        limited = outlier_knots(times, y, part, limit)
        outliers |= limited
        if limited.any():
            jets[1:, :, part] = knot_derivatives(times, y[:, part], limited)
        _slow_ends(jets, part, limit)
    times, jets = _start_and_stop(times, jets, limits)
    return PiecewiseQuintic(times, quintic(np.diff(times), jets[:, :-1], jets[:, 1:])), outliers


def outlier_knots(times: np.ndarray, y: np.ndarray, part: slice, limit: MotionLimits) -> np.ndarray:
    """Knots next to a motion far beyond the limits, shape ``(H,)``: there a spline would ring into its neighbours."""
    outliers = np.zeros(len(times), dtype=bool)
    h = np.diff(times)
    secant = np.diff(y, axis=0) / h[:, None]
    fast = part_size(secant, part) > OUTLIER_SPEED * limit.speed
    outliers[:-1] |= fast
    outliers[1:] |= fast
    bend = np.diff(secant, axis=0) / (0.5 * (h[1:] + h[:-1]))[:, None]
    outliers[1:-1] |= part_size(bend, part) > OUTLIER_ACCELERATION * limit.acceleration
    if len(outliers) > 1:  # not-a-knot would carry an outlier beyond the second knot to the end
        outliers[[0, -1]] |= outliers[[1, -2]]
    return outliers


def _slow_ends(jets: np.ndarray, part: slice, limit: MotionLimits) -> None:
    """Bring velocity and acceleration of the end knots inside the limits, in place, so that start and stop are short.

    Segments are quintics, so any jet at a knot leaves the curve C2.
    """
    for knot in (0, -1):
        for order, bound in ((1, limit.speed), (2, limit.acceleration)):
            size = float(part_size(jets[order, knot], part))
            if size > bound:
                jets[order, knot, part] *= bound / size


def _start_and_stop(times: np.ndarray, jets: np.ndarray, limits: HandLimits) -> tuple[np.ndarray, np.ndarray]:
    """Knots and jets with a knot at rest before the first and one after the last."""
    before, after = brake_time(jets[:, 0], limits), brake_time(jets[:, -1], limits)
    rest = np.zeros((3, 2, jets.shape[2]))
    rest[0, 0] = jets[0, 0] - before * (jets[1, 0] / 2.0 - before * jets[2, 0] / 12.0)
    rest[0, 1] = jets[0, -1] + after * (jets[1, -1] / 2.0 + after * jets[2, -1] / 12.0)
    times = np.concatenate([[times[0] - before], times, [times[-1] + after]])
    return times, np.concatenate([rest[:, :1], jets, rest[:, 1:]], axis=1)


def brake_time(jet: np.ndarray, limits: HandLimits) -> float:
    """Time in which the jet ``(3, 14)`` comes to rest with a cubic velocity inside half of the limits, [s].

    The velocity ``v (1 - 3 s^2 + 2 s^3) + a T (s - 2 s^2 + s^3)`` has the peak acceleration ``1.5 v / T`` and the
    peak jerks ``6 v / T^2`` and ``4 a / T``. The displacement is ``v T / 2 + a T^2 / 12``.
    """
    time = BRAKE_MIN
    for part, limit in zip(PARTS, limits.motions, strict=True):
        v, a = float(part_size(jet[1], part)), float(part_size(jet[2], part))
        time = max(time, 3.0 * v / limit.acceleration, (12.0 * v / limit.jerk) ** 0.5, 8.0 * a / limit.jerk)
    return time
