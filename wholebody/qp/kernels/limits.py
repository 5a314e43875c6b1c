"""Joint bounds and the rows of the safety limits, as in `wholebody.limits`; compiles with numba as it stands."""

import math

from wholebody.robot.kernels.frames import point_columns, point_drift, point_speed
from wholebody.robot.kernels.pendulum import natural_frequency
from wholebody.robot.kernels.rotation import rotation_between


def braking_acceleration(q, dq, q_max, dq_max, brake, dt):
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


def joint_bounds(q, v, joints, dt, low, high):
    """Acceleration bounds of every joint.

    Args:
        q: Configuration (7 + n,).
        v: Velocity (6 + n,).
        joints: Rows ``q_min q_max dq_max ddq_max brake`` (5, n).
        dt: Horizon [s].
        low: Out (n,).
        high: Out (n,).
    """
    for j in range(joints.shape[1]):
        x, dx, most = q[7 + j], v[6 + j], joints[3, j]
        upper = braking_acceleration(x, dx, joints[1, j], joints[2, j], joints[4, j], dt)
        lower = -braking_acceleration(-x, -dx, -joints[0, j], joints[2, j], joints[4, j], dt)
        upper, lower = min(max(upper, -most), most), min(max(lower, -most), most)
        if lower > upper:
            lower = upper = 0.5 * (lower + upper)
        low[j], high[j] = lower, upper


def barrier(margin, rate, brake, dt):
    """`wholebody.limits.base.barrier` for one row."""
    if margin < 0.0:
        allowed = margin / (4.0 * dt)
    elif margin > 2.0 * brake * dt * dt:
        allowed = math.sqrt(2.0 * brake * margin)
    else:
        allowed = margin / dt
    return (allowed - rate) / dt


def balance_rows(edges, n_edges, com, margin, gain, F, mass, JS, upper):
    """Rows of `CapturePointLimit` from slot 0 on.

    Args:
        edges: Normals and offsets of the support (k, 3).
        n_edges: Number of them in use.
        com: Centre of mass, its velocity and drift (9,).
        margin: [m].
        gain: [1/s].
        F: Force on the whole robot for unit accelerations (nv, 6).
        mass: [kg].
        JS: Out, rows (k, nv).
        upper: Out (k,).
    """
    omega = natural_frequency(com[2])
    for e in range(n_edges):
        nx, ny = edges[e, 0], edges[e, 1]
        speed = nx * com[3] + ny * com[4]
        left = edges[e, 2] - margin - (nx * com[0] + ny * com[1] + speed / omega)
        upper[e] = omega * (gain * left - speed) - (nx * com[6] + ny * com[7])
        for c in range(F.shape[0]):
            JS[e, c] = (nx * F[c, 0] + ny * F[c, 1]) / mass


def orientation_rows(plan, R, velocity, drift, J, row, limit, at, JS, upper, scratch):
    """Six rows of `OrientationLimit` from slot ``at`` on.

    Args:
        plan: Planned rotation (9), rate (3) and acceleration (3), (15,).
        R: Rotation of the body (3, 3).
        velocity: Of the body (6,).
        drift: Of the body (6,).
        J: Jacobians; that of the body begins at ``row``.
        row: See J.
        limit: ``angle_max rate_max brake dt`` (4,).
        at: First slot.
        JS: Out, rows.
        upper: Out.
        scratch: (3,).
    """
    rotation_between(plan[:9].reshape((3, 3)), R, scratch)
    dt = limit[3]
    for k in range(3):
        for side in range(2):
            sign = 1.0 - 2.0 * side
            # The error is plan minus body; the limit counts body minus plan.
            margin = limit[0] + sign * scratch[k]
            rate = velocity[3 + k]
            stop = barrier(margin, sign * (rate - plan[9 + k]), limit[2], dt) + sign * plan[12 + k]
            upper[at + 3 * side + k] = min(stop, (limit[1] - sign * rate) / dt) - sign * drift[3 + k]
            for c in range(J.shape[1]):
                JS[at + 3 * side + k, c] = sign * J[row + 3 + k, c]


