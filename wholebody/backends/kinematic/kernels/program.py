r"""The arithmetic of the kinematic tick.

Methods are those of `wholebody.qp`: contacts eliminated as in `cost`, the search of `active_set`. Rows: speeds of the n
joints, then the edges of the support. The velocity ``v`` that is sought takes the place of ``dv`` there.
"""

from __future__ import annotations

from wholebody.backends.kinematic.kernels.placement import centre, frames, jacobians, place
from wholebody.jit.packed import Packed
from wholebody.qp.kernels import active_set
from wholebody.qp.kernels.active_set import NO_BOUND, NO_CONTACT, NOT_CONVEX, SOLVED, TOO_MANY_ITERATIONS
from wholebody.qp.kernels.contacts import allowed_motion
from wholebody.qp.kernels.cost import add_block, add_posture, expand, factor, has_weight, reduce_row
from wholebody.qp.kernels.linear_algebra import dot, solve_transposed
from wholebody.qp.kernels.residuals import accepted, contact_error, larger, violation
from wholebody.qp.kernels.solve import reduced_point
from wholebody.qp.kernels.targets import targets
from wholebody.robot.kernels.frames import PALM_FRAME
from wholebody.robot.kernels.rotation import rotation_between


def solve(tick: Packed) -> int:
    """The program at ``q``, solved and judged; a code of `active_set`, SOLVED only if the answer is accepted."""
    place(tick, tick.q)
    centre(tick)
    frames(tick)
    jacobians(tick)
    foot_targets(tick)
    if not allowed_motion(tick):
        return NO_CONTACT
    targets(tick)
    limits(tick)
    if not cost(tick):
        return NOT_CONVEX
    code = active_set.search(tick, point, transform)
    if code == SOLVED and not conclude(tick):
        code = TOO_MANY_ITERATIONS
    if code != SOLVED:
        tick.n_working = 0
    return code


def foot_targets(tick: Packed) -> None:
    """Velocities that bring the feet back to their places."""
    q, frame_p, p_ref, gain = tick.q, tick.frame_p, tick.foot_p_ref, tick.foot_gain
    for c in range(tick.n_contacts):
        out = tick.contact_target[6 * c : 6 * c + 6]
        rotation_between(tick.foot_R_ref[c], tick.frame_R[c], out[3:])
        for k in range(3):
            out[k], out[3 + k] = gain * (p_ref[c, k] - q[k] - frame_p[c, k]), gain * out[3 + k]


def limits(tick: Packed) -> None:
    """Bounds of all rows."""
    q, joints, lower, upper, sums, edges = tick.q, tick.joint_limits, tick.lower, tick.upper, tick.sums, tick.edges
    n, n_edges, margin, gain, dt = joints.shape[1], tick.n_edges, tick.balance_margin, tick.balance_gain, tick.dt
    for j in range(n):
        most = joints[2, j]
        lower[j] = min(max((joints[0, j] - q[7 + j]) / dt, -most), most)
        upper[j] = min(max((joints[1, j] - q[7 + j]) / dt, -most), most)
    for e in range(edges.shape[0]):
        lower[n + e], upper[n + e] = -NO_BOUND, NO_BOUND
        if e < n_edges:
            left = edges[e, 2] - margin - (edges[e, 0] * sums[0] + edges[e, 1] * sums[1])
            upper[n + e] = max(gain * left, -tick.retreat)


def cost(tick: Packed) -> bool:
    """Reduced Hessian and gradient, factor and free minimiser; False if it is not convex.

    A task's target is ``kd`` times the velocity that it wants.
    """
    H, g, target, posture, kd = tick.H, tick.g, tick.target, tick.posture_target, tick.posture_kd
    ny = g.shape[0]
    for a in range(ny):
        g[a] = 0.0
        for b in range(ny):
            H[a, b] = 0.0
    for f in range(PALM_FRAME, target.shape[0]):
        if has_weight(tick.weight[f]):
            add_block(tick, tick.J, 6 * f, 6, target[f], tick.weight[f], tick.task_kd[f])
    if has_weight(tick.body_weight):
        add_block(tick, tick.J_com, 0, 3, tick.body_target, tick.body_weight, tick.com_kd)
    for j in range(posture.shape[0]):
        posture[j] /= kd[j]
    add_posture(tick, tick.speed_penalty)
    return factor(H, tick.U, g, tick.y_free)


