"""Bounds on the torques with which the waist would hold the upper body still.

Accelerations from knot to knot can lower the torques at the knots below those in between. Where the waist could hold
the upper body at rest, the robot can stop anywhere.
"""

from __future__ import annotations

from wholebody.robot.kernels.spatial import add_cross_force, cross_motion, dot6, momentum_of
from wholebody.trajopt.arrays import Tables
from wholebody.trajopt.kernels.configuration_terms import reduce_row
from wholebody.trajopt.layout import LOWER, N_BODY, STATIC, WAIST
from wholebody.trajopt.workspace import KnotMotion, KnotScratch


def static_torque(k: int, robot: Tables, m: KnotMotion, work: KnotScratch) -> None:
    """Bounds STATIC of knot ``k`` and their derivatives; as `inverse_dynamics.torques` without velocities."""
    S, F, row, six = m.S[k], m.F[k], work.rows[0], work.six
    lift, lift_rate, force, force_rate = six[0], six[1], six[2], six[3]
    for a in range(3):
        lift[a], lift[3 + a] = -robot.gravity[a], 0.0
    for w in range(WAIST):
        i = LOWER + w
        momentum_of(m.I_composite[k, i - 5], lift, force)
        torque = dot6(S[i], force)
        m.sign[k, STATIC + w] = 1.0 if torque > 0.0 else -1.0
        m.violation[k, STATIC + w] = abs(torque) / robot.tau_max[w] - 1.0
        for j in range(N_BODY):
            row[j] = 0.0
        for j in range(6):
            cross_motion(lift, S[j], lift_rate)
            row[j] = dot6(F[i], lift_rate)
        up = i - 5
        while up > 0:
            cross_motion(lift, S[5 + up], lift_rate)
            row[5 + up] = dot6(F[i], lift_rate)
            up = robot.parent[up]
        # What hangs on the waist changes its torque by how its own weight turns.
        for j in range(i + 1, N_BODY):
            momentum_of(m.I_composite[k, j - 5], lift, force)
            cross_motion(lift, S[j], lift_rate)
            momentum_of(m.I_composite[k, j - 5], lift_rate, force_rate)
            add_cross_force(S[j], force, force_rate)
            row[j] = dot6(S[i], force_rate)
        reduce_row(row, m.free[k], m.J_static[k, w])
