"""Motors and state of the MuJoCo plant; compiled by `wholebody.jit.entry`.

A dozen calls of numpy on 43 numbers take longer than a third of MuJoCo's step.
"""

from __future__ import annotations

import math

import numpy as np

from wholebody.jit.arrays import Indices, Vector


def drive(
    command: tuple[Vector, Vector, Vector, Vector, Vector], index: np.ndarray, effort: Vector,
    state: tuple[Vector, Vector], ctrl: Vector, torque: Vector, asked: Vector, anew: bool
) -> bool:  # fmt: skip
    """Torques of one physics step: ``clip(tau + kp (q - q_meas) + kd (dq - dq_meas), -effort, effort)``.

    Args:
        command: ``q dq tau kp kd`` in motor order, (n,) each.
        index: Where in ``qpos``, ``qvel`` and ``ctrl`` the motors are (3, n).
        effort: Effort limits (n,).
        state: ``qpos`` and ``qvel``.
        ctrl: Out, controls.
        torque: Out, torques (n,).
        asked: In and out, largest magnitudes asked for since it was begun anew (n,).
        anew: Whether it begins anew.

    Returns:
        Whether everything was finite and no gain negative; if not, nothing is to be simulated.
    """
    q, dq, tau, kp, kd = command
    qpos, qvel = state
    sound = True
    for i in range(torque.shape[0]):
        wanted = tau[i] + kp[i] * (q[i] - qpos[index[0, i]]) + kd[i] * (dq[i] - qvel[index[1, i]])
        sound = sound and math.isfinite(wanted) and kp[i] >= 0.0 and kd[i] >= 0.0
        before = 0.0 if anew else asked[i]
        asked[i] = max(before, abs(wanted))
        torque[i] = max(min(wanted, effort[i]), -effort[i])
        ctrl[index[2, i]] = torque[i]
    return sound


def read(state: tuple[Vector, Vector], index: tuple[Indices, Indices], q: Vector, v: Vector) -> None:
    """State in Pinocchio's convention.

    Args:
        state: ``qpos`` and ``qvel``.
        index: Where in them the entries of ``q`` and ``v`` are, (nq,) and (nv,).
        q: Out (nq,).
        v: Out (nv,); the base's linear velocity is turned from world to base.
    """
    qpos, qvel = state
    at_q, at_v = index
    for i in range(q.shape[0]):
        q[i] = qpos[at_q[i]]
    for i in range(v.shape[0]):
        v[i] = qvel[at_v[i]]
    # R' v = v + w t + t x r with t = 2 (v x r), r the vector part and w the scalar part of the quaternion.
    x, y, z, w = q[3], q[4], q[5], q[6]
    a, b, c = v[0], v[1], v[2]
    tx, ty, tz = 2.0 * (b * z - c * y), 2.0 * (c * x - a * z), 2.0 * (a * y - b * x)
    v[0] = a + w * tx + ty * z - tz * y
    v[1] = b + w * ty + tz * x - tx * z
    v[2] = c + w * tz + tx * y - ty * x
