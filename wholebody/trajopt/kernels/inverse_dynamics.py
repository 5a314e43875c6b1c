r"""Inverse dynamics at a knot with its derivatives: the wrench on the whole robot, and torques of waist and arms.

Only what the optimiser asks for is computed. All vectors are in world axes about the base, as in
`wholebody.robot.kernels.spatial`, and derivatives are taken with that point held still.

For joint j with axis S, twist V and acceleration A of the body before it (gravity included):
``psi_dot = V x S``, ``psi_ddot = A x S + V x psi_dot``. A subtree with composite inertia I, momentum (l, k), force f
and Coriolis matrix ``B = [0, -2 l x; 0, D - k x]`` changes its force by ``B psi_dot + I psi_ddot + S x* f`` for the
position of the joint that carries it, and by ``B S + I (psi_dot + S_dot)`` for its velocity.

What pushes a palm is taken off the forces on the bodies that carry it. It keeps its direction where these turn, so
derivatives by position have the force ``g = w x f`` at the palm besides what a force that turned along would give; w is
the angular part of the column of the joint.

Source:
    Singh, Russo and Wensing 2022, "Efficient Analytical Derivatives of Rigid-Body Dynamics using Spatial Vector
    Algebra", RA-L 7(2), whose symbols are used.
"""

from __future__ import annotations

from wholebody.jit.arrays import Matrix, Vector
from wholebody.robot.kernels.frames import PALM_FRAME
from wholebody.robot.kernels.spatial import add_cross_force, add_force_at, cross, cross_motion, dot6, momentum_of
from wholebody.trajopt.arrays import KnotTargets, Tables
from wholebody.trajopt.layout import LOWER, N_BODY, TAU, UPPER
from wholebody.trajopt.workspace import KnotMotion, KnotScratch


def subtree_forces(k: int, row: int, robot: Tables, task: KnotTargets, m: KnotMotion, work: KnotScratch) -> None:
    """Forces on the subtrees of a knot and their derivatives, with those on the palms in a row of the task."""
    forward_pass(k, robot, m, work)
    if task.pushed:
        take_pushes(k, task.pushes[row], robot, m, work)
    force_derivatives(k, m, work)
    if task.pushed:
        turn_pushes(robot, work)


def torque_rows(k: int, robot: Tables, task: KnotTargets, m: KnotMotion, work: KnotScratch) -> None:
    """Rows TAU of a knot, after `subtree_forces`."""
    torques(k, robot, m, work)
    if task.pushed:
        turn_pushed_torques(k, robot, m, work)


def forward_pass(k: int, robot: Tables, m: KnotMotion, work: KnotScratch) -> None:
    """Twists and accelerations of the bodies, forces on each with all that hangs on it, and psi_dot and psi_ddot.

    ``work.A_kept`` is the acceleration if pelvis and joints kept their velocities.
    """
    S, v, a, V, A, kept, f, h = m.S[k], m.v[k], m.a[k], work.V, work.A, work.A_kept, work.f, work.h
    n = V.shape[0]
    for i in range(6):
        V[0, i] = A[0, i] = 0.0
        for j in range(6):
            V[0, i] += S[j, i] * v[j]
            A[0, i] += S[j, i] * a[j]
    cross(V[0], V[0, 3:], kept[0])  # the pelvis keeps its velocity in world, not in its own axes
    for i in range(3):
        kept[0, 3 + i] = 0.0
        A[0, i] -= robot.gravity[i]
        work.six[0, i], work.six[0, 3 + i] = -robot.gravity[i], 0.0
    for j in range(6):
        cross_motion(work.six[0], S[j], work.psi_ddot[j])
        for i in range(6):
            work.psi_dot[j, i] = 0.0
    for i in range(n):
        if i > 0:
            before, j = robot.parent[i], 5 + i
            s, psi_dot, psi_ddot = S[j], work.psi_dot[j], work.psi_ddot[j]
            cross_motion(V[before], s, psi_dot)
            cross_motion(A[before], s, psi_ddot)
            cross_motion(V[before], psi_dot, work.six[0])
            for c in range(6):
                psi_ddot[c] += work.six[0, c]
                V[i, c] = V[before, c] + v[j] * s[c]
                A[i, c] = A[before, c] + a[j] * s[c] + v[j] * psi_dot[c]
                kept[i, c] = kept[before, c] + v[j] * psi_dot[c]
        momentum_of(m.inertia[k, i], V[i], h[i])
        momentum_of(m.inertia[k, i], A[i], f[i])
        add_cross_force(V[i], h[i], f[i])
        coriolis_moments(m.inertia[k, i], V[i], work.D[i])
    for i in range(n - 1, 0, -1):
        before = robot.parent[i]
        for c in range(6):
            f[before, c] += f[i, c]
            h[before, c] += h[i, c]
            work.D[before, c] += work.D[i, c]


