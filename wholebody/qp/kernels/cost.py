r"""The cost of the whole-body program in reduced variables.

The equalities of `wholebody.qp.formulation` are eliminated:

* ``dv = dv_p + Z y``: ``Z`` spans the accelerations that the contacts allow. Columns of ``v`` that move a contact are
  *bound*; the others are *free* and are entries of ``y`` themselves, after the coordinates of ``Z``.
* ``f = G' W (F' dv + f_0) + e``: the shortest point forces with the wrench on the robot that ``dv`` needs (``F`` and
  ``f_0`` of `rigid_body`, ``G`` maps point forces to that wrench, ``W = (G G')^-1``), plus forces ``e`` that cancel.

Cost and constraints of ``y`` and ``e`` are then apart: ``1/2 y' H y + g' y`` and ``1/2 penalty |e|^2``.
"""

from __future__ import annotations

from wholebody.jit.arrays import Indices, Matrix, Vector
from wholebody.jit.packed import Packed
from wholebody.qp.kernels.linear_algebra import cholesky, solve_transposed, solve_upper


def cost(tick: Packed) -> bool:
    """Reduced Hessian ``H`` and gradient ``g``, factor ``U`` and free minimiser; False if the cost is not convex."""
    H, g, target = tick.H, tick.g, tick.target
    ny = g.shape[0]
    for a in range(ny):
        g[a] = 0.0
        for b in range(ny):
            H[a, b] = 0.0
    reduce_wrench(tick)
    wrench_cost(tick)
    add_wrench(tick)
    for f in range(target.shape[0]):
        if has_weight(tick.weight[f]):
            add_block(tick, tick.J, 6 * f, 6, target[f], tick.weight[f], 1.0)
    add_posture(tick, tick.penalty_acceleration)
    return factor(H, tick.U, g, tick.y_free)


def has_weight(weight: Vector) -> bool:
    """Whether one of six weights is not zero."""
    return weight[0] + weight[1] + weight[2] + weight[3] + weight[4] + weight[5] > 0.0


def reduce_row(row: Vector, bound: Indices, free: Indices, Z: Matrix, out: Vector) -> None:
    """``out = row Z_full``: a row (nv,) over ``v`` in the reduced variables."""
    nr = Z.shape[1]
    for r in range(nr):
        out[r] = 0.0
    for i in range(bound.shape[0]):
        c = row[bound[i]]
        if c != 0.0:
            for r in range(nr):
                out[r] += c * Z[i, r]
    for k in range(free.shape[0]):
        out[nr + k] = row[free[k]]


def expand(tick: Packed) -> None:
    """``dv = dv_p + Z y``; ``dv_p`` lists the bound columns only."""
    y, dv_p, bound, free, Z, dv = tick.y, tick.dv_p, tick.bound_columns, tick.free_columns, tick.Z, tick.dv
    nr = Z.shape[1]
    for i in range(bound.shape[0]):
        total = dv_p[i]
        for r in range(nr):
            total += Z[i, r] * y[r]
        dv[bound[i]] = total
    for k in range(free.shape[0]):
        dv[free[k]] = y[nr + k]


def reduce_wrench(tick: Packed) -> None:
    """``FZ = F' Z`` (6, ny) and ``w_p = F' dv_p`` (6,)."""
    F, bound, free, Z, dv_p, FZ, w_p = (
        tick.F, tick.bound_columns, tick.free_columns, tick.Z, tick.dv_p, tick.FZ, tick.w_p
    )  # fmt: skip
    nr = Z.shape[1]
    for a in range(6):
        w_p[a] = 0.0
        for r in range(nr):
            FZ[a, r] = 0.0
    for i in range(bound.shape[0]):
        c = bound[i]
        for a in range(6):
            w_p[a] += F[c, a] * dv_p[i]
            for r in range(nr):
                FZ[a, r] += F[c, a] * Z[i, r]
    for k in range(free.shape[0]):
        for a in range(6):
            FZ[a, nr + k] = F[free[k], a]


def add_products(left: Matrix, right: Matrix, ny: int, H: Matrix) -> None:
    """Add ``left' right`` of two blocks of rows (6, ny), symmetric, to the upper triangle of H."""
    r0, r1, r2, r3, r4, r5 = right[0], right[1], right[2], right[3], right[4], right[5]
    for a in range(ny):
        c0, c1, c2, c3, c4, c5 = left[0, a], left[1, a], left[2, a], left[3, a], left[4, a], left[5, a]
        if c0 == 0.0 and c1 == 0.0 and c2 == 0.0 and c3 == 0.0 and c4 == 0.0 and c5 == 0.0:
            continue
        row = H[a]
        # Whole rows: what lies below the diagonal is never read, and vectors need no ragged start.
        for b in range(ny):
            row[b] += c0 * r0[b] + c1 * r1[b] + c2 * r2[b] + c3 * r3[b] + c4 * r4[b] + c5 * r5[b]


