r"""Arithmetic of the reference smoother: one tick for every hand, on flat arrays.

Everything here is plain Python on float64 arrays and compiles with numba as it stands (`wholebody.reference.compiled`);
the interpreted form is the specification. `smoother_step` takes ``(state, target)`` to the next state, in place.

A *group* is what a norm cap applies to: the position of a hand (3 coordinates), its orientation (3), each finger joint
(1). Its jerk is constant over a tick, so position, velocity and acceleration are continuous whatever comes in.

1. Tracking. With the error ``e = x - r`` the jerk is that of the target plus that of the quintic which takes
   ``(e, e', e'')`` to zero in the time to go ``T``. ``T`` counts down and is about the smallest for which the quintic
   keeps speed, acceleration and jerk inside the caps: a target that jumps is rejoined by a minimum-jerk move, a target
   that is being followed is followed with no lag.
2. Caps. The jerk is clipped in norm, then moved towards "bring the acceleration to zero" until the next state is
   viable: ``|v| <= V``, ``|a| <= A`` and ``|v_stop| <= V``, where ``v_stop`` is the velocity left once the acceleration
   has been brought to zero at full jerk. Bringing the acceleration to zero keeps that set, so it is never left.
3. Range. A finger joint also keeps the position where it can come to rest inside its limits.

Sources: the quintic is the minimum-jerk law of Flash and Hogan 1985, J. Neuroscience 5(7); viability as in Del Prete
2018, RA-L, "Joint Position and Velocity Bounds in Discrete-Time Acceleration/Torque Control", one order higher.
"""

import math

import numpy as np

# State of one hand: the commanded row (wholebody.reference.layout), then what the filter remembers.
ROW = 40
TARGET_A = 40  # acceleration of the last target: position 3, orientation 3, fingers 7
TIME_TO_GO = 53  # position, orientation, 7 fingers [s]
HELD = 62  # pose of the last finite target: position 3, quaternion 4, fingers 7
REJECTED = 76  # 1 where the target of this tick was not finite and the held pose was used
LIMITED = 77  # 1 where a cap or a joint limit shaped this tick
ERROR_P, ERROR_R = 78, 79  # distance [m] and angle [rad] from the target
# Room for a tick, so that nothing is allocated: where references need not be counted it takes half the time.
GOAL, GROUP, TURN = 80, 120, 153
STATE = 157

# Caps of one hand: speed, acceleration, jerk of each of the 9 groups; then the range of the 7 finger joints.
GROUPS = 9
FINGER_LOWER, FINGER_UPPER = 27, 34
CAPS = 41

MIN_HORIZON = 0.04
"""Shortest time to go [s]: poles near 90 rad/s for errors too small to need a cap."""
MIN_TICKS = 10.0
"""Shortest time to go in ticks: keeps the discrete loop close to the continuous one at any rate."""
PLAN_SHARE = 0.95
"""Share of the caps that the quintic may use; the rest absorbs sampling and the target's own motion."""
SHRINK = 0.75
"""The time to go is cut to this where the shorter quintic would still use less than `LAZY` of the caps."""
LAZY = 0.5
STOP_SHARE = 0.9
"""Share of jerk and acceleration that a finger's stop at its limit counts on; the rest absorbs the discrete time."""
GROWTH = 1.5
TRIALS = 24
"""The time to go grows by dt, 1.5 dt, 2.25 dt, ... until the quintic fits: 24 trials span 67 s at 500 Hz."""
MAX_HORIZON = 1.0
"""Longest time to go [s], unless the caps are so low that one move needs more."""

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

# Rows of the scratch array of one group, shape (11, 3); a group of n coordinates uses the first n columns.
ERR, ERR_V, ERR_A, NOW_V, NOW_A, REF_V, REF_A, REF_J, JERK, WANTED, BRAKE = range(11)
SCRATCH = 11


def row_norm(g, row, n):
    """Euclidean norm of the first ``n`` columns of a row of the scratch array."""
    total = 0.0
    for i in range(n):
        total += g[row, i] * g[row, i]
    return math.sqrt(total)


def limit_row(g, row, n, bound):
    """Scale a row in place to a norm of at most ``bound``; True where it was longer."""
    size = row_norm(g, row, n)
    if size <= bound:
        return False
    for i in range(n):
        g[row, i] *= bound / size
    return True


