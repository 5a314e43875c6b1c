"""From the answer to the joint command: the integrated desired state."""

from __future__ import annotations

from wholebody.jit.packed import Packed


def command(tick: Packed) -> None:
    """Integrate the accelerations into the desired state, and write the command in motor order.

    The desired state leaks towards the measured one and stays inside the joint limits; that of the fingers is their
    reference, since they press on what they hold.
    """
    q, v, dv, tau, desired, out = tick.q, tick.v, tick.dv, tick.tau, tick.desired, tick.command
    joints, reference, fingers, motors = tick.joint_limits, tick.posture_ref, tick.fingers, tick.motors
    dt, leak, n = tick.dt, tick.leak, tau.shape[0]
    for j in range(n):
        a, x, dx = dv[6 + j], desired[0, j], desired[1, j]
        desired[0, j] = x + dt * dx + 0.5 * dt * dt * a + leak[j] * (q[7 + j] - x)
        desired[1, j] = dx + dt * a + leak[j] * (v[6 + j] - dx)
    for k in range(fingers.shape[0]):
        j = fingers[k]
        desired[0, j], desired[1, j] = reference[0, j], reference[1, j]
    for j in range(n):
        desired[0, j] = min(max(desired[0, j], joints[0, j]), joints[1, j])
    for k in range(n):
        j = motors[k]
        out[0, k], out[1, k], out[2, k] = desired[0, j], desired[1, j], tau[j]
