r"""The arithmetic of the kinematic tick; compiles with numba as it stands.

Memory and methods are those of `wholebody.qp`: blocks of `blocks`, contacts eliminated as in `cost`, the dual
active-set method of `active_set`. Rows: speeds of the n joints, then the edges of the support.
"""

from wholebody.backends.kinematic.kernels.placement import (
    COM_KD,
    DT,
    FOOT_GAIN,
    HAND_KD,
    RETREAT,
    SPEED_PRICE,
    TRUNK_KD,
    centre,
    frames,
    place,
)
from wholebody.qp.kernels import blocks as mem
from wholebody.qp.kernels.active_set import append, exchange, point_of, remove, settle, worst
from wholebody.qp.kernels.assemble import factor, has_weight, targets
from wholebody.qp.kernels.cost import add_frame, add_posture, expand, reduce_row
from wholebody.qp.kernels.linear_algebra import dot, null_space, particular, solve_transposed, solve_upper
from wholebody.qp.kernels.solve import holds
from wholebody.robot.kernels.rotation import rotation_between

HANDS = 2
"""Frames of the hands come after those of the contacts; then pelvis and torso."""


def contacts(reals, ints):
    """Velocities that the feet allow, and one that brings them back; False if the feet depend on each other."""
    n, q, bound = mem.vector(ints, mem.COUNTS)[mem.N_CONTACTS], mem.vector(reals, mem.Q_), mem.vector(ints, mem.BOUND)
    FJ, FP, FR = mem.matrix(reals, mem.FJ_), mem.matrix(reals, mem.FP_), mem.cube(reals, mem.FR_)
    B, beta, goal = mem.matrix(reals, mem.B_), mem.matrix(reals, mem.BETA), mem.vector(reals, mem.CONTACT_TARGET)
    ref, gain = mem.matrix(reals, mem.FOOT_REF), mem.vector(reals, mem.STEP)[FOOT_GAIN]
    for c in range(n):
        part = goal[6 * c : 6 * c + 6]
        rotation_between(ref[c, :9].reshape((3, 3)), FR[c], part[3:])
        for k in range(3):
            part[k], part[3 + k] = gain * (ref[c, 9 + k] - q[k] - FP[c, k]), gain * part[3 + k]
        for r in range(6 * c, 6 * c + 6):
            for i in range(bound.shape[0]):
                B[r, i] = FJ[r, bound[i]]
    if not null_space(B, 6 * n, bound.shape[0], beta, mem.matrix(reals, mem.Z_)):
        return False
    particular(B, beta, 6 * n, bound.shape[0], goal, mem.vector(reals, mem.DV_P))
    return True


def limit(reals, ints):
    """Bounds of all rows."""
    q, joints, step = mem.vector(reals, mem.Q_), mem.matrix(reals, mem.JOINTS), mem.vector(reals, mem.STEP)
    lower, upper, sums = mem.vector(reals, mem.LOWER), mem.vector(reals, mem.UPPER), mem.vector(reals, mem.SUMS_)
    n, edges, balance = joints.shape[1], mem.matrix(reals, mem.EDGES), mem.vector(reals, mem.BALANCE)
    for j in range(n):
        most = joints[2, j]
        lower[j] = min(max((joints[0, j] - q[7 + j]) / step[DT], -most), most)
        upper[j] = min(max((joints[1, j] - q[7 + j]) / step[DT], -most), most)
    for e in range(edges.shape[0]):
        lower[n + e], upper[n + e] = -1e300, 1e300
        if e < mem.vector(ints, mem.COUNTS)[mem.N_EDGES]:
            left = edges[e, 2] - balance[0] - (edges[e, 0] * sums[0] + edges[e, 1] * sums[1])
            upper[n + e] = max(balance[1] * left, -step[RETREAT])


