"""Robot descriptions and scenes: one `RobotSpec` that gives Pinocchio, placo and MuJoCo models of the same robot."""

from models.spec import FootSpec, JointSpec, RobotSpec, RobotSpecError, Stance, ToolSpec
from models.unitree_g1 import g1

__all__ = ["FootSpec", "JointSpec", "RobotSpec", "RobotSpecError", "Stance", "ToolSpec", "g1"]
