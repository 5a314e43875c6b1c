r"""Arithmetic of the robot's rigid-body dynamics: one pass out to the fingers, one pass back, on flat arrays.

Everything is plain Python on float64 arrays and compiles with numba as it stands (`wholebody.reference.compiled`).

All spatial vectors are written in world axes about one point, the origin of the base ("about the base" below):
twists and accelerations ``[linear; angular]``, forces ``[force; moment]``. With one common point nothing has to be
transformed between bodies: inertias and forces are simply added up on the way back (Featherstone 2008, "Rigid Body
Dynamics Algorithms", chapters 5 and 6, in ground coordinates). Taking that point at the base keeps full precision
wherever the robot stands.

Legend: body 0 is the base, body i > 0 hangs on joint i, whose column in ``v`` is ``5 + i``; parents come before their
children. ``S`` are the joint axes as spatial twists, ``F[j]`` is the force on the whole tree for a unit acceleration
of column j, ``drift`` is what accelerations are when ``dv = 0``.
"""

import math

# Columns of the body table, one row a body.
PLACEMENT_R, PLACEMENT_P, AXIS, MASS, LEVER, INERTIA = 0, 9, 12, 15, 16, 19
"""Joint placement in the parent, joint axis, mass, centre of mass and inertia (xx xy xz yy yz zz) about it."""
BODY = 25

# Sums of the whole robot.
COM, COM_V, COM_DRIFT, MOMENTUM, MOMENTUM_DRIFT, ROOT_FORCE, TOTAL_MASS = 0, 3, 6, 9, 12, 15, 21
"""Centre of mass (world) with its velocity and drift; angular momentum about it with its drift; force on the whole
robot about the base for ``dv = 0``, gravity included; mass."""
SUMS = 22


def rotate(R, a, x, y, z):
    """Component ``a`` of ``R [x y z]``."""
    return R[a, 0] * x + R[a, 1] * y + R[a, 2] * z


