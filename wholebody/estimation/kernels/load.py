"""What the hands carry, from the torques of the arms over one control period; compiles with numba as it stands.

With ``dv`` the acceleration that happened, the arm's rows of the dynamics miss what an unknown mass m at the point x of
the hand adds: ``tau - M dv - nle = m J_x' (a_x - g)``. Feet and everything they touch have no part in these rows.

Both sides are low-passed alike, the right one for a unit mass, and the mass is their ratio in the sense of least
squares: the momentum observer of De Luca et al. for what acts along gravity. Speeds need not be smooth for that.

Source:
    De Luca, Albu-Schaeffer, Haddadin and Hirzinger 2006, "Collision detection and safe reaction with the DLR-III
    lightweight manipulator arm", IROS; Haddadin, De Luca and Albu-Schaeffer 2017, "Robot collisions: a survey", T-RO.
"""

from __future__ import annotations

import math

from wholebody.jit.packed import Packed
from wholebody.robot.kernels.rotation import rotate
from wholebody.robot.kernels.spatial import velocity_at


def observe(tick: Packed, memory: Packed, v, tau, assumed, dt, keep, torque_error) -> None:
    """One tick.

    Args:
        tick: The dynamics of the state before, with the assumed masses in its hands: ``v R p S V A M nle parent
            gravity`` as in `wholebody.robot.kernels.rigid_body`.
        memory: Of the observer, as in `wholebody.estimation.load.memory`, changed.
        v: Velocity now (nv,).
        tau: Torques in between (nv - 6,).
        assumed: Masses (2,) [kg].
        dt: Time in between [s].
        keep: Share that the filters keep, 0 to 1.
        torque_error: Of the torques of an arm [N m].
    """
    dv, x_load, M, S, nle, before, arm = memory.dv, memory.six, tick.M, tick.S, tick.nle, tick.v, memory.arm
    for c in range(v.shape[0]):
        dv[c] = (v[c] - before[c]) / dt
    for h in range(2):
        residual, unit = memory.residual[h], memory.unit[h]
        x, y, z = lifted(tick, memory.body[h], memory.place[h], dv, x_load)
        for i in range(residual.shape[0]):
            c = arm[h, i]
            missing = tau[c - 6] - nle[c]
            for k in range(dv.shape[0]):
                missing -= M[c, k] * dv[k]
            jx, jy, jz = velocity_at(S[c], x_load)
            one = jx * x + jy * y + jz * z
            residual[i] = keep * residual[i] + (1.0 - keep) * (missing + assumed[h] * one)
            unit[i] = keep * unit[i] + (1.0 - keep) * one
        memory.mass[h], memory.error[h] = ratio(residual, unit, torque_error)


def lifted(tick: Packed, body, place, dv, x) -> tuple[float, float, float]:
    """Acceleration of a load less gravity; its place (3,) from the base, in world axes, is left in ``x`` (6,)."""
    R, p, S, A, V, parent, g = tick.R[body], tick.p[body], tick.S, tick.A[body], tick.V[body], tick.parent, tick.gravity
    for k in range(3):
        x[k] = p[k] + rotate(R, k, place[0], place[1], place[2])
    vx, vy, vz = velocity_at(V, x)
    ax, ay, az = velocity_at(A, x)
    ax, ay, az = ax + V[4] * vz - V[5] * vy, ay + V[5] * vx - V[3] * vz, az + V[3] * vy - V[4] * vx
    k = body
    while k > 0:
        c = 5 + k
        jx, jy, jz = velocity_at(S[c], x)
        ax, ay, az = ax + jx * dv[c], ay + jy * dv[c], az + jz * dv[c]
        k = parent[k]
    for c in range(6):
        jx, jy, jz = velocity_at(S[c], x)
        ax, ay, az = ax + jx * dv[c], ay + jy * dv[c], az + jz * dv[c]
    return ax - g[0], ay - g[1], az - g[2]


def ratio(residual, unit, torque_error) -> tuple[float, float]:
    """Mass [kg] that accounts best for torques, and its error: what it leaves unaccounted for counts against it."""
    along = size = left = 0.0
    for i in range(unit.shape[0]):
        along += unit[i] * residual[i]
        size += unit[i] * unit[i]
    if not size > 0.0:
        return 0.0, math.inf
    mass = along / size
    for i in range(unit.shape[0]):
        left += (residual[i] - mass * unit[i]) ** 2
    return mass, math.sqrt((torque_error * torque_error + left) / size)
