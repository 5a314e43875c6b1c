"""Whether a robot on both feet is lost without a step: by its capture point."""

from __future__ import annotations

from math import hypot, inf

import numpy as np

from wholebody.control.base import Controller
from wholebody.control.reference_packet import COM
from wholebody.robot.kernels.pendulum import natural_frequency

LOST = 0.005
"""Distance of the capture point beyond the edge of both soles from which a step is taken [m]; chosen: on the edge,
motions of trunk and arms still bring it back."""
NEARLY, BESIDE = 0.02, 0.04
"""Distance of the capture point from the edge up to which it is near it, and from what is followed from which it is
beside that [m]; chosen: plans keep 4 cm from the edge and come there slowly."""
LONG, AGAIN = 0.2, 0.05
"""Times for which both may last before a step is taken, and before another one is [s]; measured: pushed by 13 N s at 45
degrees the robot stayed so for a second and fell over the other edge."""


class Loss:
    """Looks at the capture point, tick by tick.

    Args:
        controller: Of the robot, on both feet.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller, self._since = controller, inf

    def forget(self) -> None:
        """Begin anew: a step is taken, or no foot stands for long."""
        self._since = inf

    def look(self, followed: np.ndarray | None, now: float) -> bool:
        """Whether it is where no pressure on the soles brings it back, or has stayed near there for long.

        Args:
            followed: Packed reference; None for a robot that has just been caught by a step.
            now: Present time [s].
        """
        robot = self._controller.robot
        omega = natural_frequency(float(robot.com[2]))
        point = robot.com[:2] + robot.com_velocity[:2] / omega
        margin = self._controller.support.margin(point)
        if followed is None:
            near, long = margin < NEARLY, AGAIN
        else:
            planned = followed[COM : COM + 2] + followed[COM + 3 : COM + 5] / omega
            near, long = margin < NEARLY and hypot(*(point - planned)) > BESIDE, LONG
        self._since = min(self._since, now) if near else inf
        return margin < -LOST or now - self._since > long