def point(tick: Packed) -> None:
    """Velocity at ``u``, and the values of all rows there."""
    v, value, edges, J = tick.dv, tick.value, tick.edges, tick.J_com
    n = v.shape[0] - 6
    reduced_point(tick)
    expand(tick)
    vx, vy = dot(J[0], v, n + 6), dot(J[1], v, n + 6)
    for j in range(n):
        value[j] = v[6 + j]
    for e in range(edges.shape[0]):
        value[n + e] = edges[e, 0] * vx + edges[e, 1] * vy


def describe(tick: Packed, row: int) -> None:
    """Write one row over ``v`` into ``a_dv``."""
    a, edges, J = tick.a_dv, tick.edges, tick.J_com
    n = a.shape[0] - 6
    for c in range(a.shape[0]):
        a[c] = 0.0 if row < n else edges[row - n, 0] * J[0, c] + edges[row - n, 1] * J[1, c]
    if row < n:
        a[6 + row] = 1.0


def transform(tick: Packed, row: int) -> None:
    """Write a row in the variables ``u`` of `active_set` into ``m``."""
    describe(tick, row)
    reduce_row(tick.a_dv, tick.bound_columns, tick.free_columns, tick.Z, tick.m)
    solve_transposed(tick.U, tick.m, tick.m.shape[0])


def conclude(tick: Packed) -> bool:
    """Multipliers by row and residuals; whether the answer is accepted.

    Primal: largest violation of a row or of the feet. Stationarity: gradient in the reduced variables, over one and the
    largest entry of the gradient. Complementarity: largest product of a multiplier and what is left to its bound, over
    the same. NaN anywhere makes them NaN.
    """
    rows, sides, lam, dual, lower, upper, value = (
        tick.rows, tick.sides, tick.lam, tick.dual, tick.lower, tick.upper, tick.value
    )  # fmt: skip
    out, product = tick.residuals, 0.0
    for i in range(dual.shape[0]):
        dual[i] = 0.0
    for k in range(tick.n_working):
        row, side = rows[k], sides[k]
        dual[row] = side * lam[k]
        product = larger(abs(lam[k] * (upper[row] - value[row] if side > 0.0 else value[row] - lower[row])), product)
    largest, scale = stationarity(tick)
    out[0], out[1], out[2] = larger(violation(tick), contact_error(tick)), largest / scale, product / scale
    return accepted(tick)


def stationarity(tick: Packed) -> tuple[float, float]:
    """Largest entry of the gradient of the Lagrangian in the reduced variables, and its scale."""
    H, g, y, left, m, dual, rows = tick.H, tick.g, tick.y, tick.reduced_gradient, tick.m, tick.dual, tick.rows
    ny, scale, largest = g.shape[0], 1.0, 0.0
    for a in range(ny):
        left[a], scale = g[a], larger(abs(g[a]), scale)
    for a in range(ny):
        left[a] += H[a, a] * y[a]
        for b in range(a + 1, ny):
            left[a] += H[a, b] * y[b]
            left[b] += H[a, b] * y[a]
    for k in range(tick.n_working):
        describe(tick, rows[k])
        reduce_row(tick.a_dv, tick.bound_columns, tick.free_columns, tick.Z, m)
        for a in range(ny):
            left[a] += dual[rows[k]] * m[a]
    for a in range(ny):
        largest = larger(abs(left[a]), largest)
    return largest, scale
