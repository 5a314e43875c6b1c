"""The one place where MuJoCo's and Pinocchio's conventions meet.

=========================  ==============================  ==========================
quantity                   MuJoCo                          Pinocchio
=========================  ==============================  ==========================
base orientation           quaternion wxyz                 quaternion xyzw
base linear velocity       in world                        in base
base angular velocity      in base                         in base
base linear acceleration   second derivative in world      spatial, in base
joint order                order of the URDF               siblings sorted by name
=========================  ==============================  ==========================

With ``R`` the rotation of the base in world, ``v_lin`` and ``w`` the base velocity in base:

    v_mj_lin = R v_lin,   a_mj_lin = R (a_lin + w x v_lin),   f_pin = T^T f_mj,   T = blkdiag(R, I).
"""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin

from models.mujoco_model import BASE_JOINT
from models.spec import RobotSpec, RobotSpecError


class Conversion:
    """Index maps between one Pinocchio model, one MuJoCo model and motor order, computed once.

    Legend: ``qpos, qvel, qacc`` MuJoCo, whole scene; ``q, v, a`` Pinocchio, robot only; ``x_motor`` motor order.

    Args:
        spec: The robot of both models.
        model: Pinocchio model.
        mj_model: MuJoCo model; other bodies in the scene are left alone.

    Raises:
        RobotSpecError: If a joint is missing in either model.
    """

    def __init__(self, spec: RobotSpec, model: pin.Model, mj_model: mujoco.MjModel) -> None:
        base = _mj_joint(mj_model, BASE_JOINT)
        qpos_base, qvel_base = int(mj_model.jnt_qposadr[base]), int(mj_model.jnt_dofadr[base])
        names = list(model.names)[2:]
        joints = [_mj_joint(mj_model, name) for name in names]
        # Pinocchio's xyzw out of MuJoCo's wxyz.
        quat = [qpos_base + offset for offset in (4, 5, 6, 3)]
        position = list(range(qpos_base, qpos_base + 3))
        self.qpos_index = np.array(position + quat + [int(mj_model.jnt_qposadr[j]) for j in joints])
        """``q = qpos[qpos_index]``."""
        twist = list(range(qvel_base, qvel_base + 6))
        self.qvel_index = np.array(twist + [int(mj_model.jnt_dofadr[j]) for j in joints])
        """``qvel[qvel_index]`` is in Pinocchio order, its base part still in MuJoCo's frames."""
        self.motor_to_pin = motor_to_pin(spec, model)
        """``x_pin = x_motor[motor_to_pin]`` for joint arrays."""
        self.pin_to_motor = np.argsort(self.motor_to_pin)
        """``x_motor = x_pin[pin_to_motor]`` for joint arrays."""
        self.motor_qpos_index = self.qpos_index[7:][self.pin_to_motor]
        """``qpos[motor_qpos_index]`` are the joint angles in motor order."""
        self.motor_qvel_index = self.qvel_index[6:][self.pin_to_motor]
        """``qvel[motor_qvel_index]`` are the joint speeds in motor order."""
        self.actuator_index = np.array([_mj_actuator(mj_model, name) for name in spec.joint_names])
        """``ctrl[actuator_index] = x_motor``."""

    def to_pinocchio(self, qpos: np.ndarray, qvel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """``(q, v)`` of a MuJoCo state; quaternions must be of unit length."""
        q, v = qpos[self.qpos_index], qvel[self.qvel_index]
        v[:3] = rotate_inverse(q[3:7].tolist(), v[:3].tolist())
        return q, v

    def to_mujoco(self, q: np.ndarray, v: np.ndarray, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Write a Pinocchio state into the robot's part of ``qpos`` and ``qvel``; the rest is not touched."""
        qpos[self.qpos_index] = q
        world = v.copy()
        world[:3] = rotate(q[3:7].tolist(), v[:3].tolist())
        qvel[self.qvel_index] = world

    def acceleration_to_mujoco(self, q: np.ndarray, v: np.ndarray, a: np.ndarray, qacc: np.ndarray) -> None:
        """Write the acceleration ``a`` at ``(q, v)`` into the robot's part of ``qacc``."""
        world = a.copy()
        world[:3] = rotate(q[3:7].tolist(), (a[:3] + np.cross(v[3:6], v[:3])).tolist())
        qacc[self.qvel_index] = world

    def acceleration_to_pinocchio(self, q: np.ndarray, v: np.ndarray, qacc: np.ndarray) -> np.ndarray:
        """Pinocchio acceleration, shape (nv,), of a MuJoCo acceleration at ``(q, v)``."""
        a = qacc[self.qvel_index]
        a[:3] = rotate_inverse(q[3:7].tolist(), a[:3].tolist())
        a[:3] -= np.cross(v[3:6], v[:3])
        return a

    def force_to_pinocchio(self, q: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Generalised force (``qfrc_*``) in Pinocchio's coordinates, shape (nv,), [N, N m]."""
        f = force[self.qvel_index]
        f[:3] = rotate_inverse(q[3:7].tolist(), f[:3].tolist())
        return f

    def force_to_mujoco(self, q: np.ndarray, f: np.ndarray, force: np.ndarray) -> None:
        """Write a generalised force in Pinocchio's coordinates into the robot's part of ``force``."""
        world = f.copy()
        world[:3] = rotate(q[3:7].tolist(), f[:3].tolist())
        force[self.qvel_index] = world

    def mass_matrix_to_pinocchio(self, q: np.ndarray, mass_matrix: np.ndarray) -> np.ndarray:
        """``T^T M T`` of a full MuJoCo mass matrix (from ``mj_fullM``), robot part, shape (nv, nv)."""
        M = mass_matrix[np.ix_(self.qvel_index, self.qvel_index)]
        R = rotation_matrix(q[3:7].tolist())
        M[:3] = R.T @ M[:3]
        M[:, :3] = M[:, :3] @ R
        return M

    def bias_to_pinocchio(self, q: np.ndarray, v: np.ndarray, bias: np.ndarray, mass_matrix: np.ndarray) -> np.ndarray:
        """Pinocchio's ``nle`` of MuJoCo's ``qfrc_bias``, shape (nv,).

        Both are the force for zero acceleration, but zero means something else in each: the difference is
        ``M [w x v_lin; 0]``.

        Args:
            q: Configuration.
            v: Velocity.
            bias: ``qfrc_bias``.
            mass_matrix: Full MuJoCo mass matrix.
        """
        f = self.force_to_pinocchio(q, bias)
        M = self.mass_matrix_to_pinocchio(q, mass_matrix)
        return f + M[:, :3] @ np.cross(v[3:6], v[:3])


def motor_to_pin(spec: RobotSpec, model: pin.Model) -> np.ndarray:
    """Index array with ``x_pin = x_motor[motor_to_pin]``, shape (n_joints,).

    Raises:
        RobotSpecError: If the model has a joint the spec lacks.
    """
    return spec.indices(list(model.names)[2:])


def rotate(quat_xyzw: list[float], vector: list[float]) -> tuple[float, float, float]:
    """``R vector``; plain floats, because numpy needs ten times as long for three numbers.

    Args:
        quat_xyzw: Unit quaternion of ``R``.
        vector: Three numbers.
    """
    x, y, z, w = quat_xyzw
    a, b, c = vector
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx


def rotate_inverse(quat_xyzw: list[float], vector: list[float]) -> tuple[float, float, float]:
    """``R^T vector``; see `rotate`."""
    x, y, z, w = quat_xyzw
    return rotate([-x, -y, -z, w], vector)


def rotation_matrix(quat_xyzw: list[float]) -> np.ndarray:
    """``R``, shape (3, 3), of a unit quaternion."""
    return np.array([rotate(quat_xyzw, axis) for axis in ([1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0])]).T


def _mj_joint(mj_model: mujoco.MjModel, name: str) -> int:
    index = mujoco.mj_name2id(mj_model, mujoco.mjtObj.mjOBJ_JOINT, name)
    if index < 0:
        known = ", ".join(mj_model.joint(i).name for i in range(mj_model.njnt))
        raise RobotSpecError(f"the MuJoCo model has no joint '{name}'; joints: {known}")
    return index


def _mj_actuator(mj_model: mujoco.MjModel, name: str) -> int:
    index = mujoco.mj_name2id(mj_model, mujoco.mjtObj.mjOBJ_ACTUATOR, name)
    if index < 0:
        raise RobotSpecError(f"the MuJoCo model has no actuator '{name}'; load it with models.mujoco_model.load_mujoco")
    return index
