"""Gains with which a robot that cannot see stands: legs whose own position loops carry it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.spec import RobotSpec
from wholebody.types import JointCommand

KP, KD = 200.0, 5.0
"""Least stiffness [N m/rad] and damping [N m s/rad] of legs and waist; derived: two ankles of 112 N m/rad carry the
225 N m/rad of the weight over them, and what real legs are led with is 150 to 250."""
STIFFEN, SOFTEN = 0.1, 0.5
"""Times in which gains become stiff, and soft again [s]; chosen: the first while the plan is brought to a stop."""


class StiffLegs:
    """Makes legs stiff, and soft again.

    Args:
        spec: The robot.

    Attributes:
        share: How stiff they are, 0 to 1.
    """

    def __init__(self, spec: RobotSpec) -> None:
        self._carries = np.zeros(spec.n_joints, dtype=bool)
        for limb in ("left_leg", "right_leg", "waist"):
            self._carries[spec.limbs[limb]] = True
        self.reset()

    def reset(self) -> None:
        """They are soft."""
        self.share = 0.0

    def stiffened(self, command: JointCommand, stiff: bool, elapsed: float) -> JointCommand:
        """A command with the gains of now, itself while they are soft; ``elapsed`` since the last one [s]."""
        self.share += elapsed / STIFFEN if stiff else -elapsed / SOFTEN
        self.share = min(max(self.share, 0.0), 1.0)
        if self.share == 0.0:
            return command
        gains = ((command.kp, KP), (command.kd, KD))
        kp, kd = (gain + self.share * self._carries * np.maximum(least - gain, 0.0) for gain, least in gains)
        return replace(command, kp=kp, kd=kd)
