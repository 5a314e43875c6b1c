"""Robot descriptions and scenes: one `RobotSpec` that gives Pinocchio, placo and MuJoCo models of the same robot.

Begin with `models.spec.RobotSpec`; `models.unitree_g1.g1` makes one, and `models.mujoco_model.load_mujoco` puts it into
physics.
"""

from models.spec import FootSpec, JointSpec, RobotSpec, RobotSpecError, Stance, ToolSpec
from models.unitree_g1 import g1

__all__ = ["FootSpec", "JointSpec", "RobotSpec", "RobotSpecError", "Stance", "ToolSpec", "g1"]
