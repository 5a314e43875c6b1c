"""The plan's cost, and the quadratic model of it without the bounds.

The Hessian is block-banded: panel ``k + 1`` (N_BLOCK, N_PANEL) holds knot k's own block and those with the next two
knots, as in `banded`; the panels before the first knot and after the last take what falls outside and are never read.
Vectors (K + 2, N_FREE) are laid out likewise, zero at knots that do not exist and at the first knot, which stays.
"""

from __future__ import annotations

import math

import numpy as np

from wholebody.jit.arrays import Matrix, Vector
from wholebody.jit.vectors import outer_gram
from wholebody.trajopt.arrays import KnotTargets, TrajectoryWeights
from wholebody.trajopt.kernels.spline import knot_rate
from wholebody.trajopt.layout import (  # fmt: skip
    FREE_LOWER,
    HEIGHT,
    JOINTS,
    LOWER,
    N_BLOCK,
    N_BODY,
    N_FRAME,
    N_FREE,
    N_POSITION,
    PELVIS,
    SOLE,
    TAU,
    TORSO,
    UPPER,
    WAIST,
)
from wholebody.trajopt.workspace import AssemblyScratch, KnotMotion


def cost(m: KnotMotion, weights: TrajectoryWeights, penalties: Vector, moving: int) -> float:
    """Cost of a motion; ``penalties`` weigh its bounds, at the first knot only from ``moving`` on."""
    K, total = m.q.shape[0], 0.0
    for k in range(K):
        if k > 0:
            total += configuration_cost(m.r[k], weights)
        row = m.dynamics[k]
        total += weights.zmp * (row[0] * row[0] + row[1] * row[1])
        for i in range(WAIST):
            total += weights.waist * row[TAU + i] * row[TAU + i]
        for i in range(4):
            total += weights.slide * row[SOLE + i] * row[SOLE + i]
        for j in range(N_BODY):
            speed = weights.legs if 6 <= j < LOWER else weights.speed
            total += weights.smooth * m.a[k, j] * m.a[k, j] + speed * m.v_mid[k, j] * m.v_mid[k, j]
        for i in range(0 if k > 0 else moving, penalties.shape[0]):
            x = m.violation[k, i]
            if x > 0.0:
                total += penalties[i] * x * x
    return total


def configuration_cost(r: Vector, weights: TrajectoryWeights) -> float:
    """Cost of the squares r (N_POSITION,) that depend on one configuration."""
    total = 0.0
    for h in range(4):
        x, y, z = r[3 * h], r[3 * h + 1], r[3 * h + 2]
        sigma, unit = palm_scale(h, weights)
        far = math.sqrt(x * x + y * y + z * z) / unit
        size = math.log1p(far * far) if h % 2 == 0 else 2.0 * (far - math.log1p(far))
        total += (unit / sigma) ** 2 * size
    for i in range(12, N_POSITION):
        total += scale_of(i, weights) * r[i] * r[i]
    return total


def palm_scale(h: int, weights: TrajectoryWeights) -> tuple[float, float]:
    """Scale of a palm's position (h even) or orientation, and the residual from which its gradient grows no more."""
    if h % 2 == 0:
        return weights.position, weights.position_give
    return weights.orientation, weights.orientation_give


def scale_of(i: int, weights: TrajectoryWeights) -> float:
    """Weight of a row that depends on the configuration, palms aside."""
    if i < TORSO:
        return weights.com
    if i < PELVIS:
        return weights.torso
    if i < HEIGHT:
        return weights.pelvis
    return weights.height if i < JOINTS else weights.posture


def assemble(
    m: KnotMotion, task: KnotTargets, weights: TrajectoryWeights, H: np.ndarray, g: Matrix, work: AssemblyScratch
) -> None:
    """Hessian panels (K + 2, N_BLOCK, N_PANEL) and gradient (K + 2, N_FREE) of half the cost without the bounds.

    Palm positions have a Cauchy loss: the gradient is greatest at ``position_give`` and falls beyond, so that a target
    that jumps does not take the body along. Orientations have one whose gradient is bounded. Both enter the
    Gauss-Newton Hessian with the weight of the loss at the present residual (iteratively reweighted least squares).
    """
    H[:] = 0.0
    g[:] = 0.0
    for k in range(m.q.shape[0]):
        if k > 0:
            add_configuration(k, m, weights, H, g, work)
        add_dense(k, m, weights, H, g, work)
        add_lower(k, m, task.dt, weights, H, g, work)
        add_upper(k, m, task.dt, weights, H, g)


def add_configuration(
    k: int, m: KnotMotion, weights: TrajectoryWeights, H: np.ndarray, g: Matrix, work: AssemblyScratch
) -> None:
    """Rows that depend on one configuration."""
    B, v, r = work.frames, work.frame_values, m.r[k]
    for i in range(N_FRAME):
        if i < 12:
            h = i // 3
            x, y, z = r[3 * h], r[3 * h + 1], r[3 * h + 2]
            sigma, unit = palm_scale(h, weights)
            far = math.sqrt(x * x + y * y + z * z) / unit
            root = 1.0 / (sigma * math.sqrt(1.0 + (far * far if h % 2 == 0 else far)))
        else:
            root = math.sqrt(scale_of(i, weights))
        v[i] = root * r[i]
        for j in range(N_FREE):
            B[i, j] = root * m.J[k, i, j]
    panel, slope, w = H[k + 1], g[k + 1], weights.posture
    add_gram(B, 0, panel)
    for i in range(N_FRAME):
        for j in range(N_FREE):
            slope[j] += v[i] * B[i, j]
    free = m.free[k]
    for a in range(FREE_LOWER):
        for b in range(FREE_LOWER):
            d = 1.0 if a == b else 0.0
            for j in range(6):
                d -= free[a, j] * free[b, j]
            panel[a, b] += w * d
        for j in range(6, LOWER):
            slope[a] += w * free[a, j] * r[JOINTS + j - 6]
    for u in range(UPPER):
        panel[FREE_LOWER + u, FREE_LOWER + u] += w
        slope[FREE_LOWER + u] += w * r[JOINTS + LOWER - 6 + u]


