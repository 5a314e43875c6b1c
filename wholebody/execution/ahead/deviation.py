"""Where a robot that is off its plan will be a little later, if it follows on."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from wholebody.config import TrajectoryConfig
from wholebody.reference import HandMotion
from wholebody.robot.state import Robot

GAUSS_NEWTON_STEPS = 3
"""Gauss-Newton steps that put a wrist back: in the median of random cases, 26 mm become 1.6, then 0.02, then 0."""
DAMPING = 1e-4
"""Damping of a step, added to ``J J^T`` [m^2, rad^2]; chosen: a straight arm moves little in its singular direction."""
RATE_DAMPING = 1e-3
"""Damping of a velocity [m^2, rad^2]; measured: with 1e-4 plans begin faster than joints may be, with 1e-2 palms lag
behind."""

BEGIN_SPEED = 0.55
"""Share of the fastest that plans let a joint be with which an arm begins one; measured: faster ones are past a limit
before they have braked."""
WRIST_WEIGHT = 1.0 / 3.0
"""Weight of the distance of a wrist joint from the plan; chosen: little mass hangs on it."""


class Deviation:
    """Carries the distance of the robot from its plan along.

    Every joint stays as far off the plan as it is. In another posture the same angles move a wrist elsewhere, within a
    tenth of a second of a fast motion by centimetres: arms are bent until each wrist is as far off its plan as it is.

    Args:
        robot: Its model.
        config: What a plan that begins there may ask of joints.
    """

    def __init__(self, robot: Robot, config: TrajectoryConfig) -> None:
        self._model, self._data = robot.model, robot.scratch
        self._wrists = [robot.frame_id(tool.wrist_frame) for tool in robot.spec.tools]
        chains = [set(self._model.supports[self._model.frames[wrist].parentJoint]) for wrist in self._wrists]
        shared = set.intersection(*chains)
        self._arms = [[self._model.idx_vs[joint] for joint in sorted(chain - shared)] for chain in chains]
        # A free-flyer has one more position than velocities.
        self._low = self._model.lowerPositionLimit[1:] + config.joint_margin
        self._high = self._model.upperPositionLimit[1:] - config.joint_margin
        self._fastest = BEGIN_SPEED * config.speed_share * self._model.velocityLimit

    def carried(self, present: np.ndarray, later: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Configuration (nq,) at a time to come.

        Args:
            present: What is planned now, shape (nq,).
            later: What is planned then, shape (nq,).
            q: Where the robot is now, shape (nq,).
        """
        model = self._model
        planned, are, then = (self._poses(x) for x in (present, q, later))
        goals = [c * a.inverse() * b for a, b, c in zip(planned, are, then, strict=True)]
        return self._bent(pin.integrate(model, later, pin.difference(model, present, q)), goals)

    def reaching(self, q: np.ndarray, v: np.ndarray, hands: HandMotion) -> tuple[np.ndarray, np.ndarray]:
        """Configuration (nq,) and velocity (nv,) whose arms move the wrists as hands are commanded, as far as they may.

        Args:
            q: The configuration otherwise, shape (nq,).
            v: Its velocity, shape (nv,).
            hands: Motions of the left and the right hand, rows (2, 40).
        """
        model, data, v = self._model, self._data, v.copy()
        q = self._bent(q, [pin.SE3(T) for T in hands.T_world_hand])
        for arm in self._arms:
            q[7:][np.array(arm) - 6] = np.clip(q[7:][np.array(arm) - 6], self._low[arm], self._high[arm])
        pin.computeJointJacobians(model, data, q)
        for wrist, arm, linear, angular in zip(self._wrists, self._arms, hands.v, hands.w, strict=True):
            J = pin.getFrameJacobian(model, data, wrist, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            lacking, J = np.concatenate([linear, angular]) - J @ v, J[:, arm]
            rates = v[arm] + J.T @ np.linalg.solve(J @ J.T + RATE_DAMPING * np.eye(6), lacking)
            v[arm] = np.clip(rates, -self._fastest[arm], self._fastest[arm])
        return q, v

    def of_hands(self, planned: np.ndarray, q: np.ndarray) -> float:
        """Distance of the further wrist of a configuration (nq,) from where it is in a planned one [m]."""
        pairs = zip(self._poses(planned), self._poses(q), strict=True)
        return max(float(np.linalg.norm(a.translation - b.translation)) for a, b in pairs)

    def _bent(self, q: np.ndarray, goals: list[pin.SE3]) -> np.ndarray:
        """A configuration (nq,) with arms that take the wrists to these poses in world."""
        model, data = self._model, self._data
        for _ in range(GAUSS_NEWTON_STEPS):
            poses, step = self._poses(q), np.zeros(model.nv)
            for wrist, arm, T, goal in zip(self._wrists, self._arms, poses, goals, strict=True):
                J = pin.computeFrameJacobian(model, data, q, wrist, pin.ReferenceFrame.LOCAL)[:, arm]
                error = pin.log6(T.actInv(goal)).vector
                step[arm] = J.T @ np.linalg.solve(J @ J.T + DAMPING * np.eye(6), error)
            q = pin.integrate(model, q, step)
        return q

    def _poses(self, q: np.ndarray) -> list[pin.SE3]:
        """Poses of both wrists in world."""
        pin.framesForwardKinematics(self._model, self._data, q)
        return [self._data.oMf[wrist].copy() for wrist in self._wrists]


def joint_weights(spec: RobotSpec) -> np.ndarray:
    """Weight of each joint's distance from the plan, by the mass that it moves, shape (n_joints,), motor order."""
    return np.where(spec.is_finger, 0.0, np.where(spec.parts("wrist"), WRIST_WEIGHT, 1.0))