def cost(reals, ints):
    """Reduced Hessian and gradient, factor and free minimiser; False if it is not convex."""
    bound, free, Z = mem.vector(ints, mem.BOUND), mem.vector(ints, mem.FREE), mem.matrix(reals, mem.Z_)
    v_p, H, g, step = (
        mem.vector(reals, mem.DV_P), mem.matrix(reals, mem.H_), mem.vector(reals, mem.G_), mem.vector(reals, mem.STEP)
    )  # fmt: skip
    target, weight = mem.matrix(reals, mem.TARGET), mem.matrix(reals, mem.WEIGHT)
    n, ny, J = mem.vector(ints, mem.COUNTS)[mem.N_CONTACTS], g.shape[0], mem.matrix(reals, mem.FJ_)
    for a in range(ny):
        g[a] = 0.0
        for b in range(ny):
            H[a, b] = 0.0
    for f in range(n, target.shape[0]):
        add(J, 6 * f, 6, target[f], weight[f], step[HAND_KD if f < n + HANDS else TRUNK_KD], reals, ints)
    body, posture = mem.vector(reals, mem.BODY_TARGET), mem.vector(reals, mem.POSTURE_TARGET)
    add(mem.matrix(reals, mem.JS_), 0, 3, body, mem.vector(reals, mem.BODY_WEIGHT), step[COM_KD], reals, ints)
    gain = mem.matrix(reals, mem.POSTURE_GAIN)
    for j in range(posture.shape[0]):
        posture[j] /= gain[1, j]
    add_posture(gain[2], posture, step[SPEED_PRICE], bound, free, Z, v_p, H, g)
    return factor(H, mem.matrix(reals, mem.U_), g, mem.vector(reals, mem.Y0))


def add(J, row, n, target, weight, kd, reals, ints):
    """Add a task of up to six rows of J, from ``row`` on; its target is ``kd`` times the velocity wanted."""
    if not has_weight(weight):
        return
    bound, free, Z = mem.vector(ints, mem.BOUND), mem.vector(ints, mem.FREE), mem.matrix(reals, mem.Z_)
    v_p, rows, left = mem.vector(reals, mem.DV_P), mem.matrix(reals, mem.FRAME_ROWS), mem.vector(reals, mem.SCRATCH)
    g = mem.vector(reals, mem.G_)
    for r in range(6):
        left[r] = 0.0
        if r >= n:
            for a in range(g.shape[0]):
                rows[r, a] = 0.0
            continue
        reduce_row(J[row + r], bound, free, Z, rows[r])
        left[r] = target[r] / kd
        for i in range(bound.shape[0]):
            left[r] -= J[row + r, bound[i]] * v_p[i]
    add_frame(rows, weight, left, mem.matrix(reals, mem.KF_), g.shape[0], mem.matrix(reals, mem.H_), g)


def full_row(row, reals):
    """One row over ``v`` into A_V."""
    a, edges, J = mem.vector(reals, mem.A_V), mem.matrix(reals, mem.EDGES), mem.matrix(reals, mem.JS_)
    n = a.shape[0] - 6
    for c in range(a.shape[0]):
        a[c] = 0.0 if row < n else edges[row - n, 0] * J[0, c] + edges[row - n, 1] * J[1, c]
    if row < n:
        a[6 + row] = 1.0


def point(reals, ints):
    """Velocity at ``u``, and the values of all rows there."""
    u, y, y0, v = (
        mem.vector(reals, mem.U_VEC), mem.vector(reals, mem.X_Y), mem.vector(reals, mem.Y0), mem.vector(reals, mem.DV)
    )  # fmt: skip
    value, edges, J = mem.vector(reals, mem.VALUE), mem.matrix(reals, mem.EDGES), mem.matrix(reals, mem.JS_)
    bound, free, Z = mem.vector(ints, mem.BOUND), mem.vector(ints, mem.FREE), mem.matrix(reals, mem.Z_)
    ny, n = y.shape[0], v.shape[0] - 6
    for i in range(ny):
        y[i] = u[i]
    solve_upper(mem.matrix(reals, mem.U_), y, ny)
    for i in range(ny):
        y[i] += y0[i]
    expand(y, mem.vector(reals, mem.DV_P), bound, free, Z, v)
    x, y_ = dot(J[0], v, v.shape[0]), dot(J[1], v, v.shape[0])
    for j in range(n):
        value[j] = v[6 + j]
    for e in range(edges.shape[0]):
        value[n + e] = edges[e, 0] * x + edges[e, 1] * y_


