"""Settings: what there is, within which bounds, and how a file changes them.

Begin with `wholebody.config.controller.ControllerConfig`, whose fields say what they mean; YAML:
`wholebody.config.file`.
"""

from wholebody.config.controller import (
    START_MAX,
    BodyConfig,
    ControllerConfig,
    HandConfig,
    PlannerConfig,
    SafetyConfig,
    TrajectoryConfig,
)
from wholebody.config.loads import LoadConfig
from wholebody.config.planning import PlanningConfig
from wholebody.config.robot import RobotConfig
from wholebody.config.verdict import VerdictConfig

__all__ = [
    "START_MAX",
    "BodyConfig",
    "ControllerConfig",
    "HandConfig",
    "LoadConfig",
    "PlannerConfig",
    "PlanningConfig",
    "RobotConfig",
    "SafetyConfig",
    "TrajectoryConfig",
    "VerdictConfig",
]
