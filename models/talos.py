"""TALOS of PAL Robotics, 1.75 m and 93 kg, as a second humanoid in one file: 28 joints of its body, grippers shut.

Geometry, masses, position, speed and effort limits come from ``talos_full_v2.urdf`` of the package
``example-robot-data``. It has two joints in its waist and no fingers that are driven here; head and grippers are fixed.

Sources:
    example-robot-data, robots/talos_data (from github.com/pal-robotics/talos_robot, Apache-2.0).
    Contact points: TSID's examples count on 0.20 m x 0.13 m of the sole; here it is 0.20 m x 0.12 m.
    Stance: solved so that the soles are flat on z = 0, knees at 0.6 rad, the centre of mass over their middle.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from functools import lru_cache

from models.members import FootSpec, JointSpec, RobotSpecError, Stance, ToolSpec
from models.spec import RobotSpec
from models.urdf import package

_SIDES = ("left", "right")
GROUPS: dict[str, tuple[str, ...]] = {
    **{f"{side}_leg": tuple(f"leg_{side}_{i}_joint" for i in range(1, 7)) for side in _SIDES},
    "waist": ("torso_1_joint", "torso_2_joint"),
    **{f"{side}_arm": tuple(f"arm_{side}_{i}_joint" for i in range(1, 8)) for side in _SIDES},
}
"""The 28 joints of the body, yaw of hips and shoulders first."""
PARTS = {"leg": {"4": "knee"}, "arm": {"4": "elbow", "5": "wrist", "6": "wrist", "7": "wrist"}}
"""Knees, elbows and wrists by the number of the joint in its limb."""
_GRIPPER = (
    *("inner_double_joint", "fingertip_1_joint", "fingertip_2_joint", "inner_single_joint", "fingertip_3_joint"),
    *("joint", "motor_single_joint"),
)
LOCKED = ("head_1_joint", "head_2_joint", *(f"gripper_{side}_{joint}" for side in _SIDES for joint in _GRIPPER))
"""Joints that are fixed: of the head and of the grippers."""
COVERED = (
    "rgbd_link",
    *(f"wrist_{side}_ft{part}_link" for side in _SIDES for part in ("", "_tool")),
    *(
        f"gripper_{side}_{part}_link"
        for side in _SIDES
        for part in ("inner_double", "inner_single", "fingertip_1", "fingertip_2", "fingertip_3")
    ),
)
"""Links inside or beside larger ones, whose shapes say nothing of distances that matter."""

STIFFNESS = {"leg": 3000.0, "torso": 3000.0, "arm": 500.0}
"""Position gains [N m/rad]; chosen: ten times those of a G1 a third as heavy, for limbs of its half length again."""
DAMPING = 0.02
"""Velocity gain as a share of the position gain [s]; chosen, about that of the G1's."""
ARMATURE = {"leg": 0.1, "torso": 0.1, "arm": 0.02}
"""Rotor inertias at the joints [kg m^2]: a guess, no source is known."""
ACCELERATION = {"leg": 100.0, "torso": 60.0, "arm": 100.0}
"""Practical bounds [rad/s^2]; chosen: effort over inertia at the hips, rounded."""
SPEED_SHARE = 0.5
"""Share of the URDF's speed, as for the G1."""

_SOLE = ((0.10, 0.06, -0.107), (0.10, -0.06, -0.107), (-0.10, -0.06, -0.107), (-0.10, 0.06, -0.107))
_PALM = (0.0, 0.0, -0.16)
"""Palm point below the last joint of the arm: between the fingers of the gripper [m]; measured in the URDF."""
_LEG = (0.0, 0.0, -0.3185414, 0.6, -0.2814586, 0.0)
_ARM = (0.25, 0.30, -0.2, -1.6, 0.0, 0.0, 0.0)
_BASE = (-0.0087379, 0.0, 1.0511451)


@lru_cache(maxsize=1)
def talos() -> RobotSpec:
    """TALOS.

    Raises:
        RobotSpecError: If ``example-robot-data`` is not installed or its TALOS lacks a joint.
    """
    urdf = package() / "robots/talos_data/robots/talos_full_v2.urdf"
    if not urdf.is_file():
        raise RobotSpecError(f"example-robot-data has no {urdf.name}; version 6.0 or newer has it")
    limits = {
        joint.get("name", ""): {key: float(value) for key, value in limit.attrib.items()}
        for joint in ET.parse(urdf).getroot().iter("joint")
        if (limit := joint.find("limit")) is not None
    }
    joints = tuple(_joint(name, group, limits[name]) for group, names in GROUPS.items() for name in names)
    return RobotSpec(
        name="talos",
        urdf=urdf,
        base_body="base_link",
        torso_body="torso_2_link",
        imu_frame="base_link",
        joints=joints,
        feet=tuple(FootSpec(side=side, frame=f"leg_{side}_6_link", contact_points=_SOLE) for side in _SIDES),
        tools=tuple(_tool(side) for side in _SIDES),
        stance=Stance(
            base_position=_BASE,
            base_quat_xyzw=(0.0, 0.0, 0.0, 1.0),
            joint_positions=_LEG + _mirrored(_LEG) + (0.0, 0.0) + _ARM + _mirrored(_ARM),
        ),
        hand_neutral=(),
        locked=LOCKED,
        without_collision=COVERED,
    )


def _joint(name: str, group: str, limit: dict[str, float]) -> JointSpec:
    limb, _, number = name.removesuffix("_joint").partition("_")
    kp = STIFFNESS[limb]
    return JointSpec(
        name=name,
        group=group,
        part=PARTS.get(limb, {}).get(number.rpartition("_")[2], ""),
        position_min=limit["lower"],
        position_max=limit["upper"],
        velocity_max=SPEED_SHARE * limit["velocity"],
        acceleration_max=ACCELERATION[limb],
        effort_max=limit["effort"],
        armature=ARMATURE[limb],
        kp=kp,
        kd=DAMPING * kp,
    )


def _tool(side: str) -> ToolSpec:
    return ToolSpec(
        side=side,
        wrist_frame=f"arm_{side}_7_link",
        palm_body=f"gripper_{side}_base_link",
        palm_frame=f"{side}_palm_point",
        palm_body_offset=(0.0, 0.0, -0.0925),
        palm_offset=_PALM,
        finger_joints=(),
    )


def _mirrored(angles: tuple[float, ...]) -> tuple[float, ...]:
    """Joints of the right limb: those about x and z turn the other way."""
    about_y = {6: (2, 3, 4), 7: (3, 6)}[len(angles)]
    return tuple(angle if i in about_y else -angle for i, angle in enumerate(angles))