def plan_excess(g, n, cap_v, cap_a, cap_j, horizon):
    """Largest ratio to its cap of speed, acceleration and jerk along the quintic; at most 1 if the move fits.

    The target's velocity and acceleration are taken as constant. A cap counts as what is exceeded already, where it is.
    """
    worst_v, worst_a, worst_j = 0.0, 0.0, 0.0
    for k in range(7):
        vv, aa = 0.0, 0.0
        for i in range(n):
            e0, e1, e2 = g[ERR, i] / horizon, g[ERR_V, i], g[ERR_A, i] * horizon
            v = g[REF_V, i] + e0 * _SPEED[k, 0] + e1 * _SPEED[k, 1] + e2 * _SPEED[k, 2]
            a = e0 * _ACCELERATION[k, 0] + e1 * _ACCELERATION[k, 1] + e2 * _ACCELERATION[k, 2]
            a = g[REF_A, i] + a / horizon
            vv += v * v
            aa += a * a
        worst_v, worst_a = max(worst_v, vv), max(worst_a, aa)
    for k in range(3):
        jj = 0.0
        for i in range(n):
            e0, e1, e2 = g[ERR, i] / horizon, g[ERR_V, i], g[ERR_A, i] * horizon
            j = (e0 * _JERK[k, 0] + e1 * _JERK[k, 1] + e2 * _JERK[k, 2]) / (horizon * horizon)
            jj += j * j
        worst_j = max(worst_j, jj)
    return max(math.sqrt(worst_v) / cap_v, math.sqrt(worst_a) / cap_a, math.sqrt(worst_j) / cap_j)


def longest_horizon(caps, c):
    """Longest time to go [s]: enough for the quintic to reverse from full speed within the caps."""
    return max(MAX_HORIZON, 6.0 * caps[c] / caps[c + 1], 12.0 * math.sqrt(caps[c] / caps[c + 2]))


def time_to_go(g, n, caps, c, before, dt):
    """Duration in which the quintic to zero error stays inside the caps, [s].

    The last one less two ticks where that fits; much less where the quintic is lazy; else the first longer one that
    fits, or the one that comes nearest.
    """
    cap_v = max(PLAN_SHARE * caps[c], row_norm(g, NOW_V, n), row_norm(g, REF_V, n))
    cap_a = max(PLAN_SHARE * caps[c + 1], row_norm(g, NOW_A, n), row_norm(g, REF_A, n))
    cap_j = PLAN_SHARE * caps[c + 2]
    shortest = max(MIN_HORIZON, MIN_TICKS * dt)
    longest = max(longest_horizon(caps, c), shortest)
    horizon = min(max(before - 2.0 * dt, shortest), longest)
    best, best_excess, step, shrinking = horizon, math.inf, dt, False
    for _ in range(TRIALS):
        excess = plan_excess(g, n, cap_v, cap_a, cap_j, horizon)
        if shrinking and excess > LAZY:
            return best
        if excess <= 1.0:
            best = horizon
            if horizon <= shortest or horizon > before or excess > LAZY:
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


def shorten_error(g, n, caps, c):
    """Aim at a point on the way where the target is too far for one move: the group then cruises towards it.

    The feedback of horizon T settles at the closing speed ``5 e / 3 T``; an error of 0.54 T times the speed that the
    target leaves free cruises at 0.9 of it.
    """
    free = max(caps[c] - row_norm(g, REF_V, n), 0.1 * caps[c])
    limit_row(g, ERR, n, 0.54 * longest_horizon(caps, c) * free)


def is_viable(g, n, bound_v, bound_a, bound_stop, cap_j, dt):
    """Whether the jerk leads over the tick to a state from which the bounds can be kept for ever."""
    speed2, stop2, accel2 = 0.0, 0.0, 0.0
    for i in range(n):
        accel2 += (g[NOW_A, i] + g[JERK, i] * dt) ** 2
    to_zero = 0.5 * (math.sqrt(accel2) / cap_j + dt)
    for i in range(n):
        v = g[NOW_V, i] + g[NOW_A, i] * dt + 0.5 * g[JERK, i] * dt * dt
        speed2 += v * v
        stop2 += (v + (g[NOW_A, i] + g[JERK, i] * dt) * to_zero) ** 2
    return accel2 <= bound_a**2 and speed2 <= bound_v**2 and stop2 <= bound_stop**2


