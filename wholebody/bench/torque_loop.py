"""The closed loop of a standing robot, linearised at its motors: the bandwidth and delay at which it is stable."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import pinocchio as pin

from wholebody.control.controller import WholeBodyController
from wholebody.control.reference_packet import PackedReference
from wholebody.errors import InputError
from wholebody.robot.second_order import second_order_step
from wholebody.sim.plant import MujocoPlant
from wholebody.types import RobotState

DIFFERENCE_STEP, TORQUE_STEP = 2e-5, 1e-3
"""Steps of the central differences: of states [rad, rad/s, m, m/s] and of torques [N m]; chosen: the answers of program
and physics are the same to 1e-6 with steps half and twice as large."""
AT_REST_CHANGE = 3e-3
"""Largest change of the state in a tick at which a robot counts as at rest [rad, m; per s]; chosen: eight times what a
stance has left after 2 s."""
EIGENVALUE_MAX = 1.0 + 1e-4
"""Largest magnitude of an eigenvalue up to which a loop counts as stable [no unit]; chosen: soles creep, and where they
stand nothing pulls back, so that eigenvalues at 1 are exact to 3e-6; 1.0001 doubles in 14 s."""
DENSE = 400
"""Size from which only the largest eigenvalues are computed [states]; chosen: all of them take a second there."""


@dataclass(frozen=True, kw_only=True)
class Motors:
    """How every motor answers; at once by default.

    Attributes:
        bandwidth: Natural frequency of torques that are of second order, 0 for none [Hz].
        damping: Its damping ratio.
        lag: Time constant of torques that are of first order [s].
        delay: Of commands, the position loop of a motor leaves out [control periods].
        feed_forward: Share of commanded torques that is added.
        phase: By which every torque is turned [rad], for a phase margin.
        delivered: Share of its torque that each delivers, motor order, (n,) or one for all.
    """

    bandwidth: float = 0.0
    damping: float = 0.5
    lag: float = 0.0
    delay: int = 0
    feed_forward: float = 1.0
    phase: float = 0.0
    delivered: np.ndarray | float = 1.0


@dataclass(frozen=True)
class TorqueLoop:
    """State ``x`` after a tick, for torques ``u`` (n,): ``x' = A x + B u``, ``u = motors(commanded x, own x)``.

    ``x`` is the difference from rest of the robot's configuration and velocity and of the controller's desired
    positions and speeds, (2 nv + 2 n,).

    Attributes:
        A: Robot and controller, their torques at rest (N, N).
        B: What torques do in a tick (N, n).
        commanded: Feed-forward torques (n, N) and what position loops add for the commanded state (n, N).
        own: What position loops add for the state that motors see themselves (n, N).
        dt: Control period [s].
        joints: Names in the order of the desired state.
    """

    A: np.ndarray
    B: np.ndarray
    commanded: tuple[np.ndarray, np.ndarray]
    own: np.ndarray
    dt: float
    joints: tuple[str, ...]

    def closed(self, motors: Motors) -> np.ndarray:
        """Matrix of the closed loop, with the states of the motors after those of ``x``."""
        N, n = self.B.shape
        first, second, late = n * (motors.lag > 0.0), 2 * n * (motors.bandwidth > 0.0), n * motors.delay
        M = np.zeros((N + late + first + second,) * 2, dtype=complex if motors.phase else float)
        M[:N, :N] = self.A
        commanded, signal, at = motors.feed_forward * self.commanded[0] + self.commanded[1], np.zeros((n, len(M))), N
        signal[:, :N] = self.own
        if late:
            M[at + n : at + late, at : at + late - n] = np.eye(late - n)
            M[at : at + n, :N] = commanded
            signal[:, at + late - n : at + late] += np.eye(n)
        else:
            signal[:, :N] += commanded
        at += late
        if first:
            share = 1.0 - np.exp(-self.dt / motors.lag)
            M[at : at + n] = share * signal
            M[at : at + n, at : at + n] += (1.0 - share) * np.eye(n)
            signal, at = M[at : at + n].copy(), at + n
        if second:
            step, given = second_order_step(2.0 * np.pi * motors.bandwidth, motors.damping, self.dt)
            M[at:, at:] = np.kron(step, np.eye(n))
            M[at:] += np.kron(given[:, None], np.eye(n)) @ signal
            signal = M[at : at + n].copy()
        turned = np.exp(-1j * motors.phase) if motors.phase else 1.0
        M[:N] += self.B @ (turned * np.reshape(motors.delivered, (-1, 1)) * signal)
        return M

    def radius(self, motors: Motors) -> float:
        """Largest magnitude of an eigenvalue: above `EIGENVALUE_MAX` the robot shakes itself down."""
        return float(np.abs(self._modes(motors)[0]).max())

    def stands(self, motors: Motors) -> bool:
        """Whether the loop is stable."""
        return self.radius(motors) <= EIGENVALUE_MAX

    def worst(self, motors: Motors) -> tuple[float, float, str]:
        """Magnitude and frequency [Hz] of the least stable mode, and the joint that moves most in it."""
        values, vectors = self._modes(motors)
        i, n = int(np.abs(values).argmax()), len(self.joints)
        speeds = np.abs(vectors[len(self.A) - 3 * n : len(self.A) - 2 * n, i])
        return (
            float(abs(values[i])),
            float(abs(np.angle(values[i])) / (2 * np.pi * self.dt)),
            self.joints[speeds.argmax()],
        )

    def phase_margin(self, motors: Motors | None = None) -> float:
        """Largest phase that all torques may lag behind at every frequency, to 0.5 degrees, at most 90 [deg]."""
        motors, low, high = motors or Motors(), 0.0, 90.0
        if not self.stands(motors):
            return 0.0
        while high - low > 0.5:
            middle = 0.5 * (low + high)
            turned = Motors(**(vars(motors) | {"phase": np.deg2rad(middle)}))
            low, high = (middle, high) if self.stands(turned) else (low, middle)
        return low

    def _modes(self, motors: Motors) -> tuple[np.ndarray, np.ndarray]:
        """Largest eigenvalues and their vectors."""
        M = self.closed(motors)
        if len(M) <= DENSE:
            return np.linalg.eig(M)
        from scipy.sparse import csr_matrix  # neither comes with the package's start
        from scipy.sparse.linalg import eigs

        return eigs(csr_matrix(M), k=3, which="LM", ncv=60, tol=1e-4, v0=np.ones(len(M)))


def linearised(controller: WholeBodyController, plant: MujocoPlant, reference: np.ndarray) -> TorqueLoop:
    """The loop of a robot that is at rest in a plant, by central differences; the plant is another one afterwards.

    Args:
        controller: After a tick at rest.
        plant: Stepped once a control period.
        reference: Packed, of the last tick.

    Raises:
        InputError: If the robot is not at rest.
    """
    state, model, n = plant.state(), controller.robot.model, controller.robot.n_joints
    nv, order, packed = len(state.v), controller.robot.pin_to_motor, PackedReference(reference.copy())
    desired = np.concatenate([controller.q_des, controller.dq_des])
    N = 2 * nv + 2 * n
    own = np.zeros((n, N))
    own[np.arange(n), 6 + order], own[np.arange(n), nv + 6 + order] = -controller.kp, -controller.kd

    def moved(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return pin.integrate(model, state.q, x[:nv]), x[nv : 2 * nv].copy()

    def commanded(x: np.ndarray) -> np.ndarray:
        """Feed-forward torques, torques of the commanded state, and desired state after a tick."""
        controller.q_des[:], controller.dq_des[:] = np.split(desired + x[2 * nv :], 2)
        c, _ = controller.step(RobotState(state.time, *moved(x)), packed)
        after = np.concatenate([controller.q_des, controller.dq_des]) - desired
        return np.concatenate([c.tau, c.kp * c.q + c.kd * c.dq, after])

    warm, data = plant.data.qacc_warmstart.copy(), plant.data
    plant.model.opt.tolerance, plant.model.opt.iterations = 1e-14, 200

    def physics(x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Configuration and velocity after a tick."""
        plant._conversion.to_mujoco(*moved(x), data.qpos, data.qvel)
        data.qacc_warmstart[:], data.ctrl[plant._conversion.actuator_index] = warm, u
        mujoco.mj_step(plant.model, data)
        after = MujocoPlant.state(plant)
        return np.concatenate([pin.difference(model, state.q, after.q), after.v])

    rest = np.zeros(N)
    at_rest = commanded(rest)
    torques = at_rest[:n] + at_rest[n : 2 * n] + own[:, 6 + order] @ state.q[7:][order]
    drift = np.abs(physics(rest, torques)).max()
    if not drift <= AT_REST_CHANGE:
        raise InputError(f"the robot moves by {drift:.1e} in a tick; linearised at rest, at most {AT_REST_CHANGE:g}")
    A, B, rows = np.zeros((N, N)), np.zeros((N, n)), np.zeros((2 * n, N))
    for i, unit in enumerate(DIFFERENCE_STEP * np.eye(N)):
        change = (commanded(unit) - commanded(-unit)) / (2.0 * DIFFERENCE_STEP)
        rows[:, i], A[2 * nv :, i] = change[: 2 * n], change[2 * n :]
        if i < 2 * nv:
            A[: 2 * nv, i] = (physics(unit, torques) - physics(-unit, torques)) / (2.0 * DIFFERENCE_STEP)
    for i, unit in enumerate(TORQUE_STEP * np.eye(n)):
        B[: 2 * nv, i] = (physics(rest, torques + unit) - physics(rest, torques - unit)) / (2.0 * TORQUE_STEP)
    joints = tuple(controller.robot.joint_names)
    return TorqueLoop(A, B, (rows[:n], rows[n:]), own, controller.config.dt, joints)
