"""The robot in placo, from the light URDF: no visuals, hulls, and the pairs that matter instead of all."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import placo

from models.pinocchio_model import stance_q
from models.spec import FootSpec, RobotSpec, RobotSpecError
from models.urdf import light_urdf, parse


def load_placo(spec: RobotSpec, *, contact_points: bool = False) -> placo.RobotWrapper:
    """The robot in its default stance, with the limits and armature of the spec.

    From the original URDF placo needs 4 to 9 s and reports 26 self-collisions of neighbouring links; here it gets
    hulls and the list of pairs. Palm points are frames ``*_palm_point``.

    Args:
        spec: The robot.
        contact_points: Whether the contact points of the feet become frames too, see `contact_frame`.

    Raises:
        RobotSpecError: If a joint is missing, or placo sees a self-collision in the default stance.
    """
    path = light_urdf(spec)
    # placo cannot add frames to a loaded robot; text takes the place of the file, the folder still has the pairs.
    robot = placo.RobotWrapper(str(path.parent), 0, _with_contact_points(spec) if contact_points else "")
    missing = sorted(set(spec.joint_names) ^ set(robot.joint_names()))
    if missing:
        raise RobotSpecError(f"placo and spec '{spec.name}' do not have the same joints: {missing}")
    for joint in spec.joints:
        robot.set_joint_limits(joint.name, joint.position_min, joint.position_max)
        robot.set_velocity_limit(joint.name, joint.velocity_max)
        robot.set_torque_limit(joint.name, joint.effort_max)
        robot.model.armature[robot.get_joint_v_offset(joint.name)] = joint.armature
    put_in_stance(spec, robot)
    touching = robot.self_collisions(False)
    if touching:
        pairs = ", ".join(f"{pair.bodyA} and {pair.bodyB}" for pair in touching)
        raise RobotSpecError(f"placo sees '{spec.name}' collide with itself in its default stance: {pairs}")
    return robot


def put_in_stance(spec: RobotSpec, robot: placo.RobotWrapper) -> None:
    """Set base and joints to the default stance, at rest."""
    robot.state.q = stance_q(spec, robot.model)
    robot.state.qd = np.zeros(robot.model.nv)
    robot.update_kinematics()


def contact_frame(foot: FootSpec, point: int) -> str:
    """Name of the frame at one contact point of a foot, axes of the foot's."""
    return f"{foot.frame}_contact_{point}"


def _with_contact_points(spec: RobotSpec) -> str:
    """The light URDF with a link without mass at each contact point."""
    root = parse(light_urdf(spec))
    for foot in spec.feet:
        for i, point in enumerate(foot.points):
            name = contact_frame(foot, i)
            ET.SubElement(root, "link", name=name)
            joint = ET.SubElement(root, "joint", name=f"{name}_joint", type="fixed")
            ET.SubElement(joint, "origin", xyz=" ".join(repr(float(value)) for value in point), rpy="0 0 0")
            ET.SubElement(joint, "parent", link=foot.frame)
            ET.SubElement(joint, "child", link=name)
    return ET.tostring(root, encoding="unicode")
