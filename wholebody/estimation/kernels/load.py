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
from typing import NamedTuple

import numpy as np

from wholebody.robot.kernels.rotation import rotate
from wholebody.robot.kernels.spatial import velocity_at


class Dynamics(NamedTuple):
    """What the last tick computed at the state before, as in `wholebody.robot.kernels.rigid_body`."""

    v: np.ndarray  # (nv,)
    parent: np.ndarray  # (bodies,)
    R: np.ndarray  # (bodies, 3, 3)
    p: np.ndarray  # (bodies, 3)
    S: np.ndarray  # (nv, 6)
    V: np.ndarray  # (bodies, 6)
    A: np.ndarray  # (bodies, 6)
    M: np.ndarray  # (nv, nv)
    nle: np.ndarray  # (nv,)
    gravity: np.ndarray  # (3,)


class Hands(NamedTuple):
    """Both hands, left first."""

    body: np.ndarray  # (2,) that the load is fixed to
    place: np.ndarray  # (2, 3) of the load there [m]
    arm: np.ndarray  # (2, k) velocities of the joints of each arm


class Memory(NamedTuple):
    """What goes on from tick to tick."""

    residual: np.ndarray  # (2, k) low-passed torques that the masses account for [N m]
    unit: np.ndarray  # (2, k) the same of 1 kg [N m/kg]
    mass: np.ndarray  # (2,) found [kg]
    error: np.ndarray  # (2,) of it, one standard deviation [kg]
    dv: np.ndarray  # (nv,) scratch
    six: np.ndarray  # (6,) scratch


def observe(dynamics, hands, memory, v, tau, assumed, dt, keep, torque_error) -> None:
    """One tick.

    Args:
        dynamics: `Dynamics` of the state before, with the assumed masses in its hands.
        hands: `Hands`.
        memory: `Memory`, changed.
        v: Velocity now (nv,).
        tau: Torques in between (nv - 6,).
        assumed: Masses (2,) [kg].
        dt: Time in between [s].
        keep: Share that the filters keep, 0 to 1.
        torque_error: Of the torques of an arm [N m].
    """
    dv, a, M = memory.dv, memory.six, dynamics.M
    for c in range(v.shape[0]):
        dv[c] = (v[c] - dynamics.v[c]) / dt
    for h in range(2):
        residual, unit, body = memory.residual[h], memory.unit[h], hands.body[h]
        x, y, z = lifted(dynamics, body, hands.place[h], dv, a)
        for i in range(residual.shape[0]):
            c = hands.arm[h, i]
            missing = tau[c - 6] - dynamics.nle[c]
            for k in range(dv.shape[0]):
                missing -= M[c, k] * dv[k]
            jx, jy, jz = velocity_at(dynamics.S[c], a)
            one = jx * x + jy * y + jz * z
            residual[i] = keep * residual[i] + (1.0 - keep) * (missing + assumed[h] * one)
            unit[i] = keep * unit[i] + (1.0 - keep) * one
        memory.mass[h], memory.error[h] = ratio(residual, unit, torque_error)


def lifted(dynamics, body, place, dv, x) -> tuple[float, float, float]:
    """Acceleration of a load less gravity; its place (3,) from the base, in world axes, is left in ``x`` (6,)."""
    R, S, A, V = dynamics.R[body], dynamics.S, dynamics.A[body], dynamics.V[body]
    for k in range(3):
        x[k] = dynamics.p[body, k] + rotate(R, k, place[0], place[1], place[2])
    vx, vy, vz = velocity_at(V, x)
    ax, ay, az = velocity_at(A, x)
    ax, ay, az = ax + V[4] * vz - V[5] * vy, ay + V[5] * vx - V[3] * vz, az + V[3] * vy - V[4] * vx
    k = body
    while k > 0:
        c = 5 + k
        jx, jy, jz = velocity_at(S[c], x)
        ax, ay, az = ax + jx * dv[c], ay + jy * dv[c], az + jz * dv[c]
        k = dynamics.parent[k]
    for c in range(6):
        jx, jy, jz = velocity_at(S[c], x)
        ax, ay, az = ax + jx * dv[c], ay + jy * dv[c], az + jz * dv[c]
    return ax - dynamics.gravity[0], ay - dynamics.gravity[1], az - dynamics.gravity[2]


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
