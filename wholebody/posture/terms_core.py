"""Values and derivatives of the plan's terms at one knot, in functions that compile as they stand.

``J`` (6, n) is Pinocchio's joint Jacobian in world axes about the world origin, linear rows first. The rows of each
output are laid out in `knots`.
"""

from __future__ import annotations

import numpy as np


def place(T_joint, R_local, p_local, R, p):
    """World poses R (F, 3, 3), p (F, 3) of frames fixed to joints."""
    for i in range(len(R)):
        R_joint = T_joint[i, :3, :3].copy()
        R[i] = np.dot(R_joint, R_local[i])
        p[i] = T_joint[i, :3, 3] + np.dot(R_joint, p_local[i])


def log3(R):
    """Rotation vector of a rotation matrix."""
    w = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    s = 0.5 * np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    c = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    angle = np.arctan2(s, c)
    if s > 1e-7:
        return w * (0.5 * angle / s)
    if c > 0.0:
        return 0.5 * w
    # Half a turn: the axis is the largest column of R + 1.
    axis = np.zeros(3)
    best = 0
    for i in range(1, 3):
        if R[i, i] > R[best, best]:
            best = i
    for i in range(3):
        axis[i] = R[i, best]
    axis[best] += 1.0
    return axis * (angle / np.sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]))


def frame_jacobian(J, mask, p, out):
    """Jacobian (6, n) of a frame at p, world axes."""
    for j in range(J.shape[1]):
        if mask[j] > 0.0:
            a, b, c = J[3, j], J[4, j], J[5, j]
            out[0, j] = J[0, j] + b * p[2] - c * p[1]
            out[1, j] = J[1, j] + c * p[0] - a * p[2]
            out[2, j] = J[2, j] + a * p[1] - b * p[0]
            out[3, j] = a
            out[4, j] = b
            out[5, j] = c
        else:
            for i in range(6):
                out[i, j] = 0.0


def feet(J, masks, R, p, R_wanted, p_wanted, step, N):
    """How far the feet are off, [m, rad].

    Fills ``step`` (n,), the least that puts them back, and N (n, n - 12), orthonormal directions that leave them.
    """
    n = J.shape[1]
    A, error = np.zeros((12, n)), np.zeros(12)
    worst = 0.0
    for i in range(2):
        frame_jacobian(J, masks[i], p[i], A[6 * i : 6 * i + 6])
        error[6 * i : 6 * i + 3] = p_wanted[i] - p[i]
        error[6 * i + 3 : 6 * i + 6] = log3(np.dot(R_wanted[i], R[i].T))
    for i in range(12):
        worst = max(worst, abs(error[i]))
    W, V = A.T.copy(), np.zeros((12, n))
    triangular(W, V)
    # A' = Q W, so A step = error is W' (Q' step) = error.
    x = np.zeros((n, n - 11))
    for k in range(12):
        d = error[k]
        for i in range(k):
            d -= W[i, k] * x[i, 0]
        if abs(W[k, k]) > 1e-9:
            x[k, 0] = d / W[k, k]
    for j in range(n - 12):
        x[12 + j, 1 + j] = 1.0
    for k in range(11, -1, -1):
        reflect(V[k], k, x)
    step[:] = x[:, 0]
    N[:] = x[:, 1:]
    return worst


def triangular(W, V):
    """Householder reflections V (m, n) that make W (n, m) upper triangular, in place."""
    n, m = W.shape
    for k in range(m):
        norm = 0.0
        for i in range(k, n):
            V[k, i] = W[i, k]
            norm += W[i, k] * W[i, k]
        norm = np.sqrt(norm)
        V[k, k] += norm if W[k, k] > 0.0 else -norm
        length = np.sqrt(np.dot(V[k], V[k]))
        if length > 1e-12:
            V[k] /= length
        reflect(V[k], k, W)


def reflect(v, first, X):
    """``X - 2 v v' X``, in place; v is zero before ``first``."""
    for j in range(X.shape[1]):
        d = 0.0
        for i in range(first, len(v)):
            d += v[i] * X[i, j]
        for i in range(first, len(v)):
            X[i, j] -= 2.0 * d * v[i]


def position(J, masks, R, p, T, com, J_com, q, q_stance, com_stance, r, rows):
    """Quadratic rows: r (50,), rows (50, n). Frames: palms, torso, pelvis; T (2, 4, 4) are the palms wanted."""
    for i in range(2):
        frame_jacobian(J, masks[i], p[i], rows[6 * i : 6 * i + 6])
        for c in range(3):
            r[6 * i + c] = p[i, c] - T[i, c, 3]
        r[6 * i + 3 : 6 * i + 6] = log3(np.dot(R[i], T[i, :3, :3].T.copy()))
    for c in range(2):
        r[12 + c] = com[c] - com_stance[c]
        rows[12 + c] = J_com[c]
    F = np.zeros((6, J.shape[1]))
    for i in range(2):
        frame_jacobian(J, masks[2 + i], p[2 + i], F)
        rows[14 + 3 * i : 17 + 3 * i] = F[3:]
        r[14 + 3 * i : 17 + 3 * i] = log3(R[2 + i])
    rows[20] = F[2]
    r[20] = q[2] - q_stance[2]
    for i in range(29):
        r[21 + i] = q[7 + i] - q_stance[7 + i]
        rows[21 + i] = 0.0
        rows[21 + i, 6 + i] = 1.0


