"""The Unitree G1, 29 joints, with two Dex3-1 hands or with rubber hands.

Geometry, masses, position and effort limits come from the URDFs of the package ``example-robot-data``
(g1_29dof_rev_1_0, BSD-3-Clause). What a URDF does not say is in the tables below, matched by joint name.

Sources:
    mjlab: github.com/mujocolab/mjlab, asset_zoo/robots/unitree_g1/g1_constants.py (motor data from Unitree).
    LeRobot: lerobot 0.6.1, robots/unitree_g1/config_unitree_g1.py.
    xr_teleoperate: github.com/unitreerobotics/xr_teleoperate, teleop/robot_control/robot_hand_unitree.py.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from models.members import PARTS, FootSpec, JointSpec, RobotSpecError, Stance, ToolSpec
from models.spec import RobotSpec
from models.urdf import package

_LEG = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch", "wrist_yaw")
"""Joints of an arm, from the shoulder."""
_THUMB = ("hand_thumb_0", "hand_thumb_1", "hand_thumb_2")
_MIDDLE = ("hand_middle_0", "hand_middle_1")
_INDEX = ("hand_index_0", "hand_index_1")

GROUPS: dict[str, tuple[str, ...]] = {
    "left_leg": tuple(f"left_{j}_joint" for j in _LEG),
    "right_leg": tuple(f"right_{j}_joint" for j in _LEG),
    "waist": ("waist_yaw_joint", "waist_roll_joint", "waist_pitch_joint"),
    "left_arm": tuple(f"left_{j}_joint" for j in ARM),
    "right_arm": tuple(f"right_{j}_joint" for j in ARM),
}
"""The 29 body joints in G1 motor order."""

# The two Dex3 differ: middle before index on the left, index before middle on the right (xr_teleoperate).
HAND_GROUPS: dict[str, tuple[str, ...]] = {
    "left_hand": tuple(f"left_{j}_joint" for j in _THUMB + _MIDDLE + _INDEX),
    "right_hand": tuple(f"right_{j}_joint" for j in _THUMB + _INDEX + _MIDDLE),
}
"""The 14 finger joints in the order of Unitree's Dex3 messages."""

ARMATURE: dict[str, float] = {
    # Two-stage planetary gears, reflected inertia [kg m^2] (mjlab): motors 7520-14, 7520-22, 5020, 4010.
    r".*_hip_(pitch|yaw)_joint|waist_yaw_joint": 0.010177520,
    r".*_(hip_roll|knee)_joint": 0.025101925,
    r".*_(shoulder_(pitch|roll|yaw)|elbow|wrist_roll)_joint": 0.003609725,
    r".*_wrist_(pitch|yaw)_joint": 0.00425,
    # Linkages driven by two 5020 motors.
    r".*_ankle_(pitch|roll)_joint|waist_(roll|pitch)_joint": 2 * 0.003609725,
    # No source exists for the Dex3: a guess.
    r".*_hand_.*": 1e-3,
}

GAINS: dict[str, tuple[float, float]] = {
    # kp [N m/rad], kd [N m s/rad] (LeRobot).
    r".*_hip_.*": (150.0, 2.0),
    r".*_knee_joint": (300.0, 4.0),
    r".*_ankle_.*": (40.0, 2.0),
    r"waist_.*": (250.0, 5.0),
    r".*_shoulder_(pitch|roll)_joint": (50.0, 3.0),
    r".*_(shoulder_yaw|elbow)_joint": (80.0, 3.0),
    r".*_wrist_.*": (40.0, 1.5),
    # The gains xr_teleoperate sends to every Dex3 motor; with the guessed armature: 6 Hz, damping ratio 2.6.
    r".*_hand_.*": (1.5, 0.2),
}

JOINT_FRICTION: dict[str, tuple[float, float]] = {
    # Damping [N m s/rad] and dry friction [N m] (unitree_mujoco, unitree_robots/g1/g1_29dof_with_hand.xml). Models of
    # this package have none; a realistic plant has these. The menagerie's G1 has 0.3 N m at every joint.
    r"(?!.*_(wrist|hand)_).*": (0.05, 0.2),
    r".*_wrist_.*": (0.05, 0.1),
    r".*_hand_.*": (0.01, 0.1),
}

VELOCITY_SHARE: dict[str, float] = {
    # Share of the URDF speed, which is the motor's speed without load. A motor gives its peak torque up to about half
    # of it. Fingers carry no load to speak of while they move.
    r"(?!.*_hand_).*": 0.5,
    r".*_hand_.*": 1.0,
}

ACCELERATION: dict[str, float] = {
    # Effort limit over the inertia the joint moves in the default stance, rounded [rad/s^2]; light joints are capped
    # at what a smooth motion can ask for.
    r".*_hip_pitch_joint": 100.0,
    r".*_(hip_roll|hip_yaw|knee)_joint": 150.0,
    r".*_ankle_.*": 200.0,
    r"waist_yaw_joint": 150.0,
    r"waist_(roll|pitch)_joint": 100.0,
    r".*_shoulder_pitch_joint": 120.0,
    r".*_(shoulder_(roll|yaw)|elbow)_joint": 250.0,
    r".*_wrist_.*": 300.0,
    r".*_hand_.*": 500.0,
}

