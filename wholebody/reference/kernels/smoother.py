r"""Arithmetic of the reference smoother: one tick for every hand.

`smoother_step` takes ``(state, target)`` to the next state, in place; the interpreted form is the specification. Groups
and the memory of a hand are those of `smoother_memory`. The jerk of a group is constant over a tick, so position,
velocity and acceleration are continuous whatever comes in.

1. Tracking. With the error ``e = x - r`` the jerk is that of the target plus that of the quintic which takes
   ``(e, e', e'')`` to zero in the time to go ``T`` (`quintic`). ``T`` counts down and is about the smallest for which
   the quintic keeps speed, acceleration and jerk inside the limits: a target that jumps is rejoined by a minimum-jerk
   move, a target that is being followed is followed with no lag.
2. Limits. The jerk is clipped in norm, then moved towards "bring the acceleration to zero" until the next state is
   viable (`viability`): ``|v| <= V``, ``|a| <= A`` and ``|v_stop| <= V``, where ``v_stop`` is the velocity that is left
   once the acceleration has been brought to zero at full jerk. Bringing it to zero keeps that set, so it is never left.
3. Range. A finger joint also keeps the position where it can come to rest inside its limits.
"""

from __future__ import annotations

import math

import numpy as np

from wholebody.jit.arrays import Matrix, Vector
from wholebody.reference.kernels.quintic import shorten_error, time_to_go
from wholebody.reference.kernels.smoother_memory import GROUPS, ROW, clip_norm, norm
from wholebody.reference.kernels.viability import keep_range, keep_viable


def read_target(hand: np.record, n: int, v: int, a: int, last: int, limits: np.record, k: int, dt: float) -> bool:
    """Motion of the target at the *start* of the tick, from that at its end, whose entries begin at ``v`` and ``a``.

    A target is followed at the limits at most. The jerk that its acceleration implies is used as it is up to the limit,
    fades out to twice that, and is ignored beyond: there the target is not a motion but a jump or noise. Whether
    it keeps all three limits is returned.
    """
    for i in range(n):
        hand.target_v[i] = hand.goal[v + i]
        hand.target_a[i] = hand.goal[a + i]
    clipped = clip_norm(hand.target_v, n, limits.speed[k])
    clipped = clip_norm(hand.target_a, n, limits.acceleration[k]) or clipped
    for i in range(n):
        hand.target_j[i] = (hand.target_a[i] - hand.target_acceleration[last + i]) / dt
        hand.target_acceleration[last + i] = hand.target_a[i]
    used = min(1.0, max(0.0, 2.0 - norm(hand.target_j, n) / limits.jerk[k]))
    for i in range(n):
        hand.target_j[i] *= used
        hand.target_v[i] += -hand.target_a[i] * dt + hand.target_j[i] * (0.5 * dt * dt)
        hand.target_a[i] -= hand.target_j[i] * dt
    return used == 1.0 and not clipped


def displacement(v: Vector, a: Vector, jerk: Vector, i: int, dt: float) -> float:
    """Way of coordinate ``i`` in a tick of constant jerk, ``v dt + a dt^2 / 2 + j dt^3 / 6`` [m]."""
    return v[i] * dt + a[i] * (0.5 * dt * dt) + jerk[i] * (dt * dt * dt / 6.0)


def target_displacement(hand: np.record, i: int, dt: float) -> float:
    """Way of the target in a tick, as `displacement`."""
    return displacement(hand.target_v, hand.target_a, hand.target_j, i, dt)


def quat_product(p: Vector, q: Vector, out: Vector) -> None:
    """Product of two quaternions (xyzw) into ``out``, which may be either of them."""
    x = p[3] * q[0] + p[0] * q[3] + p[1] * q[2] - p[2] * q[1]
    y = p[3] * q[1] - p[0] * q[2] + p[1] * q[3] + p[2] * q[0]
    z = p[3] * q[2] + p[0] * q[1] - p[1] * q[0] + p[2] * q[3]
    w = p[3] * q[3] - p[0] * q[0] - p[1] * q[1] - p[2] * q[2]
    size = math.sqrt(x * x + y * y + z * z + w * w)
    out[0], out[1], out[2], out[3] = x / size, y / size, z / size, w / size


def quat_exp(x: float, y: float, z: float, out: Vector) -> None:
    """Quaternion (xyzw) of a rotation vector [rad] into ``out``."""
    angle = math.sqrt(x * x + y * y + z * z)
    scale = 0.5 - angle * angle / 48.0 if angle < 1e-4 else math.sin(0.5 * angle) / angle
    out[0], out[1], out[2], out[3] = x * scale, y * scale, z * scale, math.cos(0.5 * angle)


def quat_error(q: Vector, r: Vector, error: Vector) -> None:
    """Write the rotation vector (3,) [rad], at most pi long, that turns ``r`` into ``q`` (4,), xyzw, in world axes."""
    x = -q[3] * r[0] + q[0] * r[3] - q[1] * r[2] + q[2] * r[1]
    y = -q[3] * r[1] + q[0] * r[2] + q[1] * r[3] - q[2] * r[0]
    z = -q[3] * r[2] - q[0] * r[1] + q[1] * r[0] + q[2] * r[3]
    w = q[3] * r[3] + q[0] * r[0] + q[1] * r[1] + q[2] * r[2]
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 if sine < 1e-9 else 2.0 * math.atan2(sine, abs(w)) / sine
    if w < 0.0:
        scale = -scale
    error[0], error[1], error[2] = x * scale, y * scale, z * scale


