"""Torques of waist and arms between knots, where the curve of a plan may need more than at them.

Accelerations change linearly from a knot to the next, and torques with them, but for what places and velocities add:
that is quadratic, and at its most halfway. A row of the program reaches no further than to both neighbours of a knot,
and the place halfway depends on four. So there are two torques for it: that before and that after the knot, each at the
place and the velocity that the curve has halfway if its acceleration did not change from there. The mean of what two
neighbours have is what the curve has, so its torque is inside where both of theirs are.
"""

from __future__ import annotations

from wholebody.robot.kernels.bodies import place_base, place_bodies
from wholebody.trajopt.arrays import KnotTargets, Tables
from wholebody.trajopt.kernels.configuration_terms import composite_inertias
from wholebody.trajopt.kernels.dynamics_rows import project_dynamics
from wholebody.trajopt.kernels.fixed_feet_kinematics import integrate
from wholebody.trajopt.kernels.inverse_dynamics import subtree_forces, torque_rows
from wholebody.trajopt.layout import LOWER, N_BETWEEN, N_BODY, N_JOINTS, TAU, UPPER
from wholebody.trajopt.workspace import KnotMotion, KnotScratch

HALFWAY, CURVED, FIRST_CURVED, TURNED = 0.5, 1.0 / 24.0, -1.0 / 8.0, 0.25
"""Of the step: how far the place is on the way to the next control point; of its square times the acceleration how far
it is beside that way; of the step times the acceleration what is added to the velocity. Derived: with these the means
of two neighbours are place and velocity of the cubic B-spline halfway. The first knot is on the curve and no control
point, which is a sixth of that square times the acceleration further back."""


START_SHARE = 0.2
"""Share of their weight with which torques between the first two knots count [no unit]; chosen: most of them are those
of the start, which no plan changes, but a plan is not to begin by shaking either."""


def torques_between(
    k: int, robot: Tables, task: KnotTargets, m: KnotMotion, beside: KnotMotion, work: KnotScratch
) -> None:
    """The bounds on torques before and after knot ``k``, and their derivatives; ``beside`` is scratch, one knot."""
    at, dt = m.violation.shape[1] - N_BETWEEN, task.dt
    for side in range(2):
        if k + side == 0:
            continue
        curved = CURVED if k > 0 else FIRST_CURVED
        sign, first = 2.0 * side - 1.0, at + side * UPPER
        q, a, lower = beside.q[0], beside.a[0], work.lower_step
        for j in range(q.shape[0]):
            q[j] = m.q[k, j]
        for j in range(N_BODY):
            a[j] = m.a[k, j]
            beside.v[0, j] = m.v[k, j] + sign * TURNED * dt * a[j]
            way = sign * HALFWAY * dt * m.v_mid[k + side, j] + curved * dt * dt * a[j]
            if j < LOWER:
                lower[j] = way
            else:
                q[1 + j] += way
        integrate(q, lower)
        R, p, S = beside.R[0], beside.p[0], beside.S[0]
        place_base(q, R[0], p[0], S)
        place_bodies(q, robot.bodies, robot.parent, 1, N_JOINTS + 1, R, p, S)
        composite_inertias(robot, R, p, S, beside.inertia[0], beside.I_composite[0], beside.F[0])
        subtree_forces(0, k, robot, task, beside, work)
        torque_rows(0, robot, task, beside, work)
        each = 1.0 if k > 0 else 2.0
        back, beyond = -HALFWAY * dt * (1 - side) - curved * dt, HALFWAY * dt * side + each * curved * dt
        later = 0.5 + sign * TURNED if k > 0 else each * TURNED
        shares = 0.5 - sign * TURNED, later, back, beyond
        J = m.J_between[k, side * UPPER : (side + 1) * UPPER]
        project_dynamics(k, TAU, shares, task, m, J, work)
        weight = START_SHARE if k + side == 1 else 1.0
        for u in range(UPPER):
            x = beside.dynamics[0, TAU + u]
            m.sign[k, first + u] = 1.0 if x > 0.0 else -1.0
            m.violation[k, first + u] = weight * (abs(x) / robot.between_max[u] - 1.0)
            for j in range(J.shape[1]):
                J[u, j] *= weight
