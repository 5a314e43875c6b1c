"""Commands for motors that are to be led by positions: torques told to the position loops as offsets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.spec import RobotSpec
from wholebody.types import JointCommand


class TorqueShare:
    """Sends a share of the feed-forward torques; the rest is added to the positions as ``tau / kp``.

    A motor whose position loop is what it promises to be delivers the same torque for any share. A joint without
    stiffness keeps its torque, and positions stay in the range of their joints: beyond, torque is lost.

    Args:
        spec: The robot.
        share: Of the torques that is sent, 0 to 1.
    """

    def __init__(self, spec: RobotSpec, share: float) -> None:
        self._kept, self._kp = np.where(spec.kp > 0.0, share, 1.0), np.where(spec.kp > 0.0, spec.kp, 1.0)
        self._low, self._high = spec.position_min, spec.position_max

    def of(self, command: JointCommand) -> JointCommand:
        """The command with a share of its torques."""
        sent = self._kept * command.tau
        q = np.clip(command.q + (command.tau - sent) / self._kp, self._low, self._high)
        return replace(command, q=q, tau=sent)