def coriolis_moments(n: Vector, V: Vector, D: Vector) -> None:
    """The symmetric part D (xx xy xz yy yz zz) of the Coriolis matrix B of a body."""
    x, y, z, a, b, c = V[0], V[1], V[2], V[3], V[4], V[5]
    mx, my, mz = n[1], n[2], n[3]
    twice = 2.0 * (mx * x + my * y + mz * z)
    D[0] = twice - 2.0 * mx * x + 2.0 * (b * n[6] - c * n[5])
    D[3] = twice - 2.0 * my * y + 2.0 * (c * n[5] - a * n[8])
    D[5] = twice - 2.0 * mz * z + 2.0 * (a * n[8] - b * n[6])
    D[1] = -(mx * y + my * x) + (b * n[8] - c * n[7]) + (c * n[4] - a * n[6])
    D[2] = -(mx * z + mz * x) + (b * n[9] - c * n[8]) + (a * n[5] - b * n[4])
    D[4] = -(my * z + mz * y) + (c * n[6] - a * n[9]) + (a * n[7] - b * n[5])


def times_D(D: Vector, x: float, y: float, z: float, out: Vector, at: int) -> None:
    """``out[at:at + 3] += D [x y z]``."""
    out[at] += D[0] * x + D[1] * y + D[2] * z
    out[at + 1] += D[1] * x + D[3] * y + D[4] * z
    out[at + 2] += D[2] * x + D[4] * y + D[5] * z


def add_B(h: Vector, D: Vector, t: Vector, out: Vector) -> None:
    """Add ``B t`` to a force (6,), B by momentum h (6,) and D (6,) of `coriolis_moments`."""
    a, b, c = t[3], t[4], t[5]
    out[0] -= 2.0 * (h[1] * c - h[2] * b)
    out[1] -= 2.0 * (h[2] * a - h[0] * c)
    out[2] -= 2.0 * (h[0] * b - h[1] * a)
    times_D(D, a, b, c, out, 3)
    out[3] -= h[4] * c - h[5] * b
    out[4] -= h[5] * a - h[3] * c
    out[5] -= h[3] * b - h[4] * a


def force_derivatives(k: int, m: KnotMotion, work: KnotScratch) -> None:
    """Fill ``work.F``: derivatives of the forces on subtrees by position and velocity of the joints that carry them."""
    S = m.S[k]
    for j in range(N_BODY):
        i = max(j - 5, 0)
        by_q, by_v, inertia = work.F[0, j], work.F[1, j], m.I_composite[k, i]
        momentum_of(inertia, work.psi_ddot[j], by_q)
        add_B(work.h[i], work.D[i], work.psi_dot[j], by_q)
        add_cross_force(S[j], work.f[i], by_q)
        # S_dot is psi_dot for a joint, whose axis moves with the body before it; those of the base move with the base.
        if j < 6:
            cross_motion(work.V[0], S[j], work.psi_S_dot[j])
        else:
            for c in range(6):
                work.psi_S_dot[j, c] = 2.0 * work.psi_dot[j, c]
        momentum_of(inertia, work.psi_S_dot[j], by_v)
        add_B(work.h[i], work.D[i], S[j], by_v)


