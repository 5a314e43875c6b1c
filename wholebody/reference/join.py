"""Continue from what is being commanded: add to a path the quintic that takes the difference to zero.

The sum begins with exactly the commanded position, velocity and acceleration, is C2, and after the join it is the path
itself. Where both agree the difference is zero and nothing is added: replaying a smooth motion in chunks loses nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wholebody.jit.entry import Entry
from wholebody.reference.hand_limits import HandLimits
from wholebody.reference.kernels import join_duration as _kernel
from wholebody.reference.kernels.join_duration import POINTS
from wholebody.reference.knots import FINGER, PARTS, POSITION, ROTATION, brake_time, part_size
from wholebody.reference.layout import HandMotion
from wholebody.reference.rotation import quaternion_rates, rotation_angle, unit_quaternion
from wholebody.reference.spline import PiecewiseQuintic, quintic, shift

JOIN_SHARES = (0.25, 0.25, 0.25)
"""Share of each of the limits on speed, acceleration and jerk that the correction may use; chosen: the rest is for the
path."""
HURRY = 4.0
"""Factor by which a velocity is corrected more than a position; chosen: the longer it lasts, the further it leads
away."""
DURATIONS = np.geomspace(0.1, 4.0, 17)
"""Join times that are tried [s]; chosen: from three steps of a 30 Hz chunk to longer than any chunk."""
HALVINGS = 8
"""How often the step between two of them is halved for a motion that is on its way; chosen: to 0.1 % of the time, so
that a way which is joined anew at every step is as short as one that is joined once."""
ASTRAY = 1.1
"""Multiple of its distance from the path that a motion on its way there comes to at most [no unit]; chosen: rates that
lead away are given up instead, as an acceleration that lasts would lead metres away."""
STRAIGHT_COSINE = 0.99
"""Cosine of the angle up to which a hand moves straight towards its path [no unit]; chosen: 8 degrees."""
PATIENCE = 2.5
"""Longer than that nothing is joined for the sake of comfort [s]; chosen, no trial is on record."""

NO_DIFFERENCE = (0.012, 0.06, 0.1)
"""Position [m], orientation [quaternion's length] and fingers [rad]: a correction below is no difference; chosen, no
trial is on record."""

_S = np.linspace(0.0, 1.0, POINTS)
_UNIT = PiecewiseQuintic(
    np.array([0.0, 1.0]), quintic(np.ones(1), np.eye(3)[:, None], np.zeros((3, 1, 3)))
)  # the quintics to zero of the three unit jets
_BASIS = np.stack(_UNIT(_S, 3))
"""They and their derivatives at `_S`, (4, 25, 3)."""

_join_duration = Entry(_kernel.join_duration)


@dataclass(frozen=True)
class Join:
    """How a path was joined to the motion that it continues.

    Attributes:
        s: Where it was joined [s].
        duration: Until the chunk's own path is reached [s].
        distance: Between the motion and the chunk's own path at ``s`` [m].
        angle: The same for the orientation [rad].
        finger: Largest difference of a finger joint at ``s`` [rad].
        rough: Whether the rates of the path at ``s`` are far from the motion's.
    """

    s: float
    duration: float
    distance: float
    angle: float
    finger: float
    rough: bool


def join_curve(
    curve: PiecewiseQuintic, motion: HandMotion, s: float, limits: HandLimits, most: HandLimits
) -> tuple[PiecewiseQuintic, Join]:
    """The curve from ``s`` on, corrected to begin with ``motion``, with a start from rest before it.

    Args:
        curve: Curve in the 14 channels of `knots`.
        motion: One row: what is commanded at ``s``.
        s: Parameter of the join [s].
        limits: The correction uses `JOIN_SHARES` of them.
        most: Limits that a way of more than `PATIENCE` may use instead.
    """
    own = np.stack(curve(np.array([s])))[:, 0]
    start = commanded_jet(motion, own[0, ROTATION])
    error = start - own
    place, velocity, acceleration = (np.where(np.arange(3)[:, None] == k, error, 0.0) for k in range(3))
    within, patience = limits, 0.0
    if join_duration(place, limits) > PATIENCE:
        within, patience = most, PATIENCE
    duration = max(join_duration(place, within), patience)
    from_rest, under_way = (join_duration(jet, within, HALVINGS) for jet in (place, error))
    # The rates of a path at its first knot are only guessed: where they make no difference they are given up at once.
    rough = _excursion(velocity + acceleration, DURATIONS[0]) > 1.0
    settling = join_duration(velocity, limits.scaled(HURRY)) if rough else DURATIONS[0]
    on_its_way = max(under_way, patience * under_way / from_rest)
    astray = _excursion(error, on_its_way) > ASTRAY * _excursion(place, on_its_way)
    if under_way < min(from_rest, duration) and not astray and _heads_there(error, on_its_way):
        # The motion is on its way to the path already: one that gave up its rates would begin anew.
        duration = on_its_way
        joined = _corrected(curve, error[None], s, [duration])
    else:
        # An acceleration that lasted as long would lead metres away.
        joined = _corrected(curve, np.stack([place, velocity, acceleration]), s, [duration, settling, DURATIONS[0]])
        duration = max(duration, settling)
    before = brake_time(start, limits)
    rest = np.zeros_like(start)
    rest[0] = start[0] - before * (start[1] / 2.0 - before * start[2] / 12.0)
    lead = quintic(np.array([before]), rest[:, None], start[:, None])
    whole = PiecewiseQuintic(np.concatenate([[s - before], joined.breaks]), np.concatenate([lead, joined.coefficients]))
    angle = float(rotation_angle(unit_quaternion(own[0, ROTATION]), motion.quat))
    return whole, Join(
        s, duration, float(part_size(error[0], POSITION)), angle, float(part_size(error[0], FINGER)), rough
    )


def commanded_jet(motion: HandMotion, near: np.ndarray) -> np.ndarray:
    """Value and two derivatives of a motion in the channels, (3, 14); the quaternion on the side of ``near`` (4,)."""
    side = -1.0 if motion.quat @ near < 0.0 else 1.0
    jet = np.empty((3, 14))
    jet[:, POSITION] = motion.p, motion.v, motion.a
    jet[:, ROTATION] = motion.quat, *quaternion_rates(motion.quat, motion.w, motion.alpha)
    jet[:, ROTATION] *= side
    jet[:, FINGER] = motion.q_finger, motion.dq_finger, motion.ddq_finger
    return jet


def join_duration(error: np.ndarray, limits: HandLimits, halvings: int = 0) -> float:
    """Shortest of `DURATIONS` in which the correction stays inside the limits, or the one that comes nearest, [s].

    The path does not count: recordings are rough enough that no join would ever be smooth beside them. Where the
    correction begins above a limit, that counts instead of the limit.
    """
    return _join_duration(error, _BASIS, DURATIONS, _bounds(limits), halvings)


def _excursion(error: np.ndarray, duration: float) -> float:
    """Largest ratio of a correction to `NO_DIFFERENCE`."""
    return max(_excursions(error, duration))


def _excursions(error: np.ndarray, duration: float) -> list[float]:
    """The ratio of position, orientation and fingers."""
    values = _BASIS[0] @ (error * np.array([[1.0], [duration], [duration**2]]))
    return [float(part_size(values, part).max()) / small for part, small in zip(PARTS, NO_DIFFERENCE, strict=True)]


def _heads_there(error: np.ndarray, duration: float) -> bool:
    """Whether a hand moves straight towards the path, as one does whose chunk says again what the one before said.

    A hand that is there already, as far as that is no difference, does not keep its fingers from closing.
    """
    place, velocity = error[0, POSITION], error[1, POSITION]
    if float(place @ velocity) <= -STRAIGHT_COSINE * float(np.linalg.norm(place) * np.linalg.norm(velocity)):
        return True
    position, _, fingers = _excursions(error, duration)
    return position <= 1.0 < fingers


def _bounds(limits: HandLimits) -> np.ndarray:
    """Speed, acceleration and jerk (columns) that a correction may have, of position, orientation, fingers: (3, 3)."""
    return np.array([[limit.speed, limit.acceleration, limit.jerk] for limit in limits.motions]) * JOIN_SHARES


def _corrected(curve: PiecewiseQuintic, errors: np.ndarray, s: float, durations: list[float]) -> PiecewiseQuintic:
    """The curve from ``s`` on, plus the quintics that take errors (k, 3, 14) to zero in durations (k,)."""
    ends = s + np.array(durations)
    curve = curve.split(np.array([s, *ends])).after(s)
    counts = np.searchsorted(curve.breaks, ends)
    quintics = quintic(np.array(durations), errors.swapaxes(0, 1), np.zeros_like(errors).swapaxes(0, 1))
    moved = shift(np.repeat(quintics, counts, axis=0), np.concatenate([curve.breaks[:n] - s for n in counts]))
    coefficients = curve.coefficients.copy()
    for part, n in zip(np.split(moved, np.cumsum(counts)[:-1]), counts, strict=True):
        coefficients[:n] += part
    return PiecewiseQuintic(curve.breaks, coefficients)
