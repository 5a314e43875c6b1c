"""Palms that a person steers by their velocity, with what LeRobot reads: a gamepad or a keyboard."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING

from lerobot_robot_wholebody.config_teleoperators import SteeringConfig, WholebodyGamepadConfig, WholebodyKeyboardConfig
from lerobot_robot_wholebody.hands_teleoperator import Hands, HandsTeleoperator

if TYPE_CHECKING:
    from lerobot.teleoperators.gamepad.gamepad_utils import InputController

    from lerobot_robot_wholebody.wholebody_g1 import WholebodyG1

AHEAD_MAX = 0.1
"""How far a target is ahead of its palm at most [m]; chosen: a palm that is stopped, or out of reach, comes back at
once, and half a second is not lost."""
CLOSING_RATE = 1.0
"""Share of the way from open to closed that fingers go in a second [1/s]; chosen: as slow as a person's eye follows."""
STEP_MAX = 0.1
"""Longest time between two steps that is steered over [s]; chosen: three steps of 30 Hz; after a pause palms do not
jump."""


class Steering(HandsTeleoperator):
    """Moves palms while something is held down; they stay where it is let go.

    Args:
        config: Settings.

    Attributes:
        controller: LeRobot's class of what is read, by its name.
    """

    config: SteeringConfig
    controller: str

    def _open(self) -> InputController:
        """What is read, not started."""
        return getattr(import_module("lerobot.teleoperators.gamepad.gamepad_utils"), self.controller)()

    def connect(self, calibrate: bool = True) -> None:
        """Begin to read.

        Raises:
            ConnectionError: If there is nothing to read.
            ImportError: If a package is missing that LeRobot reads it with.
        """
        self._controller = self._open()
        self._controller.start()
        if not self._controller.running:
            raise ConnectionError(
                f"{self.name.removeprefix('wholebody_')}: there is none that LeRobot can read here; "
                "--teleop.type=wholebody_page needs a browser alone"
            )
        super().connect(calibrate)

    def disconnect(self) -> None:
        """Read no more."""
        self._controller.stop()
        super().disconnect()

    def _begin(self, robot: WholebodyG1) -> None:
        self._steered = 0.0

    def _at(self, time: float) -> Hands:
        import numpy as np

        from policy.action_spec.hands import SIDES

        self._controller.update()
        dt, self._steered = min(time - self._steered, STEP_MAX), time
        way = np.clip(np.array(self._controller.get_deltas(), dtype=float), -1.0, 1.0)
        palms, fingers, measured = self.last.palms.copy(), list(self.last.fingers), self._robot.palms
        for i, side in enumerate(SIDES):
            if self.config.hand not in (side, "both"):
                continue
            fingers[i] = self._closed(side, fingers[i], dt)
            if way.any():
                ahead = palms[i] + dt * self.config.speed * way - measured[i]
                palms[i] = measured[i] + ahead * min(1.0, AHEAD_MAX / max(float(np.linalg.norm(ahead)), AHEAD_MAX))
        return replace(self.last, palms=palms, fingers=(fingers[0], fingers[1]))

    def _closed(self, side: str, fingers: object, dt: float) -> object:
        """Fingers after a step of closing or opening."""
        from policy.action_spec.hands import closing_of, grasp_posture

        rate = {"close": CLOSING_RATE, "open": -CLOSING_RATE}.get(self._controller.gripper_command(), 0.0)
        if not rate:
            return fingers
        robot = self._robot.numbers.spec.robot
        return grasp_posture(side, closing_of(side, fingers, robot) + dt * rate, robot)


class WholebodyGamepad(Steering):
    """Sticks move a palm, buttons open and close its fingers.

    Args:
        config: Settings.
    """

    config_class, name, controller = WholebodyGamepadConfig, "wholebody_gamepad", "GamepadController"


class WholebodyKeyboard(Steering):
    """Arrows move a palm ahead, back and aside, the shift keys down and up.

    Args:
        config: Settings.
    """

    config_class, name, controller = WholebodyKeyboardConfig, "wholebody_keyboard", "KeyboardController"
