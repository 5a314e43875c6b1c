"""Force and moment on the whole robot besides gravity and the floor's, from its momentum and the torques of its legs.

An arm feels little of a force along it. The floor feels all of them: what it gives is known from the torques of the
legs, and what the momentum changes by besides that and gravity is something else's, wherever it acts.

Source:
    De Luca, Albu-Schaeffer, Haddadin and Hirzinger 2006, "Collision detection and safe reaction with the DLR-III
    lightweight manipulator arm", IROS, for the momentum of the whole robot.
"""

from __future__ import annotations

from math import exp, inf

import numpy as np
import pinocchio as pin

from wholebody.robot.state import Robot
from wholebody.types import RobotState

EVERY = 0.05
"""Time from one look to the next [s]; chosen: a look takes as long as a tick, and bodies are slow."""
TIME_CONSTANT = 0.3
"""Of the filter [s]; chosen: steps of a lissajous are then feigned to move the pressure under the soles by 5 mm, those
of a realistic one by 14 mm."""
GAP_MAX = 0.2
"""Longest time between two looks over which it goes on [s]; chosen: two thirds of the filter's."""
DAMPING = 1e-8 * np.eye(6)
"""Of the least squares for what the floor gives [m^2, no unit]; chosen: 0.1 mm beside a bent leg's levers, squared,
and along a straight one nothing is felt."""


class BodyPush:
    """What pushes the robot besides gravity and the floor.

    Args:
        robot: Its model, with what its hands are taken to carry.

    Attributes:
        wrench: Force [N] and moment about the world's origin [N m], world axes, shape (6,).
    """

    def __init__(self, robot: Robot) -> None:
        spec, self._robot = robot.spec, robot
        legs = [
            robot.joint_indices([spec.joint_names[i] for i in spec.limbs[f"{foot.side}_leg"]]) for foot in spec.feet
        ]
        self._legs = [(robot.frame_id(foot.frame), 6 + leg) for foot, leg in zip(spec.feet, legs, strict=True)]
        self.reset()

    def reset(self) -> None:
        """Nothing pushes it."""
        self.wrench, self._momentum, self._before = np.zeros(6), np.zeros(6), -inf

    def look(self, state: RobotState) -> bool:
        """Take in a state; whether `wrench` is another one now."""
        elapsed = state.time - self._before
        if state.tau is None or 0.0 <= elapsed < EVERY - 1e-9:
            return False
        given, momentum = self._of(state)
        if 0.0 < elapsed <= GAP_MAX:
            keep = exp(-elapsed / TIME_CONSTANT)
            self.wrench = keep * self.wrench + (1.0 - keep) * ((momentum - self._momentum) / elapsed - given)
        else:
            self.wrench = np.zeros(6)
        self._momentum, self._before = momentum, state.time
        return True

    def _of(self, state: RobotState) -> tuple[np.ndarray, np.ndarray]:
        """Wrench of gravity and floor, and momentum, both about the world's origin, shape (6,) each."""
        robot, q, v = self._robot, state.q, state.v
        model, data = robot.model, robot.scratch
        nle = pin.nonLinearEffects(model, data, q, v)
        pin.computeJointJacobians(model, data, q)
        momentum = pin.computeCentroidalMomentum(model, data, q, v)
        com, weight = data.com[0], robot.mass * model.gravity.linear
        given = np.concatenate([weight, pin.skew(com) @ weight])
        for frame, leg in self._legs:
            p = pin.updateFramePlacement(model, data, frame).translation
            J = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)[:, leg]
            # The legs' own accelerations are those of feet that stand, none.
            floor = np.linalg.solve(J @ J.T + DAMPING, J @ (nle[leg] - state.tau[leg - 6]))
            given += np.concatenate([floor[:3], floor[3:] + pin.skew(p) @ floor[:3]])
        linear = momentum.linear
        return given, np.concatenate([linear, momentum.angular + pin.skew(com) @ linear])