def keep_viable(g, n, caps, c, dt):
    """Move the jerk towards "acceleration to zero" as far as the caps demand; True where it was moved.

    What exceeds a cap at the start (a filter reset to a faster motion) bounds instead of the cap, so it only shrinks.
    """
    cap_v, cap_a, cap_j = caps[c], caps[c + 1], caps[c + 2]
    limited = limit_row(g, JERK, n, cap_j)
    size = row_norm(g, NOW_A, n)
    bound_a = max(cap_a, size)
    for i in range(n):
        g[WANTED, i] = g[NOW_A, i] + g[JERK, i] * dt
        g[BRAKE, i] = g[NOW_V, i] + g[NOW_A, i] * (0.5 * (size / cap_j + dt))
    bound_v, bound_stop = max(cap_v, row_norm(g, NOW_V, n)), max(cap_v, row_norm(g, BRAKE, n))
    if limit_row(g, WANTED, n, bound_a):  # a projection on a ball shortens the step from a point inside
        limited = True
        for i in range(n):
            g[JERK, i] = (g[WANTED, i] - g[NOW_A, i]) / dt
    bound_a *= 1.0 + 1e-12  # what was projected on the ball counts as inside
    if is_viable(g, n, bound_v, bound_a, bound_stop, cap_j, dt):
        return limited
    scale = -min(1.0 / dt, cap_j / max(size, 1e-300))
    for i in range(n):
        g[BRAKE, i] = g[NOW_A, i] * scale
        g[WANTED, i] = g[JERK, i]
    low, high = 0.0, 1.0
    for trial in range(16):
        share = 0.5 * (low + high) if trial < 15 else low
        for i in range(n):
            g[JERK, i] = g[BRAKE, i] + share * (g[WANTED, i] - g[BRAKE, i])
        if is_viable(g, n, bound_v, bound_a, bound_stop, cap_j, dt):
            low = share
        else:
            high = share
    return True


def stop_distance(v, a, cap_a, cap_j):
    """How far a coordinate still moves in the positive direction if it stops as fast as the caps allow."""
    speed = v + 0.5 * a * a / cap_j  # once the acceleration is zero (or where it last was)
    if (v <= 0.0 and a <= 0.0) or speed <= 0.0:
        return 0.0
    if speed <= cap_a * cap_a / cap_j:
        stop = speed * math.sqrt(speed / cap_j)
    else:
        stop = 0.5 * speed * (speed / cap_a + cap_a / cap_j)
    return max(0.0, stop + v * a / cap_j + a * a * a / (3.0 * cap_j * cap_j))


def stops_within(v, a, j, room, cap_a, cap_j, dt):
    """Whether a coordinate that takes jerk ``j`` over the tick can then stop before it has moved by ``room``."""
    ahead = v * dt + a * (0.5 * dt * dt) + j * (dt * dt * dt / 6.0)
    return ahead + stop_distance(v + a * dt + j * (0.5 * dt * dt), a + j * dt, cap_a, cap_j) <= room


def keep_range(g, x, lower, upper, caps, c, dt):
    """Move the jerk of a finger joint until it can stop inside its range; True where it was moved.

    A joint that is outside already, or too fast to stop inside, gets no worse.
    """
    moved = False
    # Long ticks follow the fastest stop less closely.
    share = STOP_SHARE / (1.0 + caps[c + 2] * dt / caps[c + 1])
    cap_a, cap_j = share * caps[c + 1], share * caps[c + 2]
    for side in range(2):
        sign = 1.0 - 2.0 * side
        v, a, wanted = sign * g[NOW_V, 0], sign * g[NOW_A, 0], sign * g[JERK, 0]
        room = max((upper - x) if side == 0 else (x - lower), stop_distance(v, a, cap_a, cap_j))
        if stops_within(v, a, wanted, room, cap_a, cap_j, dt):
            continue
        hardest = min(wanted, max(-caps[c + 2], (-caps[c + 1] - a) / dt))
        low, high = 0.0, 1.0
        for _ in range(16):
            share = 0.5 * (low + high)
            if stops_within(v, a, hardest + share * (wanted - hardest), room, cap_a, cap_j, dt):
                low = share
            else:
                high = share
        g[JERK, 0] = sign * (hardest + low * (wanted - hardest))
        moved = True
    return moved


def read_target(g, n, goal, v, a, last_a, caps, c, dt):
    """Motion of the target at the *start* of the tick, from that at its end; True where it was over the caps.

    A target is followed at the caps at most. The jerk that its acceleration implies is used as it is up to the cap,
    fades out to twice that, and is ignored beyond: there the target is not a motion but a jump or noise.
    """
    for i in range(n):
        g[REF_V, i] = goal[v + i]
        g[REF_A, i] = goal[a + i]
    over = limit_row(g, REF_V, n, caps[c])
    over = limit_row(g, REF_A, n, caps[c + 1]) or over
    for i in range(n):
        g[REF_J, i] = (g[REF_A, i] - last_a[i]) / dt
        last_a[i] = g[REF_A, i]
    size = row_norm(g, REF_J, n)
    share = min(1.0, max(0.0, 2.0 - size / caps[c + 2]))
    for i in range(n):
        g[REF_J, i] *= share
        g[REF_V, i] += -g[REF_A, i] * dt + g[REF_J, i] * (0.5 * dt * dt)
        g[REF_A, i] -= g[REF_J, i] * dt
    return over or share < 1.0