def enter(row, side, count, multiplier, reals, ints):
    """Try to add a row to the working set; False if it depends on it."""
    m, u, value = mem.vector(reals, mem.ROW_M), mem.vector(reals, mem.U_VEC), mem.vector(reals, mem.VALUE)
    bound, free, Z = mem.vector(ints, mem.BOUND), mem.vector(ints, mem.FREE), mem.matrix(reals, mem.Z_)
    nu = m.shape[0]
    full_row(row, reals)
    reduce_row(mem.vector(reals, mem.A_V), bound, free, Z, m)
    solve_transposed(mem.matrix(reals, mem.U_), m, nu)
    limit_ = mem.vector(reals, mem.UPPER)[row] if side > 0.0 else -mem.vector(reals, mem.LOWER)[row]
    now = side * (value[row] - dot(m, u, nu))
    for k in range(nu):
        m[k] *= side
    Q, R = mem.matrix(reals, mem.QR_Q), mem.matrix(reals, mem.QR_R)
    scratch = mem.vector(reals, mem.COEFFICIENTS)
    if not append(m, limit_ - now, count, nu, Q, R, mem.vector(reals, mem.RHS), scratch):
        return False
    mem.vector(ints, mem.ROWS)[count] = row
    mem.vector(reals, mem.SIDES)[count] = side
    mem.vector(reals, mem.LAM)[count] = multiplier
    return True


def start(reals, ints):
    """The working set of the last tick, at the free minimiser; returns its size."""
    counts, rows, sides = mem.vector(ints, mem.COUNTS), mem.vector(ints, mem.ROWS), mem.vector(reals, mem.SIDES)
    u, count = mem.vector(reals, mem.U_VEC), 0
    for k in range(u.shape[0]):
        u[k] = 0.0
    point(reals, ints)
    for k in range(counts[mem.N_WORKING]):
        if enter(rows[k], sides[k], count, 0.0, reals, ints):
            count += 1
    return count


def search(reals, ints):
    """Iterate to the solution; a code of `blocks`. Leaves the velocity, the values of the rows and multipliers."""
    counts, rows, sides = mem.vector(ints, mem.COUNTS), mem.vector(ints, mem.ROWS), mem.vector(reals, mem.SIDES)
    lam, y, wanted = mem.vector(reals, mem.LAM), mem.vector(reals, mem.Y_), mem.vector(reals, mem.WANTED)
    Q, R, rhs = mem.matrix(reals, mem.QR_Q), mem.matrix(reals, mem.QR_R), mem.vector(reals, mem.RHS)
    u, value = mem.vector(reals, mem.U_VEC), mem.vector(reals, mem.VALUE)
    lower, upper, size = mem.vector(reals, mem.LOWER), mem.vector(reals, mem.UPPER), mem.vector(reals, mem.SIZE)
    coefficients, nu = mem.vector(reals, mem.COEFFICIENTS), u.shape[0]
    tolerance, count = mem.vector(reals, mem.OPTIONS)[mem.TOLERANCE], start(reals, ints)
    for iteration in range(counts[mem.ITERATION_LIMIT]):
        counts[mem.ITERATIONS] = iteration + 1
        if count > 0:
            count = settle(count, nu, Q, R, rhs, lam, rows, sides, y, wanted)
            point_of(count, nu, Q, y, u)
            point(reals, ints)
        counts[mem.N_WORKING] = count
        row = worst(value, lower, upper, size, upper.shape[0], tolerance)
        if row < 0 or holds(row, rows, count):
            return mem.SOLVED
        side, multiplier = 1.0 if value[row] > upper[row] else -1.0, 0.0
        while not enter(row, side, count, multiplier, reals, ints):
            for k in range(count):
                coefficients[k] = R[k, count]
            leaving, way = exchange(count, R, lam, coefficients)
            if leaving < 0:
                return mem.INFEASIBLE
            multiplier += way
            remove(leaving, count, nu, Q, R, rhs, lam, rows, sides)
            count -= 1
        count += 1
    return mem.TOO_MANY_ITERATIONS


