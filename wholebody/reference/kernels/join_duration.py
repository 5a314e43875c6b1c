"""In what time a path may be joined to the motion that it continues: what the quintic to zero asks of a hand.

The parts of the channels are position 3 [m], quaternion 4, whose change counts twice [rad], and fingers 7 [rad].
"""

from __future__ import annotations

import math

import numpy as np

from wholebody.jit.arrays import Matrix, Vector

POINTS = 25
"""At which a quintic is looked at."""


def join_duration(error: Matrix, basis: np.ndarray, durations: Vector, bounds: Matrix, halvings: int) -> float:
    """The first duration in which the correction stays inside the bounds, or the one that comes nearest [s].

    Args:
        error: Value and two derivatives of what is to go to zero (3, 14).
        basis: The quintics to zero of the three unit jets and their derivatives (4, POINTS, 3).
        durations: Increasing (n,) [s].
        bounds: Of speed, acceleration and jerk (columns) of position, orientation and fingers (3, 3).
        halvings: How often the step before the first one is halved in search of a shorter one; 0 for errors at rest,
            which take their `least_duration`.
    """
    last = durations.shape[0] - 1
    best, best_excess = durations[last], math.inf
    least = least_duration(error, bounds) if halvings == 0 else 0.0
    for n in range(last + 1):
        if durations[n] < least and n < last:
            continue
        excess = join_excess(error, basis, durations[n], bounds)
        if excess <= 1.0:
            short = durations[max(n - 1, 0)]
            return halved(error, basis, short, durations[n], bounds, halvings if n > 0 else 0)
        if excess < best_excess:
            best, best_excess = durations[n], excess
    return best


def halved(error: Matrix, basis: np.ndarray, short: float, long: float, bounds: Matrix, halvings: int) -> float:
    """A duration between one that is too short and one that is not, by bisection; it is not too short [s]."""
    for _ in range(halvings):
        middle = 0.5 * (short + long)
        if join_excess(error, basis, middle, bounds) <= 1.0:
            long = middle
        else:
            short = middle
    return long


def least_duration(error: Matrix, bounds: Matrix) -> float:
    """Half of what a minimum-jerk move over the distance takes from rest to rest: anything shorter is not worth trying.

    Its peaks are 1.875 d / T, 5.77 d / T^2 and 60 d / T^3.
    """
    least = 0.0
    for part in range(3):
        d = rate_size(error, part, 1.0, 0.0, 0.0)
        speed, acceleration, jerk = bounds[part, 0], bounds[part, 1], bounds[part, 2]
        least = max(least, 1.875 * d / speed, math.sqrt(5.77 * d / acceleration), (60.0 * d / jerk) ** (1.0 / 3.0))
    return 0.5 * least


def join_excess(error: Matrix, basis: np.ndarray, duration: float, bounds: Matrix) -> float:
    """Largest ratio of speed, acceleration and jerk of the correction to what they may be.

    Where speed or acceleration begins above its bound, that counts instead of the bound.
    """
    worst = 0.0
    for order in range(1, 4):
        for part in range(3):
            largest, bound = 0.0, bounds[part, order - 1]
            for k in range(POINTS):
                place, speed, bend = basis[order, k, 0], basis[order, k, 1], basis[order, k, 2]
                size = rate_size(error, part, place, duration * speed, duration**2 * bend) / duration**order
                largest = max(largest, size)
                if k == 0 and order < 3:
                    bound = max(bound, size)
            worst = max(worst, largest / bound)
    return worst


def rate_size(error: Matrix, part: int, place: float, speed: float, bend: float) -> float:
    """Size of one part of the jet ``error`` (3, 14) with its rows weighted by these."""
    first, end = (0, 3) if part == 0 else ((3, 7) if part == 1 else (7, 14))
    squares, largest = 0.0, 0.0
    for c in range(first, end):
        x = place * error[0, c] + speed * error[1, c] + bend * error[2, c]
        squares += x * x
        largest = max(largest, abs(x))
    if part == 2:
        return largest
    return math.sqrt(squares) * (2.0 if part == 1 else 1.0)
