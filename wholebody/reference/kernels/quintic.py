r"""The quintic that takes an error to zero: how long it may take within the limits of speed, acceleration and jerk.

Source:
    Flash and Hogan 1985, "The Coordination of Arm Movements", J. Neuroscience 5(7): the minimum-jerk law.
"""

import math

import numpy as np

from wholebody.reference.kernels.smoother_memory import clip_norm, norm

MIN_HORIZON = 0.04
"""Shortest time to go [s]; chosen: poles near 90 rad/s for errors too small to need a limit."""
MIN_TICKS = 10.0
"""Shortest time to go in ticks; chosen: keeps the discrete loop close to the continuous one at any rate."""
PLAN_SHARE = 0.95
"""Share of the limits that the quintic may use; chosen: the rest absorbs sampling and the target's own motion."""
SHRINK = 0.75
"""Factor by which the time to go is cut where the shorter quintic would still use less than `LAZY` of the limits;
chosen, no trial is on record."""
LAZY = 0.5
"""Share of what the target's own motion leaves of the limits; chosen, no trial is on record."""
GROWTH = 1.5
"""Factor from one time to go that is tried to the next; chosen, no trial is on record."""
TRIALS = 24
"""The time to go grows by dt, 1.5 dt, 2.25 dt, ... until the quintic fits: 24 trials span 67 s at 500 Hz."""
MAX_HORIZON = 1.0
"""Longest time to go [s], unless the limits are so low that one move needs more; chosen, no trial is on record."""

# Quintic to rest: e(s) = e0 h0(s) + T e0' h1(s) + T^2 e0'' h2(s), s = t / T, with
# h0 = 1 - 10 s^3 + 15 s^4 - 6 s^5, h1 = s - 6 s^3 + 8 s^4 - 3 s^5, h2 = (s^2 - 3 s^3 + 3 s^4 - s^5) / 2.
_S = np.arange(1, 8) / 8.0
_SPEED = np.stack(
    [
        -30 * _S**2 + 60 * _S**3 - 30 * _S**4,
        1 - 18 * _S**2 + 32 * _S**3 - 15 * _S**4,
        0.5 * (2 * _S - 9 * _S**2 + 12 * _S**3 - 5 * _S**4),
    ],
    axis=1,
)
_ACCELERATION = np.stack(
    [
        -60 * _S + 180 * _S**2 - 120 * _S**3,
        -36 * _S + 96 * _S**2 - 60 * _S**3,
        0.5 * (2 - 18 * _S + 36 * _S**2 - 20 * _S**3),
    ],
    axis=1,
)
_JERK = np.array([[-60.0, -36.0, -9.0], [30.0, 15.0, 1.5], [-60.0, -24.0, -3.0]])  # at s = 0, 1/2, 1


def move_excess(hand: np.record, n: int, max_v: float, max_a: float, max_j: float, horizon: float) -> float:
    """Largest ratio to its limit of speed, acceleration and jerk along the quintic; at most 1 if the move fits.

    The target's velocity and acceleration are taken as constant. A limit that is exceeded
    already counts as what it is exceeded by.
    """
    worst_v, worst_a, worst_j = 0.0, 0.0, 0.0
    for k in range(7):
        vv, aa = 0.0, 0.0
        for i in range(n):
            e0, e1, e2 = hand.error[i] / horizon, hand.error_v[i], hand.error_a[i] * horizon
            v = hand.target_v[i] + e0 * _SPEED[k, 0] + e1 * _SPEED[k, 1] + e2 * _SPEED[k, 2]
            a = e0 * _ACCELERATION[k, 0] + e1 * _ACCELERATION[k, 1] + e2 * _ACCELERATION[k, 2]
            a = hand.target_a[i] + a / horizon
            vv += v * v
            aa += a * a
        worst_v, worst_a = max(worst_v, vv), max(worst_a, aa)
    for k in range(3):
        jj = 0.0
        for i in range(n):
            e0, e1, e2 = hand.error[i] / horizon, hand.error_v[i], hand.error_a[i] * horizon
            j = (e0 * _JERK[k, 0] + e1 * _JERK[k, 1] + e2 * _JERK[k, 2]) / (horizon * horizon)
            jj += j * j
        worst_j = max(worst_j, jj)
    return max(math.sqrt(worst_v) / max_v, math.sqrt(worst_a) / max_a, math.sqrt(worst_j) / max_j)


def longest_horizon(limits: np.record, k: int) -> float:
    """Longest time to go [s]: enough for the quintic to reverse from full speed within the limits."""
    speed, acceleration, jerk = limits.speed[k], limits.acceleration[k], limits.jerk[k]
    return max(MAX_HORIZON, 6.0 * speed / acceleration, 12.0 * math.sqrt(speed / jerk))


def time_to_go(hand: np.record, n: int, limits: np.record, k: int, within: bool, dt: float) -> float:
    """Duration in which the quintic to zero error stays inside the limits, [s].

    The last one less two ticks where that fits; much less where the quintic is lazy; else the first longer one that
    fits, or the one that comes nearest. A quintic is lazy by what a target ``within`` the limits leaves
    of them: by its share of the whole, the error behind a fast target would never look lazy.
    """
    max_v = max(PLAN_SHARE * limits.speed[k], norm(hand.v, n), norm(hand.target_v, n))
    max_a = max(PLAN_SHARE * limits.acceleration[k], norm(hand.a, n), norm(hand.target_a, n))
    max_j = PLAN_SHARE * limits.jerk[k]
    own = max(norm(hand.target_v, n) / max_v, norm(hand.target_a, n) / max_a) if within else 0.0
    lazy = own + LAZY * (1.0 - own)
    shortest = max(MIN_HORIZON, MIN_TICKS * dt)
    longest = max(longest_horizon(limits, k), shortest)
    before = hand.time_to_go[k]
    horizon = min(max(before - 2.0 * dt, shortest), longest)
    best, best_excess, step, shrinking = horizon, math.inf, dt, False
    for _ in range(TRIALS):
        excess = move_excess(hand, n, max_v, max_a, max_j, horizon)
        if shrinking and excess > lazy:
            return best
        if excess <= 1.0:
            best = horizon
            if horizon <= shortest or horizon > before or excess > lazy:
                return best
            shrinking = True
            horizon = max(SHRINK * horizon, shortest)
            continue
        if excess < best_excess:
            best, best_excess = horizon, excess
        if horizon >= longest:
            return best
        horizon = min(horizon + step, longest)
        step *= GROWTH
    return best


def shorten_error(hand: np.record, n: int, limits: np.record, k: int) -> None:
    """Aim at a point on the way where the target is too far for one move: the group then cruises towards it.

    The feedback of horizon T settles at the closing speed ``5 e / 3 T``; an error of 0.54 T times the speed that the
    target leaves free cruises at 0.9 of it.
    """
    free = max(limits.speed[k] - norm(hand.target_v, n), 0.1 * limits.speed[k])
    clip_norm(hand.error, n, 0.54 * longest_horizon(limits, k) * free)
