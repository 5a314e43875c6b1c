"""The robot at one instant: everything the controller needs from Pinocchio, computed once per tick."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio
from models.spec import RobotSpec
from wholebody.errors import InputError
from wholebody.robot.hand_loads import HandLoads


class Robot:
    """Dynamics of one configuration and velocity.

    Call `update` once per tick; every other method reads what it computed. Frames are looked up once, by name.

    Legend: ``M`` mass matrix, ``nle`` Coriolis, centrifugal and gravity forces, ``J_x_lwa`` Jacobian of frame x with
    world-aligned axes at the frame's origin, ``drift_x`` the same frame's acceleration when ``dv = 0``.
    """

    def __init__(self, spec: RobotSpec) -> None:
        self.spec = spec
        self.model: pin.Model = load_pinocchio(spec)
        self._data, self._placed, self.loads = self.model.createData(), True, HandLoads(spec, self.model)
        self.nq, self.nv = self.model.nq, self.model.nv
        self.n_joints = self.nv - 6
        self.q = pin.neutral(self.model)
        self.v = np.zeros(self.nv)
        self._frame_ids: dict[str, int] = {}
        names = list(self.model.names[2:])
        self.joint_names: tuple[str, ...] = tuple(names)
        """Joints in Pinocchio order, shape (n_joints,)."""
        self.motor_to_pin = np.array([spec.joint_names.index(name) for name in names])
        """``x_pin = x_motor[motor_to_pin]``."""
        self.pin_to_motor = np.array([names.index(name) for name in spec.joint_names])
        """``x_motor = x_pin[pin_to_motor]``."""

    @property
    def mass(self) -> float:
        """Mass of the robot with what it carries [kg]."""
        return self.loads.total

    @cached_property
    def scratch(self) -> pin.Data:
        """Pinocchio data for passing computations in the control loop's thread, shared and overwritten; 5 MB."""
        return self.model.createData()

    def frame_id(self, name: str) -> int:
        """Index of a frame.

        Raises:
            InputError: If the robot has no frame of that name (Pinocchio itself would return ``nframes``).
        """
        if name not in self._frame_ids:
            index = self.model.getFrameId(name)
            if index >= self.model.nframes:
                known = sorted(f.name for f in self.model.frames if f.type == pin.FrameType.BODY)
                raise InputError(f"the robot has no frame '{name}'; bodies that exist: {', '.join(known)}")
            self._frame_ids[name] = index
        return self._frame_ids[name]

    def joint_indices(self, names: Sequence[str]) -> np.ndarray:
        """Positions of joints within the joint part of ``v`` (Pinocchio order), shape (len(names),).

        Raises:
            InputError: If a joint does not exist.
        """
        missing = [name for name in names if name not in self.joint_names]
        if missing:
            raise InputError(f"unknown joints {missing}; the robot has {', '.join(self.joint_names)}")
        return np.array([self.joint_names.index(name) for name in names], dtype=int)

    def arm_joints(self, side: str) -> list[str]:
        """Names of the joints of the arm of a side, its fingers left out."""
        arm = {self.spec.joint_names[i] for i in self.spec.limbs[f"{side}_arm"]}
        return [name for name in self.joint_names if name in arm]

    def update(self, q: np.ndarray, v: np.ndarray) -> None:
        """Compute kinematics and dynamics at ``q`` (nq,) and ``v`` (nv,), Pinocchio convention."""
        model, data, zero = self.model, self._data, np.zeros(self.nv)
        self.q, self.v, self._placed = q, v, True
        pin.forwardKinematics(model, data, q, v, zero)
        pin.updateFramePlacements(model, data)
        pin.computeJointJacobiansTimeVariation(model, data, q, v)
        pin.crba(model, data, q)
        mass_matrix = data.M
        self.M = np.triu(mass_matrix) + np.triu(mass_matrix, 1).T
        self.nle = pin.nonLinearEffects(model, data, q, v).copy()
        pin.computeCentroidalMomentumTimeVariation(model, data, q, v, zero)
        self.drift_momentum = np.concatenate([data.dhg.linear, data.dhg.angular])
        self.J_momentum = pin.ccrba(model, data, q, v).copy()
        self.momentum = np.concatenate([data.hg.linear, data.hg.angular])
        self.com = data.com[0].copy()
        self.com_velocity = self.momentum[:3] / self.mass
        self.J_com = self.J_momentum[:3] / self.mass
        self.drift_com = self.drift_momentum[:3] / self.mass

    def place(self, q: np.ndarray, v: np.ndarray) -> None:
        """Placements are those of ``q`` from now on, computed when first asked for; the rest is of the last `update`.

        Args:
            q: Configuration (nq,), which the caller does not change afterwards.
            v: Velocity (nv,), likewise.
        """
        self.q, self.v, self._placed = q, v, False

    @property
    def data(self) -> pin.Data:
        """Pinocchio's data, with the placements of ``q``."""
        if not self._placed:
            pin.forwardKinematics(self.model, self._data, self.q)
            pin.updateFramePlacements(self.model, self._data)
            self._placed = True
        return self._data

    def pose(self, frame: str) -> pin.SE3:
        """``T_world_frame``."""
        return self.data.oMf[self.frame_id(frame)]

    def jacobian(self, frame: str) -> np.ndarray:
        """``J_frame_lwa``, shape (6, nv): linear rows first."""
        return pin.getFrameJacobian(self.model, self.data, self.frame_id(frame), pin.LOCAL_WORLD_ALIGNED)

    def velocity(self, frame: str) -> np.ndarray:
        """``twist_frame_lwa``, shape (6,), [m/s, rad/s]."""
        return pin.getFrameVelocity(self.model, self.data, self.frame_id(frame), pin.LOCAL_WORLD_ALIGNED).vector

    def drift(self, frame: str) -> np.ndarray:
        """Classical acceleration of the frame for ``dv = 0``, shape (6,), [m/s^2, rad/s^2]."""
        motion = pin.getFrameClassicalAcceleration(self.model, self.data, self.frame_id(frame), pin.LOCAL_WORLD_ALIGNED)
        return motion.vector