LOCKED: dict[str, tuple[str, ...]] = {
    "29dof": (),
    "27dof": (r"waist_(roll|pitch)_joint",),
    "locked_waist": (r"waist_.*_joint",),
    "23dof": (r"waist_(roll|pitch)_joint", r".*_wrist_(pitch|yaw)_joint"),
}
"""Joints that a G1 of so many body joints lacks (Unitree's ``mode_machine`` tells which one it is). The links of the 23
are those of the 29 here, wrists straight: their own URDF is not in ``example-robot-data``."""

LINKAGE_JOINTS = r".*_ankle_(pitch|roll)_joint|waist_(roll|pitch)_joint"
"""Joints driven by two motors through a linkage: the URDF allows 35 N m, Unitree's MJCF and mjlab 50 N m."""

# Spheres of the URDF: centres 30 mm below the ankle roll axis, radius 5 mm, so the sole is 35 mm below it.
_SOLE = ((0.12, 0.03, -0.035), (0.12, -0.03, -0.035), (-0.05, -0.025, -0.035), (-0.05, 0.025, -0.035))

# Joint origin of *_hand_palm_joint (left; the right one is mirrored in y), and the palm point 80 mm ahead of it.
_PALM_BODY = (0.0415, 0.003, 0.0)
_PALM_AHEAD = 0.08

# Left side, mirrored for the right. Solved so that the soles are flat on z = 0 with their centres 0.238 m apart, the
# knees at 0.4 rad, the CoM over the sole midpoint and the palm points at (0.26, +-0.20, 0.86) with level hands.
_STANCE_KNEE = 0.4
STANCE_DEX3 = {
    "base": (-0.0381515, 0.0, 0.7792070),
    "leg": (-0.1934053, 0.0007419, -0.0002863, _STANCE_KNEE, -0.2065948, -0.0007953),
    "arm": (0.1009287, 0.2147579, 0.0, 0.0509271, -0.2175174, -0.1467946, -0.0387593),
}
STANCE_RUBBER = {
    "base": (-0.0262138, 0.0, 0.7791530),
    "leg": (-0.1742726, 0.0007480, -0.0002723, _STANCE_KNEE, -0.2257275, -0.0007960),
    "arm": (0.1606031, 0.2111994, 0.0, -0.0050783, -0.2145478, -0.1494213, -0.0433466),
}

# Left hand; every sign flips on the right.
# Slightly bent: zero is a position limit of ten of the fourteen joints.
_NEUTRAL = {"thumb_0": 0.0, "thumb_1": 0.1, "thumb_2": 0.3, "proximal": -0.3, "distal": -0.3}
_OPEN = {"thumb_0": 0.0, "thumb_1": -0.55, "thumb_2": 0.05, "proximal": -0.3, "distal": -0.2}
# Inside the limits, but more than any object of 40 to 80 mm allows: with the gains above, the rest is grip (about 1 N m
# at thumb and knuckles on the 60 mm cylinder, below the effort limits).
_CLOSED = {"thumb_0": 0.0, "thumb_1": 0.6, "thumb_2": 1.7, "proximal": -1.5, "distal": -1.7}


@lru_cache(maxsize=8)
def g1(hands: bool = True, *, linkage_effort: float = 35.0, locked: tuple[str, ...] = ()) -> RobotSpec:
    """The Unitree G1.

    Args:
        hands: With Dex3-1 hands (43 joints) or with rubber hands (29 joints).
        linkage_effort: Torque bound of ankles and waist roll and pitch [N m]: 35 in the URDF, 50 in Unitree's MJCF.
        locked: Patterns of joints that this G1 does not have, in its waist and arms: they are fixed at zero. `LOCKED`
            has those of Unitree's variants. Its stance is that of the others, and not balanced to the millimetre.

    Raises:
        RobotSpecError: If ``example-robot-data`` is not installed, its G1 lacks a joint, or a pattern matches none that
            can be locked.
    """
    urdf = _urdf_path("g1_29dof_with_hand_rev_1_0.urdf" if hands else "g1_29dof_rev_1_0.urdf")
    groups = GROUPS | HAND_GROUPS if hands else GROUPS
    limits = _urdf_limits(urdf)
    fixed = _locked(locked)
    joints = tuple(
        _joint(name, group, limits, linkage_effort)
        for group, names in groups.items()
        for name in names
        if name not in fixed
    )
    whole = mirrored_stance(**dict[str, Any](STANCE_DEX3 if hands else STANCE_RUBBER), hands=hands)
    return RobotSpec(
        name=("g1_dex3" if hands else "g1") + (f"_{29 - len(fixed)}" if fixed else ""),
        urdf=urdf,
        base_body="pelvis",
        torso_body="torso_link",
        imu_frame="imu_in_pelvis",
        joints=joints,
        feet=tuple(_foot(side) for side in ("left", "right")),
        tools=tuple(_tool(side, hands) for side in ("left", "right")),
        stance=without(whole, fixed, hands=hands),
        locked=fixed,
        hand_neutral=_both_hands(_NEUTRAL) if hands else (),
        hand_open=_both_hands(_OPEN) if hands else (),
        hand_closed=_both_hands(_CLOSED) if hands else (),
    )