def add_block(tick: Packed, J: Matrix, row: int, n: int, target: Vector, weight: Vector, kd: float) -> None:
    """Add ``1/2 sum_r weight_r (J_r x - target_r / kd)^2`` of ``n`` up to six rows of J, from ``row`` on."""
    bound, free, Z, dv_p, H, g = tick.bound_columns, tick.free_columns, tick.Z, tick.dv_p, tick.H, tick.g
    rows, weighted, ny = tick.block_rows, tick.block_weighted, g.shape[0]
    for r in range(6):
        reduced, scaled = rows[r], weighted[r]
        if r >= n:
            for j in range(ny):
                reduced[j] = scaled[j] = 0.0
            continue
        reduce_row(J[row + r], bound, free, Z, reduced)
        left = target[r] / kd
        for i in range(bound.shape[0]):
            left -= J[row + r, bound[i]] * dv_p[i]
        w, t = weight[r], weight[r] * left
        for j in range(ny):
            scaled[j] = w * reduced[j]
            g[j] -= t * reduced[j]
    add_products(rows, weighted, ny, H)


def wrench_cost(tick: Packed) -> None:
    """Cost ``1/2 w'Kw - k'w`` of the wrench ``w = F' dv`` on the robot: centre of mass, momentum, contact forces."""
    K, k, W, f_0, centre = tick.K, tick.k, tick.W, tick.f_0, tick.centre
    target, weight, mass, penalty = tick.body_target, tick.body_weight, tick.sums[21], tick.penalty_force
    lever = tick.scratch[:6]
    for a in range(6):
        k[a] = 0.0
        for b in range(6):
            K[a, b] = penalty * W[a, b]
            k[a] -= penalty * W[a, b] * f_0[b]
    for a in range(3):
        K[a, a] += weight[a] / (mass * mass)
        k[a] += weight[a] * target[a] / mass
        # Row a of the momentum task: moment about the base less centre x force.
        for b in range(6):
            lever[b] = 0.0
        b, c = (a + 1) % 3, (a + 2) % 3
        lever[b], lever[c], lever[3 + a] = centre[c], -centre[b], 1.0
        w = weight[3 + a]
        for b in range(6):
            for c in range(6):
                K[b, c] += w * lever[b] * lever[c]
            k[b] += w * lever[b] * target[3 + a]


def add_wrench(tick: Packed) -> None:
    """Add `wrench_cost` of ``w = w_p + FZ y``."""
    FZ, w_p, K, k, KF, g = tick.FZ, tick.w_p, tick.K, tick.k, tick.block_weighted, tick.g
    ny = g.shape[0]
    for a in range(6):
        for j in range(ny):
            KF[a, j] = 0.0
        for b in range(6):
            c = K[a, b]
            for j in range(ny):
                KF[a, j] += c * FZ[b, j]
        target = k[a]
        for b in range(6):
            target -= K[a, b] * w_p[b]
        for j in range(ny):
            g[j] -= target * FZ[a, j]
    add_products(FZ, KF, ny, tick.H)


def add_posture(tick: Packed, penalty: float) -> None:
    """Add the posture task and a penalty on all velocities or accelerations."""
    weight, target, bound, free, Z, dv_p, H, g = (
        tick.posture_weight, tick.posture_target, tick.bound_columns, tick.free_columns, tick.Z, tick.dv_p, tick.H,
        tick.g,
    )  # fmt: skip
    nr = Z.shape[1]
    for i in range(bound.shape[0]):
        w, t = penalty, 0.0
        if bound[i] >= 6:
            w += weight[bound[i] - 6]
            t = weight[bound[i] - 6] * target[bound[i] - 6]
        left = t - w * dv_p[i]
        for r in range(nr):
            g[r] -= left * Z[i, r]
            for s in range(r, nr):
                H[r, s] += w * Z[i, r] * Z[i, s]
    for k in range(free.shape[0]):
        j = free[k]
        H[nr + k, nr + k] += penalty
        if j >= 6:
            H[nr + k, nr + k] += weight[j - 6]
            g[nr + k] -= weight[j - 6] * target[j - 6]


def factor(H: Matrix, U: Matrix, g: Vector, y: Vector) -> bool:
    """Upper Cholesky factor ``U`` of H (n, n) and minimiser ``y = -H^-1 g``; False if H is not positive definite."""
    n = g.shape[0]
    for i in range(n):
        y[i] = -g[i]
        for j in range(i, n):
            U[i, j] = H[i, j]
    if not cholesky(U, n):
        return False
    solve_transposed(U, y, n)
    solve_upper(U, y, n)
    return True
