"""A robot that is no G1 by name: joints with other names, a locked waist, and two-finger grippers for hands."""

import dataclasses
import tempfile
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path

from models import JointSpec, g1
from models.unitree_g1 import GROUPS

FINGER = {"mass": 0.03, "length": 0.07, "range": (0.0, 1.2)}
"""Of a finger of the gripper [kg], [m], [rad]."""


@cache
def gripper_robot():
    """The spec, its URDF in a folder that lasts as long as the process."""
    folder = Path(tempfile.mkdtemp(prefix="gripper-robot-"))
    plain = g1(hands=False)
    new = {name: f"axis_{i:02d}" for i, name in enumerate(plain.joint_names)}
    waist = set(GROUPS["waist"])
    joints = [dataclasses.replace(joint, name=new[joint.name]) for joint in plain.joints if joint.name not in waist]
    fingers = [_finger_joint(side, i) for side in ("left", "right") for i in range(2)]
    urdf = folder / "gripper_robot.urdf"
    urdf.write_bytes(_urdf(plain, new))
    tools = [
        dataclasses.replace(tool, finger_joints=tuple(f"grip_{tool.side}_{i}" for i in range(2)))
        for tool in plain.tools
    ]
    kept = zip(plain.joint_names, plain.stance.joint_positions, strict=True)
    stance = tuple(angle for name, angle in kept if name not in waist) + (0.3,) * 4
    return dataclasses.replace(
        plain,
        name="gripper_robot",
        urdf=urdf,
        joints=(*joints, *fingers),
        tools=tuple(tools),
        stance=dataclasses.replace(plain.stance, joint_positions=stance),
        hand_neutral=(0.3,) * 4,
        hand_open=(0.0,) * 4,
        hand_closed=(1.2,) * 4,
        locked=tuple(new[name] for name in GROUPS["waist"]),
    )


def _finger_joint(side, i):
    low, high = FINGER["range"]
    limits = {"velocity_max": 10.0, "acceleration_max": 500.0, "effort_max": 1.0, "armature": 1e-3}
    name = f"grip_{side}_{i}"
    return JointSpec(name=name, group=f"{side}_hand", position_min=low, position_max=high, kp=1.5, kd=0.2, **limits)


def _urdf(plain, new):
    """The G1's URDF with other names of joints, and a gripper on each hand."""
    root = ET.parse(plain.urdf).getroot()
    for joint in root.findall("joint"):
        joint.set("name", new.get(joint.get("name"), joint.get("name")))
    mass, length = FINGER["mass"], FINGER["length"]
    for tool in plain.tools:
        for i, y in enumerate((0.03, -0.03)):
            name = f"{tool.side}_jaw_{i}"
            link = ET.SubElement(root, "link", name=name)
            inertial = ET.SubElement(link, "inertial")
            ET.SubElement(inertial, "origin", xyz=f"{0.5 * length} 0 0", rpy="0 0 0")
            ET.SubElement(inertial, "mass", value=str(mass))
            across, along = mass * (0.02**2 + 0.01**2) / 12.0, mass * length**2 / 12.0
            moments = {"ixx": across, "iyy": along, "izz": along, "ixy": 0.0, "ixz": 0.0, "iyz": 0.0}
            ET.SubElement(inertial, "inertia", {key: str(value) for key, value in moments.items()})
            collision = ET.SubElement(link, "collision")
            ET.SubElement(collision, "origin", xyz=f"{0.5 * length} 0 0", rpy="0 0 0")
            ET.SubElement(ET.SubElement(collision, "geometry"), "box", size=f"{length} 0.01 0.02")
            joint = ET.SubElement(root, "joint", name=f"grip_{tool.side}_{i}", type="revolute")
            ET.SubElement(joint, "origin", xyz=f"0.10 {y} 0", rpy="0 0 0")
            ET.SubElement(joint, "parent", link=tool.palm_body)
            ET.SubElement(joint, "child", link=name)
            ET.SubElement(joint, "axis", xyz=f"0 0 {'-1' if i == 0 else '1'}")
            low, high = FINGER["range"]
            ET.SubElement(joint, "limit", lower=str(low), upper=str(high), effort="1", velocity="10")
    return ET.tostring(root)
