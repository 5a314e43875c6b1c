"""Joint bounds and the soft rows of the safety limits, as in `wholebody.limits`.

Soft rows lie in slots: edges of the support, trunk (`TRUNK_ROWS`), rows that are computed elsewhere, one a body that
may come near the floor, near pairs. A slot without a row has the bound `NO_BOUND`.
"""

from __future__ import annotations

import math

from wholebody.collision.gjk import support_vertex
from wholebody.jit.arrays import Indices, Vector
from wholebody.jit.packed import Packed
from wholebody.qp.kernels.active_set import NO_BOUND
from wholebody.robot.kernels.frames import PELVIS_FRAME, TORSO_FRAME, point_columns, point_drift, point_speed
from wholebody.robot.kernels.pendulum import natural_frequency
from wholebody.robot.kernels.rigid_body import COM, COM_DRIFT, COM_V, TOTAL_MASS
from wholebody.robot.kernels.rotation import rotate, rotation_between

TRUNK_ROWS = 15
"""Six for the orientation of the pelvis, six for that of the torso, three for the height of the pelvis."""


def limits(tick: Packed) -> None:
    """Bounds of the joints, and all soft rows."""
    joint_bounds(tick)
    if tick.trunk:
        at = tick.edges.shape[0]
        balance_rows(tick)
        orientation_rows(tick, tick.pelvis_ref, tick.pelvis_limit, PELVIS_FRAME, at)
        orientation_rows(tick, tick.torso_ref, tick.torso_limit, TORSO_FRAME, at + 6)
        height_rows(tick, PELVIS_FRAME, at + 12)
        floor_rows(tick, tick.n_balance)
        pair_rows(tick, tick.n_balance + tick.floor_body.shape[0])


def braking_acceleration(q: float, dq: float, q_max: float, dq_max: float, brake: float, dt: float) -> float:
    """Upper side of `viable_acceleration_bounds` for one joint."""
    distance = q_max - q
    by_velocity = (dq_max - dq) / dt
    by_position = 2.0 * (distance - dt * dq) / (dt * dt)
    if dq > 0.0 and by_position < -dq / dt:
        by_position = -(dq * dq) / (2.0 * distance) if distance > 0.0 else -brake
    b = dt * (2.0 * dq + brake * dt)
    c = dq * dq - 2.0 * brake * (distance - dt * dq)
    discriminant = b * b - 4.0 * dt * dt * c
    by_viability = -dq / dt
    if discriminant >= 0.0:
        by_viability = max((-b + math.sqrt(discriminant)) / (2.0 * dt * dt), by_viability)
    return min(by_velocity, by_position, by_viability)


def joint_bounds(tick: Packed) -> None:
    """Bounds ``ddq_min`` and ``ddq_max``; ``joint_limits`` (5, n) has rows ``q_min q_max dq_max ddq_max brake``."""
    q, v, joints, low, high, dt = tick.q, tick.v, tick.joint_limits, tick.ddq_min, tick.ddq_max, tick.horizon
    for j in range(low.shape[0]):
        x, dx, most = q[7 + j], v[6 + j], joints[3, j]
        upper = braking_acceleration(x, dx, joints[1, j], joints[2, j], joints[4, j], dt)
        lower = -braking_acceleration(-x, -dx, -joints[0, j], joints[2, j], joints[4, j], dt)
        upper, lower = min(max(upper, -most), most), min(max(lower, -most), most)
        if lower > upper:
            lower = upper = 0.5 * (lower + upper)
        low[j], high[j] = lower, upper


def braking_bound(margin: float, rate: float, brake: float, dt: float) -> float:
    """`wholebody.limits.base.braking_bound` for one row."""
    if margin < 0.0:
        allowed = margin / (4.0 * dt)
    elif margin > 2.0 * brake * dt * dt:
        allowed = math.sqrt(2.0 * brake * margin)
    else:
        allowed = margin / dt
    return (allowed - rate) / dt


def balance_rows(tick: Packed) -> None:
    """Rows of `CapturePointLimit`, one an edge of the support."""
    edges, n_edges, sums, F, J, upper = tick.edges, tick.n_edges, tick.sums, tick.F, tick.soft_J, tick.soft_upper
    margin, gain, mass = tick.balance_margin, tick.balance_gain, sums[TOTAL_MASS]
    omega = natural_frequency(sums[COM + 2])
    for e in range(edges.shape[0]):
        if e >= n_edges:
            upper[e] = NO_BOUND
            continue
        nx, ny = edges[e, 0], edges[e, 1]
        speed = nx * sums[COM_V] + ny * sums[COM_V + 1]
        tipped = max(nx * tick.tipped[0] + ny * tick.tipped[1] - margin, 0.0)
        left = edges[e, 2] - margin - tipped - (nx * sums[COM] + ny * sums[COM + 1] + speed / omega)
        upper[e] = omega * (gain * left - speed) - (nx * sums[COM_DRIFT] + ny * sums[COM_DRIFT + 1])
        for c in range(F.shape[0]):
            J[e, c] = (nx * F[c, 0] + ny * F[c, 1]) / mass