def travelled(g, row, i, dt):
    """Displacement of coordinate ``i`` over a tick of constant jerk; ``row`` is NOW_V or REF_V."""
    jerk = g[JERK, i] if row == NOW_V else g[REF_J, i]
    return g[row, i] * dt + g[row + 1, i] * (0.5 * dt * dt) + jerk * (dt * dt * dt / 6.0)


def quat_product(p, q, out):
    """Product of two quaternions (xyzw) into ``out``, which may be either of them."""
    x = p[3] * q[0] + p[0] * q[3] + p[1] * q[2] - p[2] * q[1]
    y = p[3] * q[1] - p[0] * q[2] + p[1] * q[3] + p[2] * q[0]
    z = p[3] * q[2] + p[0] * q[1] - p[1] * q[0] + p[2] * q[3]
    w = p[3] * q[3] - p[0] * q[0] - p[1] * q[1] - p[2] * q[2]
    size = math.sqrt(x * x + y * y + z * z + w * w)
    out[0], out[1], out[2], out[3] = x / size, y / size, z / size, w / size


def quat_exp(x, y, z, out):
    """Quaternion (xyzw) of a rotation vector [rad] into ``out``."""
    angle = math.sqrt(x * x + y * y + z * z)
    scale = 0.5 - angle * angle / 48.0 if angle < 1e-4 else math.sin(0.5 * angle) / angle
    out[0], out[1], out[2], out[3] = x * scale, y * scale, z * scale, math.cos(0.5 * angle)


def quat_error(q, r, g):
    """Write the rotation vector [rad], at most pi long, that turns ``r`` into ``q`` in world axes to the ERR row."""
    x = -q[3] * r[0] + q[0] * r[3] - q[1] * r[2] + q[2] * r[1]
    y = -q[3] * r[1] + q[0] * r[2] + q[1] * r[3] - q[2] * r[0]
    z = -q[3] * r[2] - q[0] * r[1] + q[1] * r[0] + q[2] * r[3]
    w = q[3] * r[3] + q[0] * r[0] + q[1] * r[1] + q[2] * r[2]
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 if sine < 1e-9 else 2.0 * math.atan2(sine, abs(w)) / sine
    if w < 0.0:
        scale = -scale
    g[ERR, 0], g[ERR, 1], g[ERR, 2] = x * scale, y * scale, z * scale


def rotation_error(g, quat, goal, dt, start):
    """Error of the orientation at the start of the tick, into the ERR row; ``start`` (4,) is scratch."""
    quat_exp(-travelled(g, REF_V, 0, dt), -travelled(g, REF_V, 1, dt), -travelled(g, REF_V, 2, dt), start)
    quat_product(start, goal, start)
    quat_error(quat, start, g)


def rotate(g, quat, dt, turn):
    """Advance a quaternion in place over the tick; ``turn`` (4,) is scratch."""
    v, a, second = g[NOW_V], g[NOW_A], dt * dt * dt / 12.0  # second Magnus term: the axis moves during the tick
    quat_exp(
        travelled(g, NOW_V, 0, dt) + second * (a[1] * v[2] - a[2] * v[1]),
        travelled(g, NOW_V, 1, dt) + second * (a[2] * v[0] - a[0] * v[2]),
        travelled(g, NOW_V, 2, dt) + second * (a[0] * v[1] - a[1] * v[0]),
        turn,
    )
    quat_product(turn, quat, quat)


def accept(state, target, goal):
    """Copy the target to ``goal``; where it is not finite, the last good pose at rest instead."""
    size = math.sqrt(target[9] ** 2 + target[10] ** 2 + target[11] ** 2 + target[12] ** 2)
    good = math.isfinite(size) and size > 0.5
    for i in range(ROW):
        good = good and math.isfinite(target[i])
        goal[i] = target[i]
    state[REJECTED] = 0.0 if good else 1.0
    if not good:
        for i in range(ROW):
            goal[i] = 0.0
    for i in range(14):
        k = i if i < 3 else (i + 6 if i < 7 else i + 12)  # position 0..2, quaternion 9..12, fingers 19..25
        if good:
            state[HELD + i] = goal[k] / (size if 3 <= i < 7 else 1.0)
        goal[k] = state[HELD + i]


