"""The program at one state, from dynamics to factored Hessian; compiles with numba as it stands."""

from wholebody.qp.kernels import blocks as mem
from wholebody.qp.kernels.constraints import all_bounds
from wholebody.qp.kernels.cost import (
    add_frame,
    add_posture,
    add_wrench,
    contact_gram,
    frame_targets,
    height_target,
    posture_target,
    reduce_row,
    turn_target,
    whole_body_target,
    wrench_cost,
)
from wholebody.qp.kernels.floor import limit_floor
from wholebody.qp.kernels.limits import (
    balance_rows,
    collision_rows,
    foot_target,
    height_rows,
    joint_bounds,
    orientation_rows,
    point_offsets,
)
from wholebody.qp.kernels.linear_algebra import (
    cholesky,
    inverse_6,
    null_space,
    particular,
    solve_transposed,
    solve_upper,
)
from wholebody.robot.kernels.frames import frame_columns, move_frames, place_frames
from wholebody.robot.kernels.rigid_body import dynamics


def move(reals, ints):
    """Dynamics, frames and their Jacobians."""
    q, v, S = mem.vector(reals, mem.Q_), mem.vector(reals, mem.V_), mem.matrix(reals, mem.S_)
    R, p, parent = mem.cube(reals, mem.R_), mem.matrix(reals, mem.P_), mem.vector(ints, mem.PARENT)
    V, A = mem.matrix(reals, mem.TWIST), mem.matrix(reals, mem.DRIFT)
    force, sums, root = (
        mem.matrix(reals, mem.FORCES),
        mem.vector(reals, mem.SUMS_),
        mem.vector(reals, mem.ROOT),
    )
    dynamics(
        q,
        v,
        mem.matrix(reals, mem.TABLE),
        parent,
        mem.vector(reals, mem.ARMATURE),
        mem.vector(reals, mem.GRAVITY),
        R,
        p,
        S,
        V,
        A,
        mem.matrix(reals, mem.INERTIA_),
        mem.matrix(reals, mem.MOMENTA),
        force,
        mem.matrix(reals, mem.M_),
        mem.matrix(reals, mem.F_),
        mem.vector(reals, mem.NLE),
        sums,
    )
    body, FP, J = (
        mem.vector(ints, mem.FRAME_BODY),
        mem.matrix(reals, mem.FP_),
        mem.matrix(reals, mem.FJ_),
    )
    place_frames(R, p, body, mem.cube(reals, mem.FRAME_R), mem.matrix(reals, mem.FRAME_P), mem.cube(reals, mem.FR_), FP)
    move_frames(V, A, body, FP, mem.matrix(reals, mem.FV_), mem.matrix(reals, mem.FA_))
    for f in range(body.shape[0]):
        frame_columns(S, parent, body[f], FP[f], J, 6 * f)
    centre = mem.vector(reals, mem.CENTRE)
    for k in range(3):
        centre[k] = sums[k] - q[k]
    now = mem.vector(reals, mem.CENTRE_NOW)
    for k in range(6):
        root[k], now[k] = force[0, k], sums[k]


