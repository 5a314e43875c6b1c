"""Assembly of the plan's least-squares program, in functions that compile as they stand.

Every knot ``k`` of K has ``f`` free directions ``z_k``; ``N[k]`` (n, f) turns them into generalised velocities. The
half-step velocity ``h_k`` from knot k-1 to k changes by ``ahead[k] z_k - behind[k] z_{k-1}``. Position rows depend on
one knot, (K, m, f); motion rows on three, (K, m, 3 f). The velocity at the first knot is given. The Hessian is
banded, in LAPACK's lower layout, ``band[i - j, j]``.
"""

from __future__ import annotations

import numpy as np


def half_steps(N, left, right, dt, behind, ahead):
    """Fill ``behind`` and ``ahead`` (K + 1, n, f) from N (K, n, f) and the base blocks of the differences, (K, 6, 6).

    The last row stays zero: the plan rests after it.
    """
    K = len(N)
    behind[:] = 0.0
    ahead[:] = 0.0
    for k in range(1, K):
        behind[k] = N[k - 1] / dt
        ahead[k] = N[k] / dt
        behind[k, :6] = np.dot(left[k], behind[k, :6].copy())
        ahead[k, :6] = np.dot(right[k], ahead[k, :6].copy())


def motion_rows(Jq, Jv, Ja, N, behind, ahead, dt, out):
    """Rows ``Jq dq + Jv dv + Ja da``, (K, m, n) each, in the free directions of three knots: ``out`` (K, m, 3 f)."""
    K, f = len(N), N.shape[2]
    for k in range(K):
        before = 0.5 * Jv[k] - Ja[k] / dt
        after = 0.5 * Jv[k] + Ja[k] / dt
        if k == 0:
            after = 2.0 * Ja[k] / dt
        out[k, :, :f] = -np.dot(before, behind[k])
        out[k, :, f : 2 * f] = np.dot(Jq[k], N[k]) + np.dot(before, ahead[k]) - np.dot(after, behind[k + 1])
        out[k, :, 2 * f :] = np.dot(after, ahead[k + 1])


def rate_rows(behind, ahead, dt, acceleration, speed):
    """The accelerations (K, n, 3 f) and half-step speeds (K, n, 3 f) themselves, likewise."""
    K, f = len(acceleration), behind.shape[2]
    for k in range(K):
        acceleration[k, :, :f] = behind[k] / dt
        acceleration[k, :, f : 2 * f] = -(ahead[k] + behind[k + 1]) / dt
        acceleration[k, :, 2 * f :] = ahead[k + 1] / dt
        if k == 0:
            acceleration[k] *= 2.0
        speed[k, :, :f] = -behind[k]
        speed[k, :, f : 2 * f] = ahead[k]
        speed[k, :, 2 * f :] = 0.0


def add_position(J, r, w, band, g):
    """Add ``sum w (r + J z)^2 / 2`` of position rows (K, m, f) to Hessian and gradient; rows of weight 0 are left."""
    K, m, f = J.shape
    B, v = np.empty((m, f)), np.empty(m)
    for k in range(K):
        n = _scaled(J[k], r[k], w[k], B, v)
        if n:
            _add(B[:n], v[:n], k * f, 0, f, band, g)


def add_motion(J, r, w, band, g):
    """The same for motion rows (K, m, 3 f)."""
    K, m, f = len(J), J.shape[1], J.shape[2] // 3
    B, v = np.empty((m, 3 * f)), np.empty(m)
    for k in range(K):
        n = _scaled(J[k], r[k], w[k], B, v)
        first = f if k == 0 else 0
        last = 2 * f if k == K - 1 else 3 * f
        if n:
            _add(B[:n], v[:n], (k - 1) * f, first, last, band, g)


def _scaled(J, r, w, B, v):
    """Rows of positive weight times the root of it, one after the other; how many."""
    n = 0
    for i in range(len(w)):
        if w[i] > 0.0:
            s = np.sqrt(w[i])
            B[n] = s * J[i]
            v[n] = s * r[i]
            n += 1
    return n


def _add(B, v, offset, first, last, band, g):
    """Columns first to last of B; column c is variable offset + c."""
    H = np.dot(B.T, B)
    d = np.dot(B.T, v)
    for j in range(first, last):
        g[offset + j] += d[j]
        for i in range(j, last):
            band[i - j, offset + j] += H[i, j]


def along_position(J, z, out):
    """``J z`` of position rows (K, m, f), z (K, f); out (K, m)."""
    for k in range(len(J)):
        out[k] = np.dot(J[k], z[k])


def along_motion(J, z, out):
    """``J z`` of motion rows (K, m, 3 f); out (K, m)."""
    K, f = z.shape
    x = np.zeros(3 * f)
    for k in range(K):
        x[:] = 0.0
        if k > 0:
            x[:f] = z[k - 1]
        x[f : 2 * f] = z[k]
        if k < K - 1:
            x[2 * f :] = z[k + 1]
        out[k] = np.dot(J[k], x)


def cost(r, w, sign, along):
    """Cost of rows ``r + along``; rows with a sign count only where it makes them positive."""
    total = 0.0
    for i in range(len(r)):
        x = r[i] + along[i]
        if sign[i] == 0.0 or sign[i] * x > 0.0:
            total += w[i] * x * x
    return total


def line_search(r, w, sign, along, change, z, direction, extra):
    """Where in 0 to 1 the cost of ``r + along + t change`` and of damping ``extra`` on ``z + t direction`` is least."""
    high = 1.0
    low = 0.0
    t = 1.0
    for _ in range(10):
        slope = 0.0
        for i in range(len(z)):
            slope += extra[i] * direction[i] * (z[i] + t * direction[i])
        for i in range(len(r)):
            x = r[i] + along[i] + t * change[i]
            if sign[i] == 0.0 or sign[i] * x > 0.0:
                slope += w[i] * x * change[i]
        if slope <= 0.0:
            low = t
        else:
            high = t
        if low == 1.0:
            break
        t = 0.5 * (low + high)
    return max(low, 1e-3)
