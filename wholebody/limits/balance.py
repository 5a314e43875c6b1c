"""Keep the divergent component of motion and the centre of mass inside the support."""

from __future__ import annotations

import numpy as np

from wholebody.limits.base import Rows
from wholebody.robot.kernels.pendulum import natural_frequency
from wholebody.robot.state import Robot
from wholebody.robot.support_polygon import SupportPolygon


class CapturePointLimit:
    r"""The divergent component of motion (capture point) stays inside the shrunk support polygon.

    With ``xi = c + dc / omega`` and outward edge normal n: ``n . dxi <= gain (offset - margin - n . xi)``, a row in
    acceleration units through ``dxi = dc + ddc / omega``. While the centre of pressure can reach the edge itself, a
    point inside can always be kept inside. A force on a hand moves the centre of pressure that balances the robot: an
    edge towards which it does is nearer by what that is more than the margin.

    Args:
        margin: Distance kept from the support's edge [m].
        gain: Rate of approach allowed per metre of distance left [1/s].

    Source:
        Englsberger, Ott, Albu-Schaeffer 2015, "Three-Dimensional Bipedal Walking Control Based on Divergent Component
        of Motion", T-RO.
    """

    def __init__(self, *, margin: float, gain: float) -> None:
        self.margin, self.gain = margin, gain
        self.support: SupportPolygon | None = None
        self.active = True
        """Whether it has rows: not where a step is the answer to a capture point that leaves the support."""
        self.tipped = np.zeros(2)
        """How far the forces on the hands move the centre of pressure, shape (2,), [m]."""

    def rows(self, robot: Robot) -> Rows:
        """One row per edge of the support."""
        if self.support is None or not self.active:
            return Rows(np.zeros((0, robot.nv)), np.zeros(0), ())
        normals = self.support.normals
        omega = natural_frequency(robot.com[2])
        xi = robot.com[:2] + robot.com_velocity[:2] / omega
        left = self.support.offsets - self.margin - np.maximum(normals @ self.tipped - self.margin, 0.0) - normals @ xi
        upper = omega * (self.gain * left - normals @ robot.com_velocity[:2]) - normals @ robot.drift_com[:2]
        labels = tuple(f"balance.edge{i}" for i in range(len(left)))
        return Rows(normals @ robot.J_com[:2], upper, labels)