def torques(k: int, robot: Tables, m: KnotMotion, work: KnotScratch) -> None:
    """Rows TAU: torques of waist and arms, which base, waist and arms move."""
    S, D, lower, upper = m.S[k], work.six[2], work.lower, work.upper
    for u in range(UPPER):
        i, row = LOWER + u, TAU + u
        body, s, force = i - 5, S[i], m.F[k, i]
        m.dynamics[k, row] = dot6(s, work.f[body])
        h = work.h[body]
        # B' S, whose linear part is zero.
        D[3] = -2.0 * (s[1] * h[2] - s[2] * h[1]) - (s[4] * h[5] - s[5] * h[4])
        D[4] = -2.0 * (s[2] * h[0] - s[0] * h[2]) - (s[5] * h[3] - s[3] * h[5])
        D[5] = -2.0 * (s[0] * h[1] - s[1] * h[0]) - (s[3] * h[4] - s[4] * h[3])
        times_D(work.D[body], s[3], s[4], s[5], D, 3)
        for j in range(6):
            lower[0, row, j], lower[1, row, j], lower[2, row, j] = torque_derivatives(j, force, D, S, work)
        up = body
        while up > 0:
            j = 5 + up
            column = j - LOWER
            upper[0, row, column], upper[1, row, column], upper[2, row, column] = torque_derivatives(
                j, force, D, S, work
            )
            if j < i:
                # The other half: the torque of a joint before, by this one.
                x, other = S[j], TAU + column
                upper[0, other, u], upper[1, other, u] = dot6(x, work.F[0, i]), dot6(x, work.F[1, i])
                upper[2, other, u] = dot6(x, force)
            up = robot.parent[up]


def torque_derivatives(j: int, force: Vector, D: Vector, S: Matrix, work: KnotScratch) -> tuple[float, float, float]:
    """Derivatives of a torque by position, velocity and acceleration of a joint at or before its own."""
    s, psi_dot = S[j], work.psi_dot[j]
    by_q = dot6(force, work.psi_ddot[j]) + D[3] * psi_dot[3] + D[4] * psi_dot[4] + D[5] * psi_dot[5]
    by_v = dot6(force, work.psi_S_dot[j]) + D[3] * s[3] + D[4] * s[4] + D[5] * s[5]
    return by_q, by_v, dot6(force, s)


def take_pushes(k: int, pushes: Vector, robot: Tables, m: KnotMotion, work: KnotScratch) -> None:
    """Take the forces (6,) on both palms off those on the bodies that carry them, and find how they turn."""
    for h in range(2):
        frame, f, x, w = PALM_FRAME + h, pushes[3 * h : 3 * h + 3], work.palms[h], work.pushes[h]
        body, p = robot.frame_body[frame], robot.frame_p[frame]
        for a in range(3):
            R = m.R[k, body, a]
            x[a] = m.p[k, body, a] + R[0] * p[0] + R[1] * p[1] + R[2] * p[2]
        w[:] = 0.0
        add_force_at(x, f[0], f[1], f[2], w)
        up = body
        while up > 0:
            for c in range(6):
                work.f[up, c] -= w[c]
            up = robot.parent[up]
        for c in range(6):
            work.f[0, c] -= w[c]
        for j in range(N_BODY):
            turn = work.push_turns[h, j]
            turn[:] = 0.0
            if robot.carries[frame, j]:
                g = work.six[0]
                cross(m.S[k, j, 3:], f, g)
                add_force_at(x, g[0], g[1], g[2], turn)


def turn_pushes(robot: Tables, work: KnotScratch) -> None:
    """Add to `force_derivatives` that forces on the palms do not turn with the bodies."""
    for h in range(2):
        for j in range(N_BODY):
            for c in range(6):
                work.F[0, j, c] += work.push_turns[h, j, c]


def turn_pushed_torques(k: int, robot: Tables, m: KnotMotion, work: KnotScratch) -> None:
    """Add the same to the derivatives of torques by the joints before their own."""
    for h in range(2):
        frame = PALM_FRAME + h
        for u in range(UPPER):
            i = LOWER + u
            if robot.carries[frame, i]:
                s = m.S[k, i]
                for j in range(6):
                    work.lower[0, TAU + u, j] += dot6(s, work.push_turns[h, j])
                for j in range(LOWER, i + 1):
                    if robot.carries[frame, j]:
                        work.upper[0, TAU + u, j - LOWER] += dot6(s, work.push_turns[h, j])