def limit(reals, ints):
    """Bounds of all rows, and the soft rows themselves; frames: contacts, two palms, pelvis, torso."""
    counts, q, v = (
        mem.vector(ints, mem.COUNTS),
        mem.vector(reals, mem.Q_),
        mem.vector(reals, mem.V_),
    )
    low, high, tau = (
        mem.vector(reals, mem.LOW),
        mem.vector(reals, mem.HIGH),
        mem.vector(reals, mem.TAU),
    )
    sums, F, JS = (
        mem.vector(reals, mem.SUMS_),
        mem.matrix(reals, mem.F_),
        mem.matrix(reals, mem.JS_),
    )
    upper, FJ = mem.vector(reals, mem.SOFT_UPPER), mem.matrix(reals, mem.FJ_)
    FV, FA, FR, FP = (
        mem.matrix(reals, mem.FV_),
        mem.matrix(reals, mem.FA_),
        mem.cube(reals, mem.FR_),
        mem.matrix(reals, mem.FP_),
    )
    joint_bounds(q, v, mem.matrix(reals, mem.JOINTS), mem.vector(reals, mem.OPTIONS)[mem.HORIZON], low, high)
    share = mem.vector(reals, mem.TAU_MAX) if counts[mem.HANDS] else mem.vector(reals, mem.TAU_FULL)
    for j in range(tau.shape[0]):
        tau[j] = share[j]
        if not counts[mem.HANDS]:
            low[j], high[j] = -1e4, 1e4
    edges, balance, at = (
        mem.matrix(reals, mem.EDGES),
        mem.vector(reals, mem.BALANCE),
        mem.matrix(reals, mem.EDGES).shape[0],
    )
    balance_rows(edges, counts[mem.N_EDGES], sums, balance[0], balance[1], F, sums[21], JS, upper)
    for e in range(counts[mem.N_EDGES], at):
        upper[e] = 1e300
    if counts[mem.TRUNK]:
        pelvis, torso = counts[mem.N_CONTACTS] + 2, counts[mem.N_CONTACTS] + 3
        scratch = mem.vector(reals, mem.SCRATCH)
        orientation_rows(
            mem.vector(reals, mem.PELVIS_REF),
            FR[pelvis],
            FV[pelvis],
            FA[pelvis],
            FJ,
            6 * pelvis,
            mem.vector(reals, mem.PELVIS_LIMIT),
            at,
            JS,
            upper,
            scratch,
        )
        orientation_rows(
            mem.vector(reals, mem.TORSO_REF),
            FR[torso],
            FV[torso],
            FA[torso],
            FJ,
            6 * torso,
            mem.vector(reals, mem.TORSO_LIMIT),
            at + 6,
            JS,
            upper,
            scratch,
        )
        height_rows(
            mem.vector(reals, mem.HEIGHT_REF),
            q[2] + FP[pelvis, 2],
            FV[pelvis],
            FA[pelvis],
            FJ,
            6 * pelvis,
            mem.vector(reals, mem.HEIGHT_LIMIT),
            at + 12,
            JS,
            upper,
        )
        at = limit_floor(reals, ints, at + 15)
    limit_pairs(reals, ints, at)
    all_bounds(
        low,
        high,
        tau,
        mem.vector(reals, mem.NLE),
        mem.vector(reals, mem.CONTACT),
        upper,
        mem.vector(reals, mem.LOWER),
        mem.vector(reals, mem.UPPER),
    )


def limit_pairs(reals, ints, at):
    """Soft rows of the near pairs, from slot ``at`` on; those without a pair are switched off."""
    counts, upper = mem.vector(ints, mem.COUNTS), mem.vector(reals, mem.SOFT_UPPER)
    collision_rows(
        mem.vector(reals, mem.Q_),
        mem.matrix(reals, mem.PAIRS),
        mem.vector(ints, mem.PAIR_BODY),
        counts[mem.N_PAIRS],
        mem.matrix(reals, mem.S_),
        mem.vector(ints, mem.PARENT),
        mem.matrix(reals, mem.TWIST),
        mem.matrix(reals, mem.DRIFT),
        mem.vector(ints, mem.DRIVEN),
        mem.vector(reals, mem.COLLISION_LIMIT),
        at,
        mem.matrix(reals, mem.JS_),
        upper,
        mem.vector(reals, mem.SCRATCH),
    )
    for i in range(at + counts[mem.N_PAIRS], upper.shape[0]):
        upper[i] = 1e300


