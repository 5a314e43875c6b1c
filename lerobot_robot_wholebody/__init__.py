"""The balanced Unitree G1 for LeRobot.

LeRobot imports this at every start of any of its commands: nothing heavy may come with it.
"""

from lerobot_robot_wholebody.config_wholebody_expert import WholebodyExpertConfig
from lerobot_robot_wholebody.config_wholebody_g1 import WholebodyCameraConfig, WholebodyG1Config
from lerobot_robot_wholebody.wholebody_expert import WholebodyExpert
from lerobot_robot_wholebody.wholebody_g1 import WholebodyG1

__all__ = ["WholebodyCameraConfig", "WholebodyExpert", "WholebodyExpertConfig", "WholebodyG1", "WholebodyG1Config"]
