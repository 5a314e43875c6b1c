"""The robot in placo, from the light URDF: no visuals, hulls, and the pairs that matter instead of all."""

from __future__ import annotations

import numpy as np
import placo

from models.pinocchio_model import stance_q
from models.spec import RobotSpec, SpecError
from models.urdf import light_urdf


def load_placo(spec: RobotSpec) -> placo.RobotWrapper:
    """The robot in its default stance, with the limits and armature of the spec.

    From the original URDF placo needs 4 to 9 s and reports 26 self-collisions of neighbouring links; here it gets
    hulls and the list of pairs. Palm points are frames ``*_palm_point``.

    Raises:
        SpecError: If a joint is missing, or placo sees a self-collision in the default stance.
    """
    robot = placo.RobotWrapper(str(light_urdf(spec).parent))
    missing = sorted(set(spec.joint_names) ^ set(robot.joint_names()))
    if missing:
        raise SpecError(f"placo and spec '{spec.name}' do not have the same joints: {missing}")
    for joint in spec.joints:
        robot.set_joint_limits(joint.name, joint.position_min, joint.position_max)
        robot.set_velocity_limit(joint.name, joint.velocity_max)
        robot.set_torque_limit(joint.name, joint.effort_max)
        robot.model.armature[robot.get_joint_v_offset(joint.name)] = joint.armature
    put_in_stance(spec, robot)
    touching = robot.self_collisions(False)
    if touching:
        pairs = ", ".join(f"{pair.bodyA} and {pair.bodyB}" for pair in touching)
        raise SpecError(f"placo sees '{spec.name}' collide with itself in its default stance: {pairs}")
    return robot


def put_in_stance(spec: RobotSpec, robot: placo.RobotWrapper) -> None:
    """Set base and joints to the default stance, at rest."""
    robot.state.q = stance_q(spec, robot.model)
    robot.state.qd = np.zeros(robot.model.nv)
    robot.update_kinematics()
