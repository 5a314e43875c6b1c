"""From where the robot stands off any plan back to its stance, slowly: there every chunk can be planned for."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.planning.trajectory import SampledTrajectory
from wholebody.robot.state import Robot

SPEED = 0.5
"""Speed of the fastest joint, or of the trunk's turn, on the way back [rad/s]; chosen: a tenth of what plans use."""


class WayBack:
    """Straight from one target of a robot that stands to the stance, in joints, trunk and centre of mass.

    Legs cannot do all of it with both feet where they are: the whole-body program weighs what it asks for. The centre
    of mass counts most, and moves inside the soles from one end to the other.

    Args:
        robot: Its model.
        begin: Where it stands, one row.
        stance: Configuration, shape (nq,).
    """

    def __init__(self, robot: Robot, begin: SampledTrajectory, stance: np.ndarray) -> None:
        self._robot, self._begin = robot, begin
        self._trunk = [robot.frame_id(name) for name in (robot.spec.base_body, robot.spec.torso_body)]
        self._end = pin.centerOfMass(robot.model, robot.scratch, stance).copy()
        self._way = pin.difference(robot.model, begin.q[0], stance)
        self.seconds = float(np.abs(self._way[3:]).max()) / SPEED
        self._share = 0.0

    def advance(self, elapsed: float) -> SampledTrajectory:
        """Where to stand that much later [s], one row at rest; the stance at last."""
        self._share = min(self._share + elapsed / max(self.seconds, 1e-9), 1.0)
        robot, data, begin, share = self._robot, self._robot.scratch, self._begin, self._share
        q = pin.integrate(robot.model, begin.q[0], share * self._way)
        pin.framesForwardKinematics(robot.model, data, q)
        com, height, zero = begin.com.copy(), begin.height.copy(), np.zeros((1, 3))
        com[0, 0], height[0, 0] = begin.com[0, 0] + share * (self._end - begin.com[0, 0]), q[2]
        pelvis, torso = ((data.oMf[frame].rotation[None].copy(), zero, zero) for frame in self._trunk)
        return SampledTrajectory(
            begin.start, q[None], begin.v, begin.ddq, com, begin.momentum, height, pelvis, torso
        )  # fmt: skip