def sided(q, R, com, quadratic, limits, q_min, q_max, normals, offsets, first_edge, r, rows, sign):
    """One-sided rows but the distances: ``sign r > 0`` is a violation. limits: tilt of torso and pelvis, height."""
    for i in range(2):
        r[i] = -1.0
        rows[i] = 0.0
        x, y = R[2 + i, 0, 2], R[2 + i, 1, 2]
        lean = np.sqrt(x * x + y * y)
        if lean > 1e-6:
            r[i] = np.arctan2(lean, R[2 + i, 2, 2]) - limits[i]
            rows[i] = (x * quadratic[15 + 3 * i] - y * quadratic[14 + 3 * i]) / lean
    r[2] = limits[2] - q[2]
    rows[2] = -quadratic[20]
    for i in range(29):
        x = q[7 + i]
        high = x > 0.5 * (q_min[i] + q_max[i])
        sign[3 + i] = 1.0 if high else -1.0
        r[3 + i] = x - (q_max[i] if high else q_min[i])
        rows[3 + i] = 0.0
        rows[3 + i, 6 + i] = 1.0
    for e in range(len(offsets)):
        r[first_edge + e] = normals[e, 0] * com[0] + normals[e, 1] * com[1] - offsets[e]
        rows[first_edge + e] = normals[e, 0] * quadratic[12] + normals[e, 1] * quadratic[13]


def moment(R, p, tau, D, turning, weight, out):
    """Zero-moment point times load, and load, as shares of the weight (3,); ``out`` (3, n) is their derivative.

    ``tau`` is the generalised force, its first six the wrench on the base in base axes, D (n, n) its derivative;
    ``turning`` says that it is the one by the configuration: then the wrench turns and moves with the base.
    """
    f, local = np.dot(R, tau[:3]), np.dot(R, tau[3:6])
    n = local + np.array([p[1] * f[2] - p[2] * f[1], p[2] * f[0] - p[0] * f[2], p[0] * f[1] - p[1] * f[0]])
    F = np.dot(R, np.ascontiguousarray(D[:3]))
    M = np.dot(R, np.ascontiguousarray(D[3:6]))
    if turning:
        for j in range(3):
            a, b, c = R[0, j], R[1, j], R[2, j]
            F[0, 3 + j] += b * f[2] - c * f[1]
            F[1, 3 + j] += c * f[0] - a * f[2]
            F[2, 3 + j] += a * f[1] - b * f[0]
            M[0, 3 + j] += b * local[2] - c * local[1]
            M[1, 3 + j] += c * local[0] - a * local[2]
            M[2, 3 + j] += a * local[1] - b * local[0]
            M[0, j] += b * f[2] - c * f[1]
            M[1, j] += c * f[0] - a * f[2]
            M[2, j] += a * f[1] - b * f[0]
    for j in range(D.shape[1]):
        out[0, j] = -(M[1, j] + p[2] * F[0, j] - p[0] * F[2, j]) / weight
        out[1, j] = (M[0, j] + p[1] * F[2, j] - p[2] * F[1, j]) / weight
        out[2, j] = F[2, j] / weight
    return np.array([-n[1], n[0], f[2]]) / weight


def motion(R, p, tau, by_q, by_v, by_a, upper, tau_max, normals, room, load_min, weight, r, D, r_sided, D_sided, sign):
    """Rows that depend on the motion: r (5,), D (3, 5, n); one-sided r_sided (18 + edges,), D_sided (3, ..., n)."""
    n = len(tau)
    for i in range(n):
        for j in range(i):
            by_a[i, j] = by_a[j, i]
    m, m_by = np.zeros(3), np.zeros((3, n))
    for k in range(3):
        part = by_q if k == 0 else by_v if k == 1 else by_a
        m = moment(R, p, tau, part, k == 0, weight, m_by)
        D[k, :2] = m_by[:2]
        D_sided[k, 0] = -m_by[2]
        for e in range(len(room)):
            D_sided[k, 18 + e] = normals[e, 0] * m_by[0] + normals[e, 1] * m_by[1] - room[e] * m_by[2]
        for i in range(3):
            D[k, 2 + i] = part[upper[i]]
        for i in range(len(upper)):
            D_sided[k, 1 + i] = part[upper[i]] / tau_max[i]
    r[:2] = m[:2]
    r_sided[0] = load_min - m[2]
    for e in range(len(room)):
        r_sided[18 + e] = normals[e, 0] * m[0] + normals[e, 1] * m[1] - room[e] * m[2]
    for i in range(len(upper)):
        x = tau[upper[i]]
        if i < 3:
            r[2 + i] = x
        sign[1 + i] = 1.0 if x > 0.0 else -1.0
        r_sided[1 + i] = (x - sign[1 + i] * tau_max[i]) / tau_max[i]
    return m