def rotation_error(hand: np.record, dt: float) -> None:
    """Error of the orientation at the start of the tick."""
    x, y, z = target_displacement(hand, 0, dt), target_displacement(hand, 1, dt), target_displacement(hand, 2, dt)
    quat_exp(-x, -y, -z, hand.turn)
    quat_product(hand.turn, hand.goal[9:13], hand.turn)
    quat_error(hand.motion[9:13], hand.turn, hand.error)


def rotate(hand: np.record, dt: float) -> None:
    """Advance the orientation over the tick."""
    v, a, jerk, second = hand.v, hand.a, hand.jerk, dt * dt * dt / 12.0
    quat_exp(  # with the second Magnus term: the axis moves during the tick
        displacement(v, a, jerk, 0, dt) + second * (a[1] * v[2] - a[2] * v[1]),
        displacement(v, a, jerk, 1, dt) + second * (a[2] * v[0] - a[0] * v[2]),
        displacement(v, a, jerk, 2, dt) + second * (a[0] * v[1] - a[1] * v[0]),
        hand.turn,
    )
    quat = hand.motion[9:13]
    quat_product(hand.turn, quat, quat)


def accept(hand: np.record, target: Vector) -> None:
    """Copy the target to the goal; where it is not finite, the last good pose at rest instead."""
    goal = hand.goal
    size = math.sqrt(target[9] ** 2 + target[10] ** 2 + target[11] ** 2 + target[12] ** 2)
    good = math.isfinite(size) and size > 0.5
    for i in range(ROW):
        good = good and math.isfinite(target[i])
        goal[i] = target[i]
    if not good:
        for i in range(ROW):
            goal[i] = 0.0
    for i in range(14):
        k = i if i < 3 else (i + 6 if i < 7 else i + 12)  # position 0..2, quaternion 9..12, fingers 19..25
        if good:
            hand.held[i] = goal[k] / (size if 3 <= i < 7 else 1.0)
        goal[k] = hand.held[i]


def clip_finger(goal: Vector, limits: np.record, i: int) -> None:
    """Clip a finger target to the range of its joint, at rest where it was outside."""
    x = min(max(goal[19 + i], limits.finger_lower[i]), limits.finger_upper[i])
    if x != goal[19 + i]:
        goal[19 + i] = x
        goal[26 + i] = 0.0
        goal[33 + i] = 0.0


def flush(x: float) -> float:
    """Zero for what has decayed to nothing: subnormal numbers would slow a robot at rest several times."""
    return x if abs(x) > 1e-100 else 0.0


def group_tick(hand: np.record, limits: np.record, k: int, dt: float) -> None:
    """Advance group ``k`` of one hand: 0 position, 1 orientation, from 2 on the fingers."""
    motion, goal, n = hand.motion, hand.goal, (3 if k < 2 else 1)
    x, v, a = (0, 3, 6) if k == 0 else ((9, 13, 16) if k == 1 else (17 + k, 24 + k, 31 + k))
    if k >= 2:
        clip_finger(goal, limits, k - 2)
    within = read_target(hand, n, v, a, 3 * k if k < 2 else 4 + k, limits, k, dt)
    for i in range(n):
        hand.v[i], hand.a[i] = motion[v + i], motion[a + i]
        hand.error_v[i], hand.error_a[i] = motion[v + i] - hand.target_v[i], motion[a + i] - hand.target_a[i]
        if k != 1:
            hand.error[i] = motion[x + i] - goal[x + i] + target_displacement(hand, i, dt)
    if k == 1:
        rotation_error(hand, dt)
    shorten_error(hand, n, limits, k)
    horizon = time_to_go(hand, n, limits, k, within, dt)
    hand.time_to_go[k] = horizon
    s = dt / horizon  # the mean jerk of the quintic over the tick: the acceleration lands on it
    h0, h1, h2 = s * (-60 + s * (180 - 120 * s)), s * (-36 + s * (96 - 60 * s)), s * (-9 + s * (18 - 10 * s))
    for i in range(n):
        back = ((hand.error[i] / horizon * h0 + hand.error_v[i] * h1) / horizon + hand.error_a[i] * h2) / dt
        hand.jerk[i] = hand.target_j[i] + back
    keep_viable(hand, n, limits, k, dt)
    if k >= 2:
        keep_range(hand, motion[x], limits.finger_lower[k - 2], limits.finger_upper[k - 2], limits, k, dt)
    for i in range(n):
        if k != 1:
            motion[x + i] += displacement(hand.v, hand.a, hand.jerk, i, dt)
        motion[v + i] = flush(hand.v[i] + hand.a[i] * dt + hand.jerk[i] * (0.5 * dt * dt))
        motion[a + i] = flush(hand.a[i] + hand.jerk[i] * dt)
    if k == 1:
        rotate(hand, dt)


def smoother_step(state: np.ndarray, target: Matrix, limits: np.ndarray, dt: float) -> None:
    """Advance every hand by one tick, in place.

    Args:
        state: One record of `smoother_memory.HAND` a hand; its ``motion`` is what is commanded.
        target: Where the hands should be at the *end* of the tick, rows of `layout`, shape ``(hands, 40)``.
        limits: One record of `smoother_memory.LIMITS` a hand.
        dt: Tick [s].
    """
    for h in range(state.shape[0]):
        hand = state[h]
        accept(hand, target[h])
        for k in range(GROUPS):
            group_tick(hand, limits[h], k, dt)