def conclude(reals, ints):
    """Multipliers by row and residuals; whether the answer is accepted.

    Primal: largest violation of a row or of the feet. Stationarity: gradient in the reduced variables, over one and the
    largest entry of the gradient. Complementarity: largest product of a multiplier and what is left to its bound.
    """
    counts, rows, sides = mem.vector(ints, mem.COUNTS), mem.vector(ints, mem.ROWS), mem.vector(reals, mem.SIDES)
    lam, dual, H, g = (
        mem.vector(reals, mem.LAM), mem.vector(reals, mem.DUAL), mem.matrix(reals, mem.H_), mem.vector(reals, mem.G_)
    )  # fmt: skip
    y, left, m = mem.vector(reals, mem.X_Y), mem.vector(reals, mem.REDUCED_G), mem.vector(reals, mem.ROW_M)
    lower, upper, value = mem.vector(reals, mem.LOWER), mem.vector(reals, mem.UPPER), mem.vector(reals, mem.VALUE)
    bound, free, Z = mem.vector(ints, mem.BOUND), mem.vector(ints, mem.FREE), mem.matrix(reals, mem.Z_)
    residuals, ny, scale, primal, slack = mem.vector(reals, mem.RESIDUALS), g.shape[0], 1.0, 0.0, 0.0
    for i in range(dual.shape[0]):
        dual[i] = 0.0
        primal = max(primal, value[i] - upper[i], lower[i] - value[i])
    for a in range(ny):
        left[a], scale = g[a], max(scale, abs(g[a]))
    for a in range(ny):
        left[a] += H[a, a] * y[a]
        for b in range(a + 1, ny):
            left[a] += H[a, b] * y[b]
            left[b] += H[a, b] * y[a]
    for k in range(counts[mem.N_WORKING]):
        row, side = rows[k], sides[k]
        dual[row] = side * lam[k]
        full_row(row, reals)
        reduce_row(mem.vector(reals, mem.A_V), bound, free, Z, m)
        for a in range(ny):
            left[a] += dual[row] * m[a]
        slack = max(slack, abs(lam[k] * (upper[row] - value[row] if side > 0.0 else value[row] - lower[row])))
    largest = 0.0
    for a in range(ny):
        # Written so that what is not a number stays one.
        largest = largest if abs(left[a]) <= largest else abs(left[a])
    residuals[0], residuals[1], residuals[2] = max(primal, foot_error(reals, ints)), largest / scale, slack / scale
    options = mem.vector(reals, mem.OPTIONS)
    return (
        residuals[0] <= options[mem.PRIMAL_ACCEPTED]
        and residuals[1] <= options[mem.DUAL_ACCEPTED]
        and residuals[2] <= options[mem.DUAL_ACCEPTED]
    )


def foot_error(reals, ints):
    """Largest difference of a foot's velocity from the one it should have [m/s, rad/s]."""
    J, v, goal = mem.matrix(reals, mem.FJ_), mem.vector(reals, mem.DV), mem.vector(reals, mem.CONTACT_TARGET)
    largest = 0.0
    for r in range(6 * mem.vector(ints, mem.COUNTS)[mem.N_CONTACTS]):
        error = abs(dot(J[r], v, v.shape[0]) - goal[r])
        largest = largest if error <= largest else error
    return largest


def solve(reals, ints):
    """The program at Q_, solved and judged; a code of `blocks`, SOLVED only if the answer is accepted."""
    q = mem.vector(reals, mem.Q_)
    place(q, reals, ints)
    centre(q, reals)
    frames(reals, ints)
    if not contacts(reals, ints):
        return mem.NO_CONTACT
    targets(reals, ints)
    limit(reals, ints)
    if not cost(reals, ints):
        return mem.NOT_CONVEX
    code = search(reals, ints)
    if code != mem.SOLVED or not conclude(reals, ints):
        mem.vector(ints, mem.COUNTS)[mem.N_WORKING] = 0
        return code if code != mem.SOLVED else mem.TOO_MANY_ITERATIONS
    return mem.SOLVED