def _locked(patterns: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the joints that some patterns lock."""
    names = [name for group in ("waist", "left_arm", "right_arm") for name in GROUPS[group]]
    for pattern in patterns:
        if not any(re.fullmatch(pattern, name) for name in names):
            raise RobotSpecError(
                f"'{pattern}' matches no joint of waist and arms that can be locked: {', '.join(names)}"
            )
    return tuple(name for name in names if any(re.fullmatch(pattern, name) for pattern in patterns))


def without(stance: Stance, fixed: tuple[str, ...], *, hands: bool) -> Stance:
    """Stance of a G1 that lacks some joints, from the stance of the whole one."""
    groups = GROUPS | HAND_GROUPS if hands else GROUPS
    names = (name for group in groups.values() for name in group)
    kept = zip(names, stance.joint_positions, strict=True)
    return replace(stance, joint_positions=tuple(angle for name, angle in kept if name not in fixed))


def _urdf_path(name: str) -> Path:
    path = package() / "robots/g1_description/urdf" / name
    if not path.is_file():
        raise RobotSpecError(f"example-robot-data has no {name}; version 6.0 or newer has it")
    return path.resolve()


def _urdf_limits(urdf: Path) -> dict[str, dict[str, float]]:
    joints = ET.parse(urdf).getroot().iter("joint")
    return {
        joint.get("name", ""): {key: float(value) for key, value in limit.attrib.items()}
        for joint in joints
        if (limit := joint.find("limit")) is not None
    }


def _joint(name: str, group: str, limits: dict[str, dict[str, float]], linkage_effort: float) -> JointSpec:
    if name not in limits:
        raise RobotSpecError(f"the G1's URDF has no joint '{name}'; it has {', '.join(limits)}")
    limit = limits[name]
    kp, kd = _match(GAINS, name)
    return JointSpec(
        name=name,
        group=group,
        part=next((part for part in PARTS if f"_{part}_" in name), ""),
        position_min=limit["lower"],
        position_max=limit["upper"],
        velocity_max=_match(VELOCITY_SHARE, name) * limit["velocity"],
        acceleration_max=_match(ACCELERATION, name),
        effort_max=linkage_effort if re.fullmatch(LINKAGE_JOINTS, name) else limit["effort"],
        armature=_match(ARMATURE, name),
        kp=kp,
        kd=kd,
    )


def _match[T](table: dict[str, T], name: str) -> T:
    found = [value for pattern, value in table.items() if re.fullmatch(pattern, name)]
    if len(found) != 1:
        raise RobotSpecError(
            f"joint '{name}' is matched by {len(found)} patterns of {list(table)}, must be exactly one"
        )
    return found[0]


def _foot(side: str) -> FootSpec:
    return FootSpec(
        side=side,
        frame=f"{side}_ankle_roll_link",
        contact_points=_SOLE,
    )


def _tool(side: str, hands: bool) -> ToolSpec:
    x, y, z = _PALM_BODY
    mirrored = y if side == "left" else -y
    return ToolSpec(
        side=side,
        wrist_frame=f"{side}_wrist_yaw_link",
        palm_body=f"{side}_hand_palm_link" if hands else f"{side}_rubber_hand",
        palm_frame=f"{side}_palm_point",
        palm_body_offset=(x, mirrored, z),
        palm_offset=(x + _PALM_AHEAD, mirrored, z),
        finger_joints=HAND_GROUPS[f"{side}_hand"] if hands else (),
    )


def mirrored_stance(
    base: tuple[float, float, float], leg: tuple[float, ...], arm: tuple[float, ...], *, hands: bool
) -> Stance:
    """A stance of the G1 with both sides alike, upright, fingers relaxed.

    Args:
        base: Pelvis in world [m].
        leg: Joints of the left leg, shape (6,), [rad].
        arm: Joints of the left arm, shape (7,), [rad].
        hands: With Dex3-1 hands or with rubber hands.
    """
    body = leg + _mirrored(_LEG, leg) + (0.0, 0.0, 0.0) + arm + _mirrored(ARM, arm)
    return Stance(
        base_position=base,
        base_quat_xyzw=(0.0, 0.0, 0.0, 1.0),
        joint_positions=body + (_both_hands(_NEUTRAL) if hands else ()),
    )


def _mirrored(names: tuple[str, ...], angles: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(-a if n.endswith(("roll", "yaw")) else a for n, a in zip(names, angles, strict=True))


def _both_hands(left: dict[str, float]) -> tuple[float, ...]:
    angles = []
    for side, names in HAND_GROUPS.items():
        sign = 1.0 if side == "left_hand" else -1.0
        for name in names:
            _, finger, number, _ = name.split("_", 1)[1].split("_")
            key = f"thumb_{number}" if finger == "thumb" else ("proximal", "distal")[int(number)]
            angles.append(sign * left[key])
    return tuple(angles)
