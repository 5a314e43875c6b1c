"""Forces on an arm that are the robot's own: of its other bodies, and of the ends of its joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wholebody.control.base import Controller

OWN = -0.005
"""Room of a pair of the robot's own bodies below which they touch [m]; derived: the program keeps 8 mm between them,
and hulls are known to a millimetre."""
END = 0.01
"""Distance from the end of its range below which a joint may be at its stop [rad]; chosen: encoders are off by some
mrad, and plans keep 0.08 rad away."""


class OwnForces:
    """Says whether what pushes an arm may be none of the world's.

    Args:
        controller: Of the robot.
        arms: Joints of the left and the right arm, counted without the base.
    """

    def __init__(self, controller: Controller, arms: Sequence[np.ndarray]) -> None:
        self._controller, robot, self._arms = controller, controller.robot, arms
        fingers = [robot.joint_indices(tool.finger_joints) for tool in robot.spec.tools]
        # Body 0 is the base, the others belong to the joints.
        self._bodies = [1 + np.concatenate(parts) for parts in zip(arms, fingers, strict=True)]
        # A free-flyer has one more position than velocities.
        self._low, self._high = robot.model.lowerPositionLimit[7:] + END, robot.model.upperPositionLimit[7:] - END

    def on(self, hand: int) -> bool:
        """Whether an arm touches another part of the robot."""
        tick = self._controller.compiled.tick
        near = tick.pairs[: tick.n_pairs, 9] < OWN
        return bool(near.any() and np.isin(tick.pair_body[: tick.n_pairs][near], self._bodies[hand]).any())

    def at_stop(self, hand: int) -> bool:
        """Whether a joint of an arm is at the end of its range."""
        arm = self._arms[hand]
        q = self._controller.robot.q[7:][arm]
        return bool(((q < self._low[arm]) | (q > self._high[arm])).any())
