"""Whether a walk can begin from a posture: upright, hands such as a robot that steps can follow."""

from __future__ import annotations

from math import asin

import numpy as np
import pinocchio as pin

from wholebody.execution.feet.hands_of_walks import HELD, HandsOfWalks
from wholebody.robot.state import Robot

UPRIGHT = 0.6
"""Distance of a joint of legs or waist from the stance up to which a walk begins at once [rad]; chosen: further off,
the robot leans or squats, and a walk would have to lift what was planned for that."""
LEANS = 0.1
"""Angle by which pelvis or torso lean to a side up to which it does [rad]; measured: a walk that was begun at
0.13 and kept it fell, one that was begun at 0.28 ahead stood."""


class ReadyToWalk:
    """Looks at postures from which a walk is to begin.

    Args:
        robot: The robot.
        stance: Of its joints and base, shape (nq,).
        hands: Which hands a robot that steps can have.
    """

    def __init__(self, robot: Robot, stance: np.ndarray, hands: HandsOfWalks) -> None:
        self._robot, self._stance, self._hands = robot, stance, hands
        limbs = robot.spec.limbs
        below = np.concatenate([limbs["left_leg"], limbs["right_leg"], limbs["waist"]])
        self._below = np.flatnonzero(np.isin(robot.motor_to_pin, below))

    def _leans(self, q: np.ndarray) -> float:
        """Angle by which pelvis or torso lean to a side [rad]; leaves the frames of the configuration."""
        robot = self._robot
        pin.framesForwardKinematics(robot.model, robot.scratch, q)
        names = robot.spec.base_body, robot.spec.torso_body
        return max(asin(min(abs(robot.scratch.oMf[robot.frame_id(name)].rotation[2, 1]), 1.0)) for name in names)

    def look(self, q: np.ndarray, T_pelvis: np.ndarray) -> bool:
        """Whether a walk can begin from a configuration (nq,).

        Args:
            q: The configuration.
            T_pelvis: Pose of its pelvis if it stood upright, shape (4, 4).
        """
        if np.abs(q[7:] - self._stance[7:])[self._below].max() > UPRIGHT:
            return False
        if self._leans(q) > LEANS:
            return False
        robot = self._robot
        wrists = [robot.scratch.oMf[robot.frame_id(tool.wrist_frame)].translation for tool in robot.spec.tools]
        return self._hands.why_not_there(np.array(wrists)[:, None], T_pelvis, HELD) is None
