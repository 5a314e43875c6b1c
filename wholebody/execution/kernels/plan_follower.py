"""What the controller is to follow at one tick, from a plan; compiles with numba as it stands.

One call does what a tick needs before its program: how far along the plan the robot may go, where the hands should be
there, the smoother behind, and the posture plan, all written into the row of `control.reference_packet`.

Arguments that recur:

* ``settings`` and ``clock``: numbers, in the order of the constants below;
* ``paths``: both hands' paths, as `wholebody.reference.kernels.path` reads them;
* ``track``: the posture plan on its grid, a row each, in the order of the constants below;
* ``row``: the packed reference, (96 + 3 n_joints,).
"""

import math

from wholebody.reference.kernels.path import path_row
from wholebody.reference.kernels.smoother import smoother_step

# Settings: numbers that a plan or the configuration gives.
(DT, MOVING, PLAN_RATE, GRID_START, GRID_STEP, LAST_STEP, ERROR_SLOW, ERROR_STOP, BALANCE_SLOW, POSTURE_SLOW,
 POSTURE_STOP) = range(11)  # fmt: skip
SETTINGS = 11

# The clock: parameter and its derivatives, time spent on chunks and chunk time covered [s], trust in the hands.
S, RATE, CHANGE, ELAPSED, TRAVELLED, SHARE = range(6)
CLOCK = 6

# A row of the track: configuration, velocity and joint accelerations, then what comes with its derivatives:
# centre of mass (9), angular momentum and its rate (6), height (3), pelvis and torso (15 each).
TRACK_COM, TRACK_MOMENTUM, TRACK_HEIGHT, TRACK_PELVIS, TRACK_TORSO, TRACK_END = 0, 9, 15, 18, 33, 48

# Parts of the packed reference.
PALM, COM, MOMENTUM, PELVIS, TORSO, HEIGHT, POSTURE = 24, 48, 57, 63, 78, 93, 96

CHANGE_MAX, JERK_MAX = 4.0, 40.0
"""Largest |d2s/dt2| [1/s] and |d3s/dt3| [1/s^2] of the clock, as in `PathClock.advance`."""
SETTLE_TICKS, JERK_SHARE = 5.0, 0.5
"""As in `wholebody.reference.path_clock`."""
SHARE_MIN = 1e-3
"""Least trust in the hands: none at all would leave the arms without a task."""
GRAVITY, LOWEST = 9.81, 0.2
"""Of the pendulum [m/s^2], and its least height [m], as `wholebody.limits.balance`."""


def follow(settings, clock, paths, track, smoothing, support, measured, posture, row, fingers, shares):
    """One tick: advance clock and smoother in place, and write the reference.

    Args:
        settings: (SETTINGS,).
        clock: (CLOCK,), changed.
        paths: Flat paths of the left and right hand.
        track: (grid, 7 + 6 + 3 n_joints + TRACK_END).
        smoothing: State of the smoother (2, STATE), changed, its targets (2, 40), which are kept while nothing is
            planned, its caps (2, CAPS) and the palm points in the wrists' frames (2, 3).
        support: Half-planes of the support, normals and offsets (k, 3), and palm points in world (2, 3).
        measured: Configuration now (nq,), centre of mass and its velocity at the last tick (3,).
        posture: Out: configuration (nq,) and velocity (nv,) of the posture plan.
        row: The reference of the last tick, replaced by that of this one.
        fingers: Joints of each hand's fingers (2, any).
        shares: How much each joint's distance from the plan counts (n_joints,).
    """
    state, target, caps, offsets = smoothing
    if settings[MOVING] > 0.0:
        share = governor(settings, row, support, measured)
        advance(clock, settings[DT], settings[PLAN_RATE] * share)
        for i in range(2):
            path_row(paths[i], clock[S], target[i])
            scale(target[i], clock[RATE], clock[CHANGE])
        if clock[S] < settings[LAST_STEP]:
            clock[ELAPSED] += settings[DT]
            clock[TRAVELLED] += settings[DT] * clock[RATE]
    smoother_step(state, target, caps, settings[DT])
    for i in range(2):
        palm(state[i], offsets[i], row[PALM * i : PALM * i + PALM])
    rate = clock[RATE] if settings[MOVING] > 0.0 else 0.0
    follow_track(track[track_row(settings, clock[S], track.shape[0])], rate, posture, row)
    follow_fingers(state, fingers, row)
    clock[SHARE] = trust(settings, measured[0], row, shares)


def governor(settings, row, support, measured):
    """Share of the planned speed that tracking and balance allow, 0 to 1; errors are those of the last tick."""
    edges, palms = support
    _, com, velocity = measured
    error = 0.0
    for i in range(2):
        total = 0.0
        for k in range(3):
            total += (row[PALM * i + 9 + k] - palms[i, k]) ** 2
        error = max(error, math.sqrt(total))
    share = (settings[ERROR_STOP] - error) / (settings[ERROR_STOP] - settings[ERROR_SLOW])
    omega = math.sqrt(GRAVITY / max(com[2], LOWEST))
    x, y, margin = com[0] + velocity[0] / omega, com[1] + velocity[1] / omega, math.inf
    for e in range(edges.shape[0]):
        margin = min(margin, edges[e, 2] - (edges[e, 0] * x + edges[e, 1] * y))
    return min(clipped(share), clipped(margin / settings[BALANCE_SLOW]))