def contacts(reals, ints):
    """Eliminate the contacts: allowed accelerations, a particular one, and what point forces do to the robot."""
    counts, q, bound = (
        mem.vector(ints, mem.COUNTS),
        mem.vector(reals, mem.Q_),
        mem.vector(ints, mem.BOUND),
    )
    FJ, FP, FR = mem.matrix(reals, mem.FJ_), mem.matrix(reals, mem.FP_), mem.cube(reals, mem.FR_)
    FV, FA, contact = (
        mem.matrix(reals, mem.FV_),
        mem.matrix(reals, mem.FA_),
        mem.vector(reals, mem.CONTACT),
    )
    B, beta, target = (
        mem.matrix(reals, mem.B_),
        mem.matrix(reals, mem.BETA),
        mem.vector(reals, mem.CONTACT_TARGET),
    )
    local, arms, points = (
        mem.matrix(reals, mem.LOCAL_POINTS),
        mem.matrix(reals, mem.ARMS),
        mem.matrix(reals, mem.POINTS),
    )
    ref, scratch = mem.matrix(reals, mem.FOOT_REF), mem.vector(reals, mem.SCRATCH)
    n = counts[mem.N_CONTACTS]
    each = local.shape[0] // n
    for c in range(n):
        mine = slice(each * c, each * (c + 1))
        point_offsets(FR[c], FP[c], local[mine], arms[mine], points[mine])
        goal = target[6 * c : 6 * c + 6]
        foot_target(ref[c], q, FR[c], FP[c], FV[c], FA[c], contact[0], contact[1], goal, scratch)
        for r in range(6 * c, 6 * c + 6):
            for i in range(bound.shape[0]):
                B[r, i] = FJ[r, bound[i]]
    if not null_space(B, 6 * n, bound.shape[0], beta, mem.matrix(reals, mem.Z_)):
        return False
    goal = scratch[: 6 * n]
    for r in range(6 * n):
        goal[r] = target[r]
    particular(B, beta, 6 * n, bound.shape[0], goal, mem.vector(reals, mem.DV_P))
    contact_gram(points, mem.matrix(reals, mem.GRAM))
    return inverse_6(mem.matrix(reals, mem.GRAM), mem.matrix(reals, mem.K_), mem.matrix(reals, mem.W_))


def targets(reals, ints):
    """What the tasks want."""
    counts, q, v = (
        mem.vector(ints, mem.COUNTS),
        mem.vector(reals, mem.Q_),
        mem.vector(reals, mem.V_),
    )
    FP, FR, FV, FA = (
        mem.matrix(reals, mem.FP_),
        mem.cube(reals, mem.FR_),
        mem.matrix(reals, mem.FV_),
        mem.matrix(reals, mem.FA_),
    )
    target, weight = mem.matrix(reals, mem.TARGET), mem.matrix(reals, mem.WEIGHT)
    hands, share, scratch = (
        mem.matrix(reals, mem.HAND_REF),
        mem.vector(reals, mem.SHARE),
        mem.vector(reals, mem.SCRATCH),
    )
    n = counts[mem.N_CONTACTS]
    for i in range(2):
        trust = share[i] if counts[mem.HANDS] else 0.0
        frame_targets(
            q,
            hands[i],
            trust,
            mem.vector(reals, mem.HAND_GAIN),
            FR[n + i],
            FP[n + i],
            FV[n + i],
            FA[n + i],
            target[n + i],
            weight[n + i],
            scratch,
        )
    pelvis, torso = n + 2, n + 3
    turn_target(
        mem.vector(reals, mem.PELVIS_REF),
        mem.vector(reals, mem.PELVIS_GAIN),
        FR[pelvis],
        FV[pelvis],
        FA[pelvis],
        target[pelvis],
        weight[pelvis],
        scratch,
    )
    turn_target(
        mem.vector(reals, mem.TORSO_REF),
        mem.vector(reals, mem.TORSO_GAIN),
        FR[torso],
        FV[torso],
        FA[torso],
        target[torso],
        weight[torso],
        scratch,
    )
    height_target(
        mem.vector(reals, mem.HEIGHT_REF),
        mem.vector(reals, mem.HEIGHT_GAIN),
        q[2] + FP[pelvis, 2],
        FV[pelvis],
        FA[pelvis],
        target[pelvis],
        weight[pelvis],
    )
    whole_body_target(
        mem.vector(reals, mem.SUMS_),
        mem.vector(reals, mem.COM_REF),
        mem.vector(reals, mem.COM_GAIN),
        mem.vector(reals, mem.MOMENTUM_GAIN),
        mem.vector(reals, mem.BODY_TARGET),
        mem.vector(reals, mem.BODY_WEIGHT),
        scratch,
    )
    posture = mem.vector(reals, mem.POSTURE_TARGET)
    posture_target(
        q,
        v,
        mem.matrix(reals, mem.POSTURE_REF),
        mem.matrix(reals, mem.POSTURE_GAIN),
        mem.vector(reals, mem.OPTIONS)[mem.POSTURE_PULL],
        posture,
    )
    if not counts[mem.HANDS]:
        for j in range(posture.shape[0]):
            posture[j] = -10.0 * v[6 + j]


