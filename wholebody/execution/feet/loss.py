"""Whether a robot is lost without a step, and whether with one: by its capture point."""

from __future__ import annotations

from math import inf

import numpy as np

from wholebody.control.base import Controller
from wholebody.control.reference_packet import COM
from wholebody.execution.feet.walker import Walker
from wholebody.robot.kernels.pendulum import natural_frequency
from wholebody.robot.support_polygon import convex_polygon

LOST = 0.005
"""Distance of the capture point beyond the edge of both soles from which a step is taken [m]; chosen: on the edge,
motions of trunk and arms still bring it back."""
NEARLY, BESIDE = 0.02, 0.04
"""Distance of the capture point from the edge up to which it is near it, and from what is followed from which it is
beside that [m]; chosen: plans keep 4 cm from the edge and come there slowly."""
LONG, AGAIN = 0.2, 0.05
"""Times for which both may last before a step is taken, and before another one is [s]; measured: pushed by 13 N s at 45
degrees the robot stayed so for a second and fell over the other edge."""

FINAL, FINAL_STEPS = 0.03, 0.15
"""Distances of the capture point from which a robot is given up: beyond the edge of its soles where it takes no step,
of the soles as they will stand where it takes one [m]; measured: in pushes that are stood it stays inside without a
step, and comes 0.085 m beyond with one."""


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

    def planned(self, followed: np.ndarray) -> complex:
        """Capture point of a packed reference, ``x + iy`` [m]."""
        return complex(*(followed[COM : COM + 2] + followed[COM + 3 : COM + 5] / self._omega()))

    def look(self, planned: complex | None, now: float) -> bool:
        """Whether it is where no pressure on the soles brings it back, or has stayed near there for long.

        Args:
            planned: Where it is to be, ``x + iy`` [m]; None for a robot that has just been caught by a step.
            now: Present time [s].
        """
        point = self._point()
        margin = self._controller.support.margin(point)
        near = margin < NEARLY and (planned is None or abs(complex(*point) - planned) > BESIDE)
        self._since = min(self._since, now) if near else inf
        return margin < -LOST or now - self._since > (AGAIN if planned is None else LONG)

    def is_final(self, walker: Walker | None) -> bool:
        """Whether nothing brings the capture point back.

        Args:
            walker: Who leads the robot; None for one on both feet that no step catches.
        """
        support, point = self._controller.support, self._point()
        if walker is None or support.margin(point) >= -FINAL_STEPS:
            return walker is None and support.margin(point) < -FINAL
        return convex_polygon(walker.outline()).margin(point) < -FINAL_STEPS

    def _point(self) -> np.ndarray:
        robot = self._controller.robot
        return robot.com[:2] + robot.com_velocity[:2] / self._omega()

    def _omega(self) -> float:
        return natural_frequency(float(self._controller.robot.com[2]))