def orientation_rows(tick: Packed, plan: Vector, limit: Vector, f: int, at: int) -> None:
    """Six rows of `OrientationLimit` from slot ``at`` on.

    Args:
        tick: The memory.
        plan: Planned rotation (9), rate (3) and acceleration (3), (15,).
        limit: ``angle_max rate_max brake dt`` (4,).
        f: Frame of the body.
        at: First slot.
    """
    J, soft_J, upper, turn = tick.J, tick.soft_J, tick.soft_upper, tick.scratch
    velocity, drift, dt = tick.frame_V[f], tick.frame_A[f], limit[3]
    rotation_between(plan[:9].reshape((3, 3)), tick.frame_R[f], turn)
    for k in range(3):
        for side in range(2):
            sign, slot = 1.0 - 2.0 * side, at + 3 * side + k
            # The turn is plan minus body; the limit counts body minus plan.
            margin = limit[0] + sign * turn[k]
            rate = velocity[3 + k]
            stop = braking_bound(margin, sign * (rate - plan[9 + k]), limit[2], dt) + sign * plan[12 + k]
            upper[slot] = min(stop, (limit[1] - sign * rate) / dt) - sign * drift[3 + k]
            for c in range(J.shape[1]):
                soft_J[slot, c] = sign * J[6 * f + 3 + k, c]


def height_rows(tick: Packed, f: int, at: int) -> None:
    """Three rows of `HeightLimit` from slot ``at`` on: lowest, and above and below the plan.

    ``height_limit`` is ``band lowest brake dt`` (4,).
    """
    J, soft_J, upper, plan, limit = tick.J, tick.soft_J, tick.soft_upper, tick.height_ref, tick.height_limit
    z, rate, drift = tick.q[2] + tick.frame_p[f, 2], tick.frame_V[f, 2], tick.frame_A[f, 2]
    away, brake, dt = rate - plan[1], limit[2], limit[3]
    upper[at] = braking_bound(z - limit[1], -rate, brake, dt) + drift
    upper[at + 1] = braking_bound(plan[0] + limit[0] - z, away, brake, dt) + plan[2] - drift
    upper[at + 2] = braking_bound(z - plan[0] + limit[0], -away, brake, dt) + drift - plan[2]
    for c in range(J.shape[1]):
        soft_J[at, c] = soft_J[at + 2, c] = -J[6 * f + 2, c]
        soft_J[at + 1, c] = J[6 * f + 2, c]


def floor_rows(tick: Packed, at: int) -> None:
    """Rows of `FloorLimit`, a slot for each body from ``at`` on.

    The lowest vertex is climbed to from the one that was lowest before.
    """
    body, vertex, reach, R, p, upper = (
        tick.floor_body, tick.floor_vertex, tick.floor_reach, tick.R, tick.p, tick.soft_upper
    )  # fmt: skip
    base, lowest, trigger, point = tick.q[2], tick.floor_distance, tick.floor_trigger, tick.scratch[:3]
    for i in range(body.shape[0]):
        k = body[i]
        upper[at + i] = NO_BOUND
        if base + p[k, 2] - reach[i] - lowest >= trigger:
            continue
        x, y, z = -R[k, 2, 0], -R[k, 2, 1], -R[k, 2, 2]
        n = support_vertex(x, y, z, vertex[i], tick.vertices, tick.edge_start, tick.edge_end)
        vertex[i], local = n, tick.vertices[n]
        for a in range(3):
            point[a] = p[k, a] + rotate(R[k], a, local[0], local[1], local[2])
        room = base + point[2] - lowest
        if room < trigger:
            upper[at + i] = floor_row(tick, k, point, room, tick.soft_J[at + i])


def floor_row(tick: Packed, body: int, point: Vector, room: float, row: Vector) -> float:
    """Write the row (nv,) of the lowest point (3,) of a body; its bound."""
    V, A, up = tick.V[body], tick.A[body], tick.scratch[3:6]
    up[0], up[1], up[2] = 0.0, 0.0, 1.0
    clear(row)
    point_columns(tick.S, tick.parent, body, point, up, -1.0, row)
    leave_out(tick.driven, row)
    rate = point_speed(V, point, up)
    return braking_bound(room, -rate, tick.floor_brake, tick.floor_dt) + point_drift(V, A, point, up)


def pair_rows(tick: Packed, at: int) -> None:
    """Rows of `SelfCollisionLimit`, from slot ``at`` on; ``pairs`` (k, 10) are normal, nearest points and room."""
    q, pairs, pair_body, n_pairs, upper, V, A = (
        tick.q, tick.pairs, tick.pair_body, tick.n_pairs, tick.soft_upper, tick.V, tick.A
    )  # fmt: skip
    point, brake, dt = tick.scratch[:3], tick.collision_brake, tick.collision_dt
    for i in range(n_pairs):
        row, normal = tick.soft_J[at + i], pairs[i, 0:3]
        clear(row)
        rate, drift = 0.0, 0.0
        for side in range(2):
            sign, body = 1.0 - 2.0 * side, pair_body[i, side]
            for k in range(3):
                point[k] = pairs[i, 3 + 3 * side + k] - q[k]
            point_columns(tick.S, tick.parent, body, point, normal, sign, row)
            rate -= sign * point_speed(V[body], point, normal)
            drift -= sign * point_drift(V[body], A[body], point, normal)
        leave_out(tick.driven, row)
        upper[at + i] = braking_bound(pairs[i, 9], -rate, brake, dt) + drift
    for i in range(at + n_pairs, upper.shape[0]):
        upper[i] = NO_BOUND


def clear(row: Vector) -> None:
    """Zeros."""
    for c in range(row.shape[0]):
        row[c] = 0.0


def leave_out(columns: Indices, row: Vector) -> None:
    """Zeros at some columns: velocities whose acceleration is not the program's to choose."""
    for c in range(columns.shape[0]):
        row[columns[c]] = 0.0
