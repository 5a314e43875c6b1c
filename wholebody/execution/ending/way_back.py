"""From where the robot stands off any plan back to its stance, slowly: there every chunk can be planned for."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.planning.trajectory import SampledTrajectory
from wholebody.robot.state import Robot

SPEED_BACK = 0.5
"""Speed of the fastest joint, or of the trunk's turn, on the way back [rad/s]; chosen: a tenth of what plans use."""


class WayBack:
    """Way from one target of a robot that stands to the stance, in joints, trunk and centre of mass.

    Legs cannot do all of it with both feet where they are: the whole-body program weighs what it asks for. The centre
    of mass counts most, and moves inside the soles from one end to the other.

    Args:
        robot: Its model.
        begin: Where it stands, one row.
        stance: Configuration, shape (nq,).
        straight: Whether all that moves arrives at once. Otherwise each joint and the trunk are as fast as they may be.
    """

    def __init__(self, robot: Robot, begin: SampledTrajectory, stance: np.ndarray, *, straight: bool = True) -> None:
        self._robot, self._begin, self.straight = robot, begin, straight
        self._trunk = [robot.frame_id(name) for name in (robot.spec.base_body, robot.spec.torso_body)]
        self._end = pin.centerOfMass(robot.model, robot.scratch, stance).copy()
        self._way = pin.difference(robot.model, begin.q[0], stance)
        self.seconds = float(np.abs(self._way[3:]).max()) / SPEED_BACK
        self._share = 0.0

    @property
    def is_over(self) -> bool:
        """Whether all of it has been gone."""
        return self._share >= 1.0

    def posture(self, later: float) -> np.ndarray:
        """Configuration that much later [s], shape (nq,)."""
        share = self._later(later)
        way = share * self._way
        if not self.straight:
            done = share * self.seconds * SPEED_BACK
            way[:6] = self._way[:6] * min(done / max(np.linalg.norm(self._way[3:6]), 1e-9), 1.0)
            way[6:] = np.clip(self._way[6:], -done, done)
        return pin.integrate(self._robot.model, self._begin.q[0], way)

    def _later(self, elapsed: float) -> float:
        return min(self._share + elapsed / max(self.seconds, 1e-9), 1.0)

    def advance(self, elapsed: float) -> SampledTrajectory:
        """Where to stand that much later [s], one row at rest; the stance at last."""
        self._share = self._later(elapsed)
        robot, data, begin, share = self._robot, self._robot.scratch, self._begin, self._share
        q = self.posture(0.0)
        pin.framesForwardKinematics(robot.model, data, q)
        com, height, zero = begin.com.copy(), begin.height.copy(), np.zeros((1, 3))
        com[0, 0], height[0, 0] = begin.com[0, 0] + share * (self._end - begin.com[0, 0]), q[2]
        pelvis, torso = ((data.oMf[frame].rotation[None].copy(), zero, zero) for frame in self._trunk)
        return SampledTrajectory(
            begin.start, q[None], begin.v, begin.ddq, com, begin.momentum, height, pelvis, torso
        )  # fmt: skip
