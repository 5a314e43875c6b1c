"""Jerks after which the limits can be kept for ever.

Source:
    Del Prete 2018, "Joint Position and Velocity Bounds in Discrete-Time Acceleration/Torque Control", RA-L, one order
    higher.
"""

from __future__ import annotations

import math

import numpy as np

from wholebody.reference.kernels.smoother_memory import clip_norm, norm

STOP_SHARE = 0.9
"""Share of jerk and acceleration that a finger's stop at its limit counts on; chosen: the rest absorbs the discrete
time."""


def is_viable(
    hand: np.record, n: int, bound_v: float, bound_a: float, bound_stop: float, max_j: float, dt: float
) -> bool:
    """Whether the jerk leads over the tick to a state from which the bounds can be kept for ever."""
    speed2, stop2, accel2 = 0.0, 0.0, 0.0
    for i in range(n):
        accel2 += (hand.a[i] + hand.jerk[i] * dt) ** 2
    to_zero = 0.5 * (math.sqrt(accel2) / max_j + dt)
    for i in range(n):
        v = hand.v[i] + hand.a[i] * dt + 0.5 * hand.jerk[i] * dt * dt
        speed2 += v * v
        stop2 += (v + (hand.a[i] + hand.jerk[i] * dt) * to_zero) ** 2
    return accel2 <= bound_a**2 and speed2 <= bound_v**2 and stop2 <= bound_stop**2


def keep_viable(hand: np.record, n: int, limits: np.record, k: int, dt: float) -> None:
    """Move the jerk towards "acceleration to zero" as far as the limits demand.

    What exceeds a limit at the start (a filter reset to a faster motion) bounds instead of it, so it only shrinks.
    """
    max_v, max_a, max_j = limits.speed[k], limits.acceleration[k], limits.jerk[k]
    clip_norm(hand.jerk, n, max_j)
    size = norm(hand.a, n)
    bound_a = max(max_a, size)
    for i in range(n):
        hand.wanted[i] = hand.a[i] + hand.jerk[i] * dt
        hand.brake[i] = hand.v[i] + hand.a[i] * (0.5 * (size / max_j + dt))
    bound_v, bound_stop = max(max_v, norm(hand.v, n)), max(max_v, norm(hand.brake, n))
    if clip_norm(hand.wanted, n, bound_a):  # a projection on a ball shortens the step from a point inside
        for i in range(n):
            hand.jerk[i] = (hand.wanted[i] - hand.a[i]) / dt
    bound_a *= 1.0 + 1e-12  # what was projected on the ball counts as inside
    if is_viable(hand, n, bound_v, bound_a, bound_stop, max_j, dt):
        return
    scale = -min(1.0 / dt, max_j / max(size, 1e-300))
    for i in range(n):
        hand.brake[i] = hand.a[i] * scale
        hand.wanted[i] = hand.jerk[i]
    low, high = 0.0, 1.0
    for trial in range(16):
        share = 0.5 * (low + high) if trial < 15 else low
        for i in range(n):
            hand.jerk[i] = hand.brake[i] + share * (hand.wanted[i] - hand.brake[i])
        if is_viable(hand, n, bound_v, bound_a, bound_stop, max_j, dt):
            low = share
        else:
            high = share


def stop_distance(v: float, a: float, max_a: float, max_j: float) -> float:
    """How far a coordinate still moves in the positive direction if it stops as fast as the limits allow."""
    speed = v + 0.5 * a * a / max_j  # once the acceleration is zero (or where it last was)
    if (v <= 0.0 and a <= 0.0) or speed <= 0.0:
        return 0.0
    if speed <= max_a * max_a / max_j:
        stop = speed * math.sqrt(speed / max_j)
    else:
        stop = 0.5 * speed * (speed / max_a + max_a / max_j)
    return max(0.0, stop + v * a / max_j + a * a * a / (3.0 * max_j * max_j))


def stops_within(v: float, a: float, j: float, room: float, max_a: float, max_j: float, dt: float) -> bool:
    """Whether a coordinate that takes jerk ``j`` over the tick can then stop before it has moved by ``room``."""
    ahead = v * dt + a * (0.5 * dt * dt) + j * (dt * dt * dt / 6.0)
    return ahead + stop_distance(v + a * dt + j * (0.5 * dt * dt), a + j * dt, max_a, max_j) <= room


def keep_range(hand: np.record, x: float, lower: float, upper: float, limits: np.record, k: int, dt: float) -> None:
    """Move the jerk of a finger joint until it can stop inside its range.

    A joint that is outside already, or too fast to stop inside, gets no worse.
    """
    # Long ticks follow the fastest stop less closely.
    share = STOP_SHARE / (1.0 + limits.jerk[k] * dt / limits.acceleration[k])
    max_a, max_j = share * limits.acceleration[k], share * limits.jerk[k]
    for side in range(2):
        sign = 1.0 - 2.0 * side
        v, a, wanted = sign * hand.v[0], sign * hand.a[0], sign * hand.jerk[0]
        room = max((upper - x) if side == 0 else (x - lower), stop_distance(v, a, max_a, max_j))
        if stops_within(v, a, wanted, room, max_a, max_j, dt):
            continue
        hardest = min(wanted, max(-limits.jerk[k], (-limits.acceleration[k] - a) / dt))
        low, high = 0.0, 1.0
        for _ in range(16):
            share = 0.5 * (low + high)
            if stops_within(v, a, hardest + share * (wanted - hardest), room, max_a, max_j, dt):
                low = share
            else:
                high = share
        hand.jerk[0] = sign * (hardest + low * (wanted - hardest))