def add_dense(
    k: int, m: KnotMotion, weights: TrajectoryWeights, H: np.ndarray, g: Matrix, work: AssemblyScratch
) -> None:
    """Rows (2 + WAIST, N_PANEL) that depend on everything: zero-moment point and waist torques."""
    B, slope = work.dense, g
    for i in range(2 + WAIST):
        row = i if i < 2 else TAU + i - 2
        root = math.sqrt(weights.zmp if i < 2 else weights.waist)
        value = root * m.dynamics[k, row]
        for c in range(3):
            for j in range(N_FREE):
                d = root * m.J_dynamics[k, row, c * N_FREE + j]
                B[i, c * N_BLOCK + j] = d
                slope[k + c, j] += value * d
    for c in range(3):
        add_gram(B, c * N_BLOCK, H[k + c])


def add_gram(B: Matrix, start: int, panel: Matrix) -> None:
    """Add the first rows of ``B' B``, with the columns of B from ``start`` on, to those of a panel."""
    rows, n = B.shape[0], B.shape[1] - start
    for i in range(N_FREE):
        out, r = panel[i], 0
        while r + 4 <= rows:
            r0, r1, r2, r3 = B[r, start:], B[r + 1, start:], B[r + 2, start:], B[r + 3, start:]
            c0, c1, c2, c3 = r0[i], r1[i], r2[i], r3[i]
            for j in range(n):
                out[j] += c0 * r0[j] + c1 * r1[j] + c2 * r2[j] + c3 * r3[j]
            r += 4
        while r < rows:
            r0 = B[r, start:]
            c0 = r0[i]
            for j in range(n):
                out[j] += c0 * r0[j]
            r += 1


def add_lower(
    k: int, m: KnotMotion, dt: float, weights: TrajectoryWeights, H: np.ndarray, g: Matrix, work: AssemblyScratch
) -> None:
    """Accelerations and speeds of base and legs, and the slide of the soles."""
    C, v, block, f, n = work.legs, work.leg_values, work.leg_square, FREE_LOWER, LOWER
    smooth, slide = math.sqrt(weights.smooth), math.sqrt(weights.slide)
    scale = 2.0 * smooth / dt if k == 0 else smooth / dt
    for r in range(f):
        for j in range(n):
            speed = math.sqrt(weights.speed if j < 6 else weights.legs)
            C[r, j] = scale * m.dv_dprev[k, r, j]
            C[f + r, j] = -scale * (m.dv_dnext[k, r, j] + m.dv_dprev[k + 1, r, j])
            C[2 * f + r, j] = scale * m.dv_dnext[k + 1, r, j]
            C[r, n + j] = -speed * m.dv_dprev[k, r, j]
            C[f + r, n + j] = speed * m.dv_dnext[k, r, j]
        for i in range(4):
            for c in range(3):
                C[c * f + r, 2 * n + i] = slide * m.J_dynamics[k, SOLE + i, c * N_FREE + r]
    for j in range(n):
        v[j] = smooth * m.a[k, j]
        v[n + j] = math.sqrt(weights.speed if j < 6 else weights.legs) * m.v_mid[k, j]
    for i in range(4):
        v[2 * n + i] = slide * m.dynamics[k, SOLE + i]
    outer_gram(C, block)
    for c in range(3):
        panel = H[k + c]
        for i in range(f):
            for b in range(c, 3):
                for j in range(f):
                    panel[i, (b - c) * N_BLOCK + j] += block[c * f + i, b * f + j]
            for j in range(2 * n + 4):
                g[k + c, i] += C[c * f + i, j] * v[j]


def add_upper(k: int, m: KnotMotion, dt: float, weights: TrajectoryWeights, H: np.ndarray, g: Matrix) -> None:
    """Accelerations and speeds of waist and arms."""
    f, n = FREE_LOWER, N_BLOCK
    here, there = knot_rate(k, m.q.shape[0], dt), knot_rate(k + 1, m.q.shape[0], dt)
    scale = 2.0 / dt if k == 0 else 1.0 / dt
    a, b, c = scale * here, -scale * (here + there), scale * there
    w, s = weights.smooth, weights.speed
    for u in range(f, N_FREE):
        H[k, u, u] += w * a * a + s * here * here
        H[k, u, n + u] += w * a * b - s * here * here
        H[k, u, 2 * n + u] += w * a * c
        H[k + 1, u, u] += w * b * b + s * here * here
        H[k + 1, u, n + u] += w * b * c
        H[k + 2, u, u] += w * c * c
        x, y = w * m.a[k, LOWER + u - f], s * m.v_mid[k, LOWER + u - f]
        g[k, u] += a * x - here * y
        g[k + 1, u] += b * x + here * y
        g[k + 2, u] += c * x
