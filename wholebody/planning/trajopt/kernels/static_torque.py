"""The torques with which the waist holds still what it carries; compiles with numba as it stands.

A plan may swing where the waist could not hold still, and a plan that shakes from knot to knot seems to carry more at
its knots than it does between them. Within this bound the robot can stop anywhere.
"""

from __future__ import annotations

from wholebody.planning.trajopt.kernels.configuration_terms import momentum_of, reduce_row
from wholebody.planning.trajopt.kernels.inverse_dynamics import add_cross_force, cross_motion, dot6
from wholebody.planning.trajopt.layout import HOLD, LOWER, N_BODY, WAIST


def hold(k, robot, m, work):
    """Bounds HOLD of knot ``k`` and their derivatives; as `inverse_dynamics.torques` without velocities."""
    S, F, row, six = m.S[k], m.F[k], work.rows[0], work.six
    rise, swing, force, rate = six[0], six[1], six[2], six[3]
    for a in range(3):
        rise[a], rise[3 + a] = -robot.gravity[a], 0.0
    for w in range(WAIST):
        i = LOWER + w
        momentum_of(m.trees[k, i - 5], rise, force)
        torque = dot6(S[i], force)
        m.sign[k, HOLD + w] = 1.0 if torque > 0.0 else -1.0
        m.over[k, HOLD + w] = abs(torque) / robot.tau_max[w] - 1.0
        for j in range(N_BODY):
            row[j] = 0.0
        for j in range(6):
            cross_motion(rise, S[j], swing)
            row[j] = dot6(F[i], swing)
        up = i - 5
        while up > 0:
            cross_motion(rise, S[5 + up], swing)
            row[5 + up] = dot6(F[i], swing)
            up = robot.parent[up]
        # What hangs on the waist changes its torque by how its own weight turns.
        for j in range(i + 1, N_BODY):
            momentum_of(m.trees[k, j - 5], rise, force)
            cross_motion(rise, S[j], swing)
            momentum_of(m.trees[k, j - 5], swing, rate)
            add_cross_force(S[j], force, rate)
            row[j] = dot6(S[i], rate)
        reduce_row(row, m.free[k], m.J_hold[k, w])