def clipped(x):
    """Between 0 and 1."""
    return min(max(x, 0.0), 1.0)


def advance(clock, dt, wanted):
    """`PathClock.advance` towards the rate ``wanted``, in place."""
    rate, change = clock[RATE], clock[CHANGE]
    gap = max(wanted, 0.0) - rate
    pull = min(CHANGE_MAX, math.sqrt(2.0 * JERK_SHARE * JERK_MAX * abs(gap)), abs(gap) / (SETTLE_TICKS * dt))
    jerk = min(max((math.copysign(pull, gap) - change) / dt, -JERK_MAX), JERK_MAX)
    after = rate + change * dt + 0.5 * jerk * dt**2
    if after < 0.0:  # the last tick of a stop
        clock[S], clock[RATE], clock[CHANGE] = clock[S] + 0.5 * rate * dt, 0.0, 0.0
        return
    clock[S] += rate * dt + 0.5 * change * dt**2 + jerk * dt**3 / 6.0
    clock[RATE], clock[CHANGE] = after, change + jerk * dt


def scale(row, rate, change):
    """`time_scaled` of one row, in place: derivatives with respect to time."""
    for first, second, n in ((3, 6, 3), (13, 16, 3), (26, 33, 7)):
        for k in range(n):
            row[second + k] = row[second + k] * rate**2 + row[first + k] * change
            row[first + k] *= rate


def palm(motion, offset, out):
    """The wrist's motion, seen at the palm point: rotation (9), position (3), twist (6) and acceleration (6)."""
    x, y, z, w = motion[9], motion[10], motion[11], motion[12]
    out[0], out[1], out[2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)
    out[3], out[4], out[5] = 2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)
    out[6], out[7], out[8] = 2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)
    a = out[0] * offset[0] + out[1] * offset[1] + out[2] * offset[2]
    b = out[3] * offset[0] + out[4] * offset[1] + out[5] * offset[2]
    c = out[6] * offset[0] + out[7] * offset[1] + out[8] * offset[2]
    out[9], out[10], out[11] = motion[0] + a, motion[1] + b, motion[2] + c
    wx, wy, wz = motion[13], motion[14], motion[15]
    ax, ay, az = motion[16], motion[17], motion[18]
    vx, vy, vz = wy * c - wz * b, wz * a - wx * c, wx * b - wy * a
    out[12], out[13], out[14] = motion[3] + vx, motion[4] + vy, motion[5] + vz
    out[15], out[16], out[17] = wx, wy, wz
    out[18] = motion[6] + (ay * c - az * b) + (wy * vz - wz * vy)
    out[19] = motion[7] + (az * a - ax * c) + (wz * vx - wx * vz)
    out[20] = motion[8] + (ax * b - ay * a) + (wx * vy - wy * vx)
    out[21], out[22], out[23] = ax, ay, az


def track_row(settings, s, n):
    """Nearest of ``n`` rows of the grid; the ends are held."""
    return min(max(round((s - settings[GRID_START]) / settings[GRID_STEP]), 0), n - 1)


def follow_track(track, rate, posture, row):
    """One row of the posture plan at the speed ``rate``, into the reference and into ``posture``."""
    q, v = posture
    n = v.shape[0] - 6
    at = q.shape[0]
    for i in range(q.shape[0]):
        q[i] = track[i]
    for i in range(v.shape[0]):
        v[i] = rate * track[at + i]
    at += v.shape[0]
    for j in range(n):
        row[POSTURE + j], row[POSTURE + n + j] = q[7 + j], v[6 + j]
        row[POSTURE + 2 * n + j] = rate**2 * track[at + j]
    at, factor = at + n, 1.0
    for d in range(3):
        for i in range(3):
            row[COM + 3 * d + i] = factor * track[at + TRACK_COM + 3 * d + i]
        row[HEIGHT + d] = factor * track[at + TRACK_HEIGHT + d]
        factor *= rate
    for i in range(3):
        row[MOMENTUM + i] = rate * track[at + TRACK_MOMENTUM + i]
        row[MOMENTUM + 3 + i] = rate**2 * track[at + TRACK_MOMENTUM + 3 + i]
    follow_turn(track, at + TRACK_PELVIS, rate, row, PELVIS)
    follow_turn(track, at + TRACK_TORSO, rate, row, TORSO)


def follow_turn(track, first, rate, row, at):
    """Rotation (9), angular rate (3) and acceleration (3) at the speed ``rate``."""
    for i in range(9):
        row[at + i] = track[first + i]
    for i in range(3):
        row[at + 9 + i] = rate * track[first + 9 + i]
        row[at + 12 + i] = rate**2 * track[first + 12 + i]


def follow_fingers(state, fingers, row):
    """Fingers do what the smoother commands."""
    n = (row.shape[0] - POSTURE) // 3
    for i in range(2):
        for c in range(fingers.shape[1]):
            j = fingers[i, c]
            for d in range(3):
                row[POSTURE + d * n + j] = state[i, 19 + 7 * d + c]


def trust(settings, q, row, shares):
    """How far the hands may pull: less where the body has left its plan, along which they would drag it further."""
    distance = 0.0
    for j in range(shares.shape[0]):
        distance = max(distance, shares[j] * abs(q[7 + j] - row[POSTURE + j]))
    room = (settings[POSTURE_STOP] - distance) / (settings[POSTURE_STOP] - settings[POSTURE_SLOW])
    return min(max(room, SHARE_MIN), 1.0)