def height_rows(plan, z, velocity, drift, J, row, limit, at, JS, upper):
    """Three rows of `HeightLimit` from slot ``at`` on: lowest, and above and below the plan.

    Args:
        plan: Planned height, rate and acceleration (3,).
        z: Height of the body in world [m].
        velocity: Of the body (6,).
        drift: Of the body (6,).
        J: Jacobians; that of the body begins at ``row``.
        row: See J.
        limit: ``band lowest brake dt`` (4,).
        at: First slot.
        JS: Out, rows.
        upper: Out.
    """
    rate, away = velocity[2], velocity[2] - plan[1]
    brake, dt = limit[2], limit[3]
    upper[at] = barrier(z - limit[1], -rate, brake, dt) + drift[2]
    upper[at + 1] = barrier(plan[0] + limit[0] - z, away, brake, dt) + plan[2] - drift[2]
    upper[at + 2] = barrier(z - plan[0] + limit[0], -away, brake, dt) + drift[2] - plan[2]
    for c in range(J.shape[1]):
        JS[at, c] = JS[at + 2, c] = -J[row + 2, c]
        JS[at + 1, c] = J[row + 2, c]


def collision_rows(q, pairs, pair_body, n_pairs, S, parent, V, A, driven, limit, at, JS, upper, scratch):
    """One row of `SelfCollisionLimit` a pair, from slot ``at`` on.

    Args:
        q: Configuration; its first three entries are the origin of the base.
        pairs: Normal, nearest points in world and room of each pair (k, 10).
        pair_body: The two bodies of each pair, flat (2 k,).
        n_pairs: Number of pairs.
        S: Columns (nv, 6).
        parent: Parent bodies.
        V: Twists of the bodies.
        A: Drifts of the bodies.
        driven: Columns left out (any,).
        limit: ``brake dt`` (2,).
        at: First slot.
        JS: Out, rows.
        upper: Out.
        scratch: (3,).
    """
    for i in range(n_pairs):
        row, normal = JS[at + i], pairs[i, 0:3]
        for c in range(row.shape[0]):
            row[c] = 0.0
        rate, drift = 0.0, 0.0
        for side in range(2):
            sign, body = 1.0 - 2.0 * side, pair_body[2 * i + side]
            for k in range(3):
                scratch[k] = pairs[i, 3 + 3 * side + k] - q[k]
            point_columns(S, parent, body, scratch, normal, sign, row)
            rate -= sign * point_speed(V[body], scratch, normal)
            drift -= sign * point_drift(V[body], A[body], scratch, normal)
        for c in range(driven.shape[0]):
            row[driven[c]] = 0.0
        upper[at + i] = barrier(pairs[i, 9], -rate, limit[0], limit[1]) + drift


def foot_target(ref, q, R, x, velocity, drift, kp, kd, out, scratch):
    """Wanted acceleration of a contact frame (6,), as `FootContact.acceleration`.

    Args:
        ref: Rotation (9) and position (3) where the foot was set down, (12,).
        q: Configuration.
        R: Rotation of the foot (3, 3).
        x: Its offset from the base (3,).
        velocity: Of the foot (6,).
        drift: Of the foot (6,).
        kp: [1/s^2].
        kd: [1/s].
        out: Out (6,).
        scratch: (3,).
    """
    rotation_between(ref[:9].reshape((3, 3)), R, scratch)
    for k in range(3):
        out[k] = -drift[k] - kd * velocity[k] + kp * (ref[9 + k] - q[k] - x[k])
        out[3 + k] = -drift[3 + k] - kd * velocity[3 + k] + kp * scratch[k]


def point_offsets(R, x, local, arms, P):
    """Contact points of one foot from the foot's origin and from the base, world axes, (k, 3) each."""
    for i in range(local.shape[0]):
        for a in range(3):
            arms[i, a] = R[a, 0] * local[i, 0] + R[a, 1] * local[i, 1] + R[a, 2] * local[i, 2]
            P[i, a] = x[a] + arms[i, a]
