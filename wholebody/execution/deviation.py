"""Where a robot that is off its plan will be a little later, if it follows on."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.robot.state import Robot

STEPS = 3
"""Gauss-Newton steps that put a wrist back: in the median of random cases, 26 mm become 1.6, then 0.02, then 0."""
DAMPING = 1e-4
"""Of a step, added to ``J J^T`` [m^2, rad^2]; chosen: a straight arm moves little in its singular direction."""


class Deviation:
    """Carries the distance of the robot from its plan along.

    Every joint stays as far off the plan as it is. In another posture the same angles move a wrist elsewhere, within a
    tenth of a second of a fast motion by centimetres: arms are bent until each wrist is as far off its plan as it is.

    Args:
        robot: Its model.
    """

    def __init__(self, robot: Robot) -> None:
        self._model, self._data = robot.model, robot.scratch
        self._wrists = [robot.frame_id(tool.wrist_frame) for tool in robot.spec.tools]
        chains = [set(self._model.supports[self._model.frames[wrist].parentJoint]) for wrist in self._wrists]
        shared = set.intersection(*chains)
        self._arms = [[self._model.idx_vs[joint] for joint in sorted(chain - shared)] for chain in chains]

    def carried(self, present: np.ndarray, later: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Configuration (nq,) at a time to come.

        Args:
            present: What is planned now, shape (nq,).
            later: What is planned then, shape (nq,).
            q: Where the robot is now, shape (nq,).
        """
        model, data = self._model, self._data
        found = pin.integrate(model, later, pin.difference(model, present, q))
        planned, are, then = (self._poses(x) for x in (present, q, later))
        goals = [c * a.inverse() * b for a, b, c in zip(planned, are, then, strict=True)]
        for _ in range(STEPS):
            poses, step = self._poses(found), np.zeros(model.nv)
            for wrist, arm, T, goal in zip(self._wrists, self._arms, poses, goals, strict=True):
                J = pin.computeFrameJacobian(model, data, found, wrist, pin.ReferenceFrame.LOCAL)[:, arm]
                error = pin.log6(T.actInv(goal)).vector
                step[arm] = J.T @ np.linalg.solve(J @ J.T + DAMPING * np.eye(6), error)
            found = pin.integrate(model, found, step)
        return found

    def of_hands(self, planned: np.ndarray, q: np.ndarray) -> float:
        """Distance of the further wrist of a configuration (nq,) from where it is in a planned one [m]."""
        pairs = zip(self._poses(planned), self._poses(q), strict=True)
        return max(float(np.linalg.norm(a.translation - b.translation)) for a, b in pairs)

    def _poses(self, q: np.ndarray) -> list[pin.SE3]:
        """Poses of both wrists in world."""
        pin.framesForwardKinematics(self._model, self._data, q)
        return [self._data.oMf[wrist].copy() for wrist in self._wrists]