def clip_finger(goal, caps, i):
    """Clip a finger target to the range of its joint, at rest where it was outside; True where it was."""
    x = min(max(goal[19 + i], caps[FINGER_LOWER + i]), caps[FINGER_UPPER + i])
    if x == goal[19 + i]:
        return False
    goal[19 + i] = x
    goal[26 + i] = 0.0
    goal[33 + i] = 0.0
    return True


def flush(x):
    """Zero for what has decayed to nothing: subnormal numbers would slow a robot at rest several times."""
    return x if abs(x) > 1e-100 else 0.0


def group_tick(state, goal, caps, k, dt, g):
    """Advance group ``k`` of one hand (0 position, 1 orientation, 2.. fingers); True where a cap shaped it."""
    n, c = (3 if k < 2 else 1), 3 * k
    x, v, a = (0, 3, 6) if k == 0 else ((9, 13, 16) if k == 1 else (17 + k, 24 + k, 31 + k))
    last = TARGET_A + (3 * k if k < 2 else 4 + k)
    limited = clip_finger(goal, caps, k - 2) if k >= 2 else False
    limited = read_target(g, n, goal, v, a, state[last : last + 3], caps, c, dt) or limited
    for i in range(n):
        g[NOW_V, i], g[NOW_A, i] = state[v + i], state[a + i]
        g[ERR_V, i], g[ERR_A, i] = state[v + i] - g[REF_V, i], state[a + i] - g[REF_A, i]
        if k != 1:
            g[ERR, i] = state[x + i] - goal[x + i] + travelled(g, REF_V, i, dt)
    if k == 1:
        rotation_error(g, state[9:13], goal[9:13], dt, state[TURN:STATE])
    shorten_error(g, n, caps, c)
    horizon = time_to_go(g, n, caps, c, state[TIME_TO_GO + k], dt)
    state[TIME_TO_GO + k] = horizon
    s = dt / horizon  # the mean jerk of the quintic over the tick: the acceleration lands on it
    h0, h1, h2 = s * (-60 + s * (180 - 120 * s)), s * (-36 + s * (96 - 60 * s)), s * (-9 + s * (18 - 10 * s))
    for i in range(n):
        back = ((g[ERR, i] / horizon * h0 + g[ERR_V, i] * h1) / horizon + g[ERR_A, i] * h2) / dt
        g[JERK, i] = g[REF_J, i] + back
    limited = keep_viable(g, n, caps, c, dt) or limited or horizon > max(MIN_HORIZON, MIN_TICKS * dt)
    if k >= 2:
        lower, upper = caps[FINGER_LOWER + k - 2], caps[FINGER_UPPER + k - 2]
        limited = keep_range(g, state[x], lower, upper, caps, c, dt) or limited
    for i in range(n):
        if k != 1:
            state[x + i] += travelled(g, NOW_V, i, dt)
        state[v + i] = flush(g[NOW_V, i] + g[NOW_A, i] * dt + g[JERK, i] * (0.5 * dt * dt))
        state[a + i] = flush(g[NOW_A, i] + g[JERK, i] * dt)
    if k == 1:
        rotate(g, state[9:13], dt, state[TURN:STATE])
    return limited


def smoother_step(state, target, caps, dt):
    """Advance every hand by one tick, in place.

    Args:
        state: Shape ``(hands, STATE)``; its first 40 columns are the commanded row.
        target: Where the hands should be at the *end* of the tick, rows of `layout`, shape ``(hands, 40)``.
        caps: Shape ``(hands, CAPS)``.
        dt: Tick [s].
    """
    for h in range(state.shape[0]):
        hand = state[h]
        g, goal = hand[GROUP:TURN].reshape((SCRATCH, 3)), hand[GOAL:GROUP]
        accept(hand, target[h], goal)
        limited = False
        for k in range(GROUPS):
            limited = group_tick(hand, goal, caps[h], k, dt, g) or limited
        hand[LIMITED] = 1.0 if limited else 0.0
        quat_error(hand[9:13], goal[9:13], g)
        hand[ERROR_R] = row_norm(g, ERR, 3)
        for i in range(3):
            g[ERR, i] = hand[i] - goal[i]
        hand[ERROR_P] = row_norm(g, ERR, 3)
