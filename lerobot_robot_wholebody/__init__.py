"""The balanced Unitree G1 for LeRobot.

LeRobot imports this at every start of any of its commands: nothing heavy may come with it. Those commands that know
environments have loaded them by then; the others are spared it.
"""

import sys

from lerobot_robot_wholebody.config_teleoperators import (
    WholebodyExpertConfig,
    WholebodyGamepadConfig,
    WholebodyKeyboardConfig,
    WholebodyMotionConfig,
    WholebodyPageConfig,
    WholebodySocketConfig,
)
from lerobot_robot_wholebody.config_wholebody_g1 import WholebodyCameraConfig, WholebodyG1Config
from lerobot_robot_wholebody.steering import WholebodyGamepad, WholebodyKeyboard
from lerobot_robot_wholebody.wholebody_expert import WholebodyExpert
from lerobot_robot_wholebody.wholebody_g1 import WholebodyG1
from lerobot_robot_wholebody.wholebody_motion import WholebodyMotion
from lerobot_robot_wholebody.wholebody_page import WholebodyPage
from lerobot_robot_wholebody.wholebody_socket import WholebodySocket

if "lerobot.envs.configs" in sys.modules:
    import lerobot_robot_wholebody.config_environment  # noqa: F401

__all__ = [
    "WholebodyCameraConfig",
    "WholebodyExpert",
    "WholebodyExpertConfig",
    "WholebodyG1",
    "WholebodyG1Config",
    "WholebodyGamepad",
    "WholebodyGamepadConfig",
    "WholebodyKeyboard",
    "WholebodyKeyboardConfig",
    "WholebodyMotion",
    "WholebodyMotionConfig",
    "WholebodyPage",
    "WholebodyPageConfig",
    "WholebodySocket",
    "WholebodySocketConfig",
]