def base_rotation(q, R):
    """Rotation matrix of the base quaternion ``q[3:7]`` (xyzw), which is normalised on the way."""
    size = math.sqrt(q[3] * q[3] + q[4] * q[4] + q[5] * q[5] + q[6] * q[6])
    x, y, z, w = q[3] / size, q[4] / size, q[5] / size, q[6] / size
    R[0, 0], R[0, 1], R[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


def joint_rotation(R_parent, row, angle, R):
    """``R = R_parent R_placement exp(axis angle)``."""
    c, s = math.cos(angle), math.sin(angle)
    x, y, z = row[AXIS], row[AXIS + 1], row[AXIS + 2]
    t = 1.0 - c
    e00, e01, e02 = t * x * x + c, t * x * y - s * z, t * x * z + s * y
    e10, e11, e12 = t * x * y + s * z, t * y * y + c, t * y * z - s * x
    e20, e21, e22 = t * x * z - s * y, t * y * z + s * x, t * z * z + c
    for a in range(3):
        m0 = R_parent[a, 0] * row[0] + R_parent[a, 1] * row[3] + R_parent[a, 2] * row[6]
        m1 = R_parent[a, 0] * row[1] + R_parent[a, 1] * row[4] + R_parent[a, 2] * row[7]
        m2 = R_parent[a, 0] * row[2] + R_parent[a, 1] * row[5] + R_parent[a, 2] * row[8]
        R[a, 0] = m0 * e00 + m1 * e10 + m2 * e20
        R[a, 1] = m0 * e01 + m1 * e11 + m2 * e21
        R[a, 2] = m0 * e02 + m1 * e12 + m2 * e22


def base_motion(v, R, S, V, A):
    """Columns, twist and drift of the base, whose velocity is given in its own axes."""
    for a in range(3):
        for k in range(3):
            S[k, a], S[k, 3 + a] = R[a, k], 0.0
            S[3 + k, a], S[3 + k, 3 + a] = 0.0, R[a, k]
        V[a] = rotate(R, a, v[0], v[1], v[2])
        V[3 + a] = rotate(R, a, v[3], v[4], v[5])
        A[a] = A[3 + a] = 0.0


def joint_motion(row, R, p, rate, s, V_parent, A_parent, V, A):
    """Axis of one joint as a twist about the base, and twist and drift of its body."""
    for k in range(3):
        s[3 + k] = rotate(R, k, row[AXIS], row[AXIS + 1], row[AXIS + 2])
    wx, wy, wz = s[3], s[4], s[5]
    s[0], s[1], s[2] = p[1] * wz - p[2] * wy, p[2] * wx - p[0] * wz, p[0] * wy - p[1] * wx
    x, y, z, a, b, c = V_parent[0], V_parent[1], V_parent[2], V_parent[3], V_parent[4], V_parent[5]
    # drift = drift_parent + twist_parent x (axis * rate); x is the spatial cross product.
    A[0] = A_parent[0] + rate * (b * s[2] - c * s[1] + y * s[5] - z * s[4])
    A[1] = A_parent[1] + rate * (c * s[0] - a * s[2] + z * s[3] - x * s[5])
    A[2] = A_parent[2] + rate * (a * s[1] - b * s[0] + x * s[4] - y * s[3])
    A[3] = A_parent[3] + rate * (b * s[5] - c * s[4])
    A[4] = A_parent[4] + rate * (c * s[3] - a * s[5])
    A[5] = A_parent[5] + rate * (a * s[4] - b * s[3])
    for k in range(6):
        V[k] = V_parent[k] + rate * s[k]


def body_inertia(row, R, p, inertia):
    """Spatial inertia about the base: mass, mass * centre (3), moments xx xy xz yy yz zz."""
    m = row[MASS]
    x = p[0] + rotate(R, 0, row[LEVER], row[LEVER + 1], row[LEVER + 2])
    y = p[1] + rotate(R, 1, row[LEVER], row[LEVER + 1], row[LEVER + 2])
    z = p[2] + rotate(R, 2, row[LEVER], row[LEVER + 1], row[LEVER + 2])
    xx, xy, xz, yy, yz, zz = row[19], row[20], row[21], row[22], row[23], row[24]
    inertia[0], inertia[1], inertia[2], inertia[3] = m, m * x, m * y, m * z
    at = 4
    for a in range(3):
        t0 = R[a, 0] * xx + R[a, 1] * xy + R[a, 2] * xz
        t1 = R[a, 0] * xy + R[a, 1] * yy + R[a, 2] * yz
        t2 = R[a, 0] * xz + R[a, 1] * yz + R[a, 2] * zz
        for b in range(a, 3):
            inertia[at] = t0 * R[b, 0] + t1 * R[b, 1] + t2 * R[b, 2]
            at += 1
    inertia[4] += m * (y * y + z * z)
    inertia[5] -= m * x * y
    inertia[6] -= m * x * z
    inertia[7] += m * (x * x + z * z)
    inertia[8] -= m * y * z
    inertia[9] += m * (x * x + y * y)


def momentum_of(n, t, out):
    """``out = inertia n times twist t``."""
    out[0] = n[0] * t[0] + t[4] * n[3] - t[5] * n[2]
    out[1] = n[0] * t[1] + t[5] * n[1] - t[3] * n[3]
    out[2] = n[0] * t[2] + t[3] * n[2] - t[4] * n[1]
    out[3] = n[2] * t[2] - n[3] * t[1] + n[4] * t[3] + n[5] * t[4] + n[6] * t[5]
    out[4] = n[3] * t[0] - n[1] * t[2] + n[5] * t[3] + n[7] * t[4] + n[8] * t[5]
    out[5] = n[1] * t[1] - n[2] * t[0] + n[6] * t[3] + n[8] * t[4] + n[9] * t[5]


def body_force(n, V, A, gravity, h, force, lifted):
    """Momentum ``h`` and force of one body for ``dv = 0``: inertia (drift - gravity) + twist x* momentum."""
    momentum_of(n, V, h)
    for k in range(3):
        lifted[k] = A[k] - gravity[k]
        lifted[3 + k] = A[3 + k]
    momentum_of(n, lifted, force)
    x, y, z, a, b, c = V[0], V[1], V[2], V[3], V[4], V[5]
    force[0] += b * h[2] - c * h[1]
    force[1] += c * h[0] - a * h[2]
    force[2] += a * h[1] - b * h[0]
    force[3] += y * h[2] - z * h[1] + b * h[5] - c * h[4]
    force[4] += z * h[0] - x * h[2] + c * h[3] - a * h[5]
    force[5] += x * h[1] - y * h[0] + a * h[4] - b * h[3]


def dot6(a, b):
    """Scalar product of a twist and a force."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


def mass_matrix(parent, S, inertia, armature, M, F):
    """Full symmetric mass matrix from the inertias of the subtrees; entries of unrelated joints are left at zero."""
    n = parent.shape[0]
    for i in range(n - 1, 0, -1):
        column = 5 + i
        momentum_of(inertia[i], S[column], F[column])
        M[column, column] = dot6(S[column], F[column]) + armature[column]
        k = parent[i]
        while k > 0:
            M[5 + k, column] = M[column, 5 + k] = dot6(S[5 + k], F[column])
            k = parent[k]
        for k in range(6):
            M[k, column] = M[column, k] = dot6(S[k], F[column])
    for column in range(6):
        momentum_of(inertia[0], S[column], F[column])
    for column in range(6):
        for k in range(column + 1):
            M[k, column] = M[column, k] = dot6(S[k], F[column])


def whole_robot(q, n, h, force, gravity, sums):
    """Centre of mass, momentum about it and the rates of both for ``dv = 0``; n, h, force are those of the tree."""
    m = n[0]
    x, y, z = n[1] / m, n[2] / m, n[3] / m
    for k in range(3):
        sums[COM + k] = q[k] + n[1 + k] / m
        sums[COM_V + k] = h[k] / m
        sums[COM_DRIFT + k] = force[k] / m + gravity[k]
    for at, f in ((MOMENTUM, h), (MOMENTUM_DRIFT, force)):
        sums[at] = f[3] - (y * f[2] - z * f[1])
        sums[at + 1] = f[4] - (z * f[0] - x * f[2])
        sums[at + 2] = f[5] - (x * f[1] - y * f[0])
    for k in range(6):
        sums[ROOT_FORCE + k] = force[k]
    sums[TOTAL_MASS] = m


def dynamics(q, v, table, parent, armature, gravity, R, p, S, V, A, inertia, h, force, M, F, nle, sums):
    """Kinematics and dynamics of the robot; see the module's legend.

    Args:
        q: Configuration (7 + n,).
        v: Velocity (6 + n,), base part in base axes.
        table: Bodies (1 + n, BODY).
        parent: Parent bodies (1 + n,).
        armature: Rotor inertias (6 + n,).
        gravity: Linear acceleration of gravity (3,).
        R: Out, rotations of the bodies (1 + n, 3, 3).
        p: Out, joint origins from the base, world axes (1 + n, 3).
        S: Out, columns (6 + n, 6).
        V: Out, twists (1 + n, 6).
        A: Out, drifts (1 + n, 6).
        inertia: Out, inertias of the subtrees (1 + n, 10).
        h: Out, momenta of the subtrees (1 + n, 6).
        force: Out, forces on the subtrees (1 + n, 6).
        M: In and out, mass matrix (6 + n, 6 + n), zero where joints are unrelated.
        F: Out, forces for unit accelerations (6 + n, 6).
        nle: Out, Coriolis, centrifugal and gravity forces (6 + n,).
        sums: Out, (SUMS,).
    """
    n = parent.shape[0]
    lifted = F[0]
    base_rotation(q, R[0])
    base_motion(v, R[0], S, V[0], A[0])
    for i in range(n):
        row = table[i]
        if i > 0:
            k = parent[i]
            joint_rotation(R[k], row, q[6 + i], R[i])
            for a in range(3):
                p[i, a] = p[k, a] + rotate(R[k], a, row[PLACEMENT_P], row[PLACEMENT_P + 1], row[PLACEMENT_P + 2])
            joint_motion(row, R[i], p[i], v[5 + i], S[5 + i], V[k], A[k], V[i], A[i])
        body_inertia(row, R[i], p[i], inertia[i])
        body_force(inertia[i], V[i], A[i], gravity, h[i], force[i], lifted)
    for i in range(n - 1, 0, -1):
        k = parent[i]
        nle[5 + i] = dot6(S[5 + i], force[i])
        for a in range(10):
            inertia[k, a] += inertia[i, a]
        for a in range(6):
            force[k, a] += force[i, a]
            h[k, a] += h[i, a]
    for k in range(6):
        nle[k] = dot6(S[k], force[0])
    mass_matrix(parent, S, inertia, armature, M, F)
    whole_robot(q, inertia[0], h[0], force[0], gravity, sums)
