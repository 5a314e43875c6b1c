"""What the controller is to follow at one tick, from a plan; compiled by `wholebody.jit`.

One call does what a tick needs before its program: how far along the plan the robot may go, where the hands should be
there, the smoother behind, and the whole-body trajectory, all written into the row of `control.reference_packet`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wholebody.control.reference_packet import COM, HEIGHT, MOMENTUM, PALM, PELVIS, POSTURE, TORSO
from wholebody.jit.arrays import Matrix, Vector
from wholebody.jit.record import record
from wholebody.planning.trajectory import SampledTrajectory
from wholebody.reference.kernels.path import path_row
from wholebody.reference.kernels.path_clock import advanced, scale
from wholebody.reference.kernels.smoother import smoother_step
from wholebody.robot.kernels.pendulum import natural_frequency

TRUST_MIN = 1e-3
"""Least trust in the hands, a share; chosen: none at all would leave the arms without a task."""

ON_PLACE, OFF_PLACE = 0.02, 0.04
"""Distances of a palm from where it is commanded up to which its arm does not count in how far the robot is off its
plan, and from which it does [m]; measured: stretched arms that keep palms within 11 mm on realistic robots, which
dance, have elbows up to 0.45 rad off; two of 86 let go for that, and fell."""

SETTINGS = record(
    ("dt",),  # control period [s]
    ("moving",),  # 1 while there is a plan
    ("plan_rate",),  # speed along the chunk that is planned
    ("grid_start",), ("grid_step",),  # of the trajectory's rows [s]
    ("last_step",),  # parameter of the chunk's last step [s]
    ("leash", 2),  # how far hands may be led off the plan's paths [m], [rad]; 0: they follow these
    ("ahead",),  # how far the parameter of the paths that lead them is past that of the plan [s]
    ("error_slow",), ("error_stop",),  # palm error at which the plan is slowed and held [m]
    ("balance_slow",),  # distance of the capture point from the edge below which it is slowed [m]
    ("posture_slow",), ("posture_stop",),  # distance of a joint from the plan at which hands give way and have [rad]
)  # fmt: skip
"""Numbers that a plan or the configuration gives."""

CLOCK = record(
    ("s",), ("rate",), ("change",),  # path parameter [s] and its derivatives [1, 1/s]
    ("elapsed",), ("travelled",),  # time spent on chunks, and chunk time covered [s]
    ("share",),  # of the planned speed that the last tick allowed, 0 to 1
    ("trust",),  # in the hands, 0 to 1
)  # fmt: skip
"""What goes on from tick to tick beside the smoother."""


def trajectory_row(n_joints: int) -> np.dtype:
    """One row of a trajectory as `follow` reads it: what `SampledTrajectory` has at one parameter."""
    return record(
        ("q", 7 + n_joints), ("v", 6 + n_joints), ("ddq", n_joints), ("com", (3, 3)), ("momentum", (2, 3)),
        ("height", 3), ("pelvis", 15), ("torso", 15),
    )  # fmt: skip


def records(trajectory: SampledTrajectory) -> np.ndarray:
    """A trajectory as `kernel.follow` reads it: all that belongs to a point of the grid side by side."""
    n, n_joints = trajectory.ddq.shape
    rows = np.zeros(n, trajectory_row(n_joints))
    for name in ("q", "v", "ddq"):
        rows[name] = getattr(trajectory, name)
    for name in ("com", "momentum"):
        rows[name] = getattr(trajectory, name).transpose(1, 0, 2)
    rows["height"] = trajectory.height.T
    for name in ("pelvis", "torso"):
        rows[name] = np.concatenate([part.reshape(n, -1) for part in getattr(trajectory, name)], axis=1)
    return rows


class Plan(NamedTuple):
    """What is followed."""

    settings: np.ndarray  # one record of `SETTINGS`
    left: np.ndarray  # paths of the hands, flat, as wholebody.reference.kernels.path reads them
    right: np.ndarray
    trajectory: np.ndarray  # (n,) records of `trajectory_row`
    lead_left: np.ndarray  # paths that hands are led along instead, within a leash
    lead_right: np.ndarray


class Smoothing(NamedTuple):
    """The smoother of both hands."""

    state: np.ndarray  # (2,) records of `smoother_memory.HAND`
    target: np.ndarray  # (2, 40), kept while nothing is planned
    lead: np.ndarray  # (2, 40), where other paths lead the hands
    limits: np.ndarray  # (2,) records of `smoother_memory.LIMITS`
    offsets: np.ndarray  # (2, 3) palm points in the wrists' frames [m]


class Body(NamedTuple):
    """The robot on its feet."""

    edges: np.ndarray  # (k, 3) half-planes of the support: normal, offset
    fingers: np.ndarray  # (2, any) joints of each hand's fingers
    weights: np.ndarray  # (n_joints,) how much each joint's distance from the plan counts
    sides: np.ndarray  # (n_joints,) 0 or 1 for a joint of the left or the right arm, 2 for one of neither


def follow(
    plan: Plan, clock: np.ndarray, smoothing: Smoothing, body: Body, q: Vector, com: Vector, com_velocity: Vector,
    palms: Matrix, row: Vector, elapsed: float, allowed: float
) -> None:  # fmt: skip
    """One tick: advance clock and smoother in place, and write the reference.

    Args:
        plan: `Plan`.
        clock: One record of `CLOCK`, changed.
        smoothing: `Smoothing`, its state and target changed.
        body: `Body`.
        q: Configuration now (nq,).
        com: Centre of mass at the last tick (3,).
        com_velocity: Its velocity (3,).
        palms: Palm points in world at the last tick (2, 3).
        row: The reference of the last tick, replaced by that of this one (row_length,).
        elapsed: Time since the last tick [s]; 0 leaves clock and smoother as they are.
        allowed: Largest share of the planned speed, 0 to 1.
    """
    settings, now = plan.settings[0], clock[0]
    tracking = tracking_share(settings, row, palms)
    now.share = min(allowed, tracking, balance_share(settings, body.edges, com, com_velocity))
    ticks = 0 if elapsed <= 0.0 else max(round(elapsed / settings.dt), 1)
    run(plan, now, smoothing, ticks, elapsed / max(ticks, 1))
    for i in range(2):
        palm(smoothing.state[i].motion, smoothing.offsets[i], row[PALM * i : PALM * i + PALM])
    rate = now.rate if settings.moving > 0.0 else 0.0
    follow_trajectory(plan.trajectory[nearest(settings, now.s, plan.trajectory.shape[0])], rate, row)
    follow_fingers(smoothing.state, body.fingers, row)
    now.trust = trust(settings, q, row, body, palms)


def foresee(plan: Plan, clock: np.ndarray, smoothing: Smoothing, ticks: int) -> None:
    """Advance copies of clock and smoother by control periods, as `follow` will if the speed stays allowed."""
    run(plan, clock[0], smoothing, ticks, plan.settings[0].dt)


def run(plan: Plan, now: np.record, smoothing: Smoothing, ticks: int, dt: float) -> None:
    """Advance the clock ``now`` and the smoother by a number of steps of ``dt`` [s] each."""
    settings, target = plan.settings[0], smoothing.target
    for _ in range(ticks):
        if settings.moving > 0.0:
            wanted = settings.plan_rate * now.share
            now.s, now.rate, now.change = advanced(now.s, now.rate, now.change, dt, wanted)
            path_row(plan.left, now.s, target[0])
            path_row(plan.right, now.s, target[1])
            if settings.leash[0] > 0.0:
                path_row(plan.lead_left, now.s + settings.ahead, smoothing.lead[0])
                path_row(plan.lead_right, now.s + settings.ahead, smoothing.lead[1])
                for i in range(2):
                    leashed(smoothing.lead[i], settings.leash, target[i])
            for i in range(2):
                scale(target[i], now.rate, now.change)
            if now.s < settings.last_step:
                now.elapsed += dt
                now.travelled += dt * now.rate
        smoother_step(smoothing.state, target, smoothing.limits, dt)


def leashed(lead: Vector, leash: Vector, target: Vector) -> None:
    """Move a hand's target (40,) to where it is led, as far as the leash lets it; fingers go there.

    Rates are those of the mean of both motions with the share that is left of the way between them.
    """
    way, turn = 0.0, 0.0
    for i in range(3):
        way += (lead[i] - target[i]) ** 2
    for i in range(9, 13):
        turn += lead[i] * target[i]
    side = -1.0 if turn < 0.0 else 1.0
    share = min(1.0, leash[0] / max(math.sqrt(way), 1e-9))
    turn_share = min(1.0, leash[1] / max(2.0 * math.acos(min(abs(turn), 1.0)), 1e-9))
    for i in range(9):
        target[i] += share * (lead[i] - target[i])
    size = 0.0
    for i in range(9, 13):
        target[i] += turn_share * (side * lead[i] - target[i])
        size += target[i] ** 2
    for i in range(9, 13):
        target[i] /= math.sqrt(size)
    for i in range(13, 19):
        target[i] += turn_share * (lead[i] - target[i])
    for i in range(19, 40):
        target[i] = lead[i]


def tracking_share(settings: np.record, row: Vector, palms: Matrix) -> float:
    """Share of the planned speed that the errors of the palms (2, 3) at the last tick allow, 0 to 1."""
    error = 0.0
    for i in range(2):
        total = 0.0
        for k in range(3):
            total += (row[PALM * i + 9 + k] - palms[i, k]) ** 2
        error = max(error, math.sqrt(total))
    return clipped((settings.error_stop - error) / (settings.error_stop - settings.error_slow))


def balance_share(settings: np.record, edges: Matrix, com: Vector, com_velocity: Vector) -> float:
    """Share of the planned speed that the capture point's distance from the support's edge allows, 0 to 1."""
    omega = natural_frequency(com[2])
    x, y, margin = com[0] + com_velocity[0] / omega, com[1] + com_velocity[1] / omega, math.inf
    for e in range(edges.shape[0]):
        margin = min(margin, edges[e, 2] - (edges[e, 0] * x + edges[e, 1] * y))
    return clipped(margin / settings.balance_slow)


def clipped(x: float) -> float:
    """Between 0 and 1."""
    return min(max(x, 0.0), 1.0)


def palm(motion: Vector, offset: Vector, out: Vector) -> None:
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


def nearest(settings: np.record, s: float, n: int) -> int:
    """Nearest of ``n`` rows of the trajectory; the ends are held."""
    return min(max(round((s - settings.grid_start) / settings.grid_step), 0), n - 1)


def follow_trajectory(planned: np.record, rate: float, row: Vector) -> None:
    """One row of the trajectory at the speed ``rate``, into the reference."""
    n = planned.ddq.shape[0]
    for j in range(n):
        row[POSTURE + j], row[POSTURE + n + j] = planned.q[7 + j], rate * planned.v[6 + j]
        row[POSTURE + 2 * n + j] = rate**2 * planned.ddq[j]
    factor = 1.0
    for d in range(3):
        for i in range(3):
            row[COM + 3 * d + i] = factor * planned.com[d, i]
        row[HEIGHT + d] = factor * planned.height[d]
        factor *= rate
    for i in range(3):
        row[MOMENTUM + i] = rate * planned.momentum[0, i]
        row[MOMENTUM + 3 + i] = rate**2 * planned.momentum[1, i]
    follow_turn(planned.pelvis, rate, row, PELVIS)
    follow_turn(planned.torso, rate, row, TORSO)


def follow_turn(planned: Vector, rate: float, row: Vector, at: int) -> None:
    """Rotation (9), angular rate (3) and acceleration (3) at the speed ``rate``."""
    for i in range(9):
        row[at + i] = planned[i]
    for i in range(3):
        row[at + 9 + i] = rate * planned[9 + i]
        row[at + 12 + i] = rate**2 * planned[12 + i]


def follow_fingers(state: np.ndarray, fingers: np.ndarray, row: Vector) -> None:
    """Fingers do what the smoother commands."""
    n = (row.shape[0] - POSTURE) // 3
    for i in range(2):
        for c in range(fingers.shape[1]):
            j = fingers[i, c]
            for d in range(3):
                row[POSTURE + d * n + j] = state[i].motion[19 + 7 * d + c]


def trust(settings: np.record, q: Vector, row: Vector, body: Body, palms: Matrix) -> float:
    """Factor on the weights of the hands, 0 to 1: less where the body has left its plan.

    An arm whose palm is where it is commanded makes up for the trunk, and a stretched one bends far for that: its
    joints count as far as its palm is off, or legs and waist are, as those of a robot that falls around its hands.
    """
    distance = furthest(q, row, body, 2)
    off = min(max(2.0 * distance / settings.posture_slow - 1.0, 0.0), 1.0)
    for hand in range(2):
        distance = max(distance, max(off_place(row, palms, hand), off) * furthest(q, row, body, hand))
    room = (settings.posture_stop - distance) / (settings.posture_stop - settings.posture_slow)
    return min(max(room, TRUST_MIN), 1.0)


def furthest(q: Vector, row: Vector, body: Body, side: int) -> float:
    """Distance of the furthest joint of a side from its plan, as it counts [rad]."""
    distance = 0.0
    for j in range(body.weights.shape[0]):
        if body.sides[j] == side:
            distance = max(distance, body.weights[j] * abs(q[7 + j] - row[POSTURE + j]))
    return distance


def off_place(row: Vector, palms: Matrix, hand: int) -> float:
    """Share of its arm that counts in how far the robot is off its plan, 0 to 1, by how far a palm is off."""
    squares = 0.0
    for k in range(3):
        squares += (palms[hand, k] - row[PALM * hand + 9 + k]) ** 2
    return min(max((math.sqrt(squares) - ON_PLACE) / (OFF_PLACE - ON_PLACE), 0.0), 1.0)