def cost(reals, ints):
    """Reduced Hessian and gradient, factor and free minimiser."""
    bound, free, Z = (
        mem.vector(ints, mem.BOUND),
        mem.vector(ints, mem.FREE),
        mem.matrix(reals, mem.Z_),
    )
    dv_p, H, g = (
        mem.vector(reals, mem.DV_P),
        mem.matrix(reals, mem.H_),
        mem.vector(reals, mem.G_),
    )
    F, FR, w_p, prices = (
        mem.matrix(reals, mem.F_),
        mem.matrix(reals, mem.REDUCED_F),
        mem.vector(reals, mem.W_P),
        mem.vector(reals, mem.PRICES),
    )
    ny = g.shape[0]
    for a in range(ny):
        g[a] = 0.0
        for b in range(ny):
            H[a, b] = 0.0
    for a in range(6):
        w_p[a] = 0.0
        for j in range(ny):
            FR[a, j] = 0.0
    reduce_wrench(F, bound, free, Z, dv_p, FR, w_p)
    K, k = mem.matrix(reals, mem.K_), mem.vector(reals, mem.K_RHS)
    sums = mem.vector(reals, mem.SUMS_)
    wrench_cost(
        mem.vector(reals, mem.CENTRE),
        sums[21],
        mem.matrix(reals, mem.W_),
        mem.vector(reals, mem.ROOT),
        mem.vector(reals, mem.BODY_TARGET),
        mem.vector(reals, mem.BODY_WEIGHT),
        prices[mem.PRICE_FORCE],
        K,
        k,
    )
    add_wrench(FR, w_p, K, k, ny, mem.matrix(reals, mem.KF_), H, g)
    J, target, weight = (
        mem.matrix(reals, mem.FJ_),
        mem.matrix(reals, mem.TARGET),
        mem.matrix(reals, mem.WEIGHT),
    )
    rows, weighted = mem.matrix(reals, mem.FRAME_ROWS), mem.matrix(reals, mem.KF_)
    left = mem.vector(reals, mem.SCRATCH)
    for f in range(target.shape[0]):
        if not has_weight(weight[f]):
            continue
        for r in range(6):
            reduce_row(J[6 * f + r], bound, free, Z, rows[r])
            left[r] = target[f, r]
            for i in range(bound.shape[0]):
                left[r] -= J[6 * f + r, bound[i]] * dv_p[i]
        add_frame(rows, weight[f], left, weighted, ny, H, g)
    add_posture(
        mem.matrix(reals, mem.POSTURE_GAIN)[2],
        mem.vector(reals, mem.POSTURE_TARGET),
        prices[mem.PRICE_ACCELERATION],
        bound,
        free,
        Z,
        dv_p,
        H,
        g,
    )
    return factor(mem.matrix(reals, mem.H_), mem.matrix(reals, mem.U_), g, mem.vector(reals, mem.Y0))


def has_weight(weight):
    """Whether one of six weights is not zero."""
    return weight[0] + weight[1] + weight[2] + weight[3] + weight[4] + weight[5] > 0.0


def reduce_wrench(F, bound, free, Z, dv_p, FR, w_p):
    """``FR = F' Z`` (6, ny) and ``w_p = F' dv_p`` (6,), both zero on entry."""
    nr = Z.shape[1]
    for i in range(bound.shape[0]):
        c = bound[i]
        for a in range(6):
            w_p[a] += F[c, a] * dv_p[i]
            for r in range(nr):
                FR[a, r] += F[c, a] * Z[i, r]
    for k in range(free.shape[0]):
        for a in range(6):
            FR[a, nr + k] = F[free[k], a]


def factor(H, U, g, y):
    """Upper Cholesky factor of H and the minimiser ``-H^-1 g``; False if H is not positive definite."""
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


def assemble(reals, ints):
    """Everything before the solution; a code of `blocks`."""
    limit(reals, ints)
    if not contacts(reals, ints):
        return mem.NO_CONTACT
    targets(reals, ints)
    return mem.SOLVED if cost(reals, ints) else mem.NOT_CONVEX
