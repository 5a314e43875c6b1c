"""Forward kinematics from the text of a URDF alone: an answer that shares no code with Pinocchio."""

import xml.etree.ElementTree as ET
from functools import lru_cache

import numpy as np

from models import g1


@lru_cache(maxsize=1)
def _joints():
    """Joint by child link: its name, parent, origin (4, 4) and axis."""
    found = {}
    for joint in ET.parse(g1().urdf).getroot().iter("joint"):
        origin, axis = joint.find("origin"), joint.find("axis")
        placed = {} if origin is None else origin.attrib
        xyz, rpy = (np.array(placed.get(key, "0 0 0").split(), dtype=float) for key in ("xyz", "rpy"))
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = turn("z", rpy[2]) @ turn("y", rpy[1]) @ turn("x", rpy[0]), xyz
        axis = np.zeros(3) if axis is None else np.array(axis.get("xyz").split(), dtype=float)
        found[joint.find("child").get("link")] = (joint.get("name"), joint.find("parent").get("link"), T, axis)
    return found


def turn(axis, angle):
    """Rotation about a coordinate axis."""
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    R = np.eye(3)
    R[i, i] = R[j, j] = np.cos(angle)
    R[i, j], R[j, i] = -np.sin(angle), np.sin(angle)
    return R


def link_pose(link, angles):
    """Pose (4, 4) of a link in the pelvis for joint angles by name [rad]; joints that are not named are at 0."""
    T = np.eye(4)
    while link != "pelvis":
        name, link, origin, axis = _joints()[link]
        x, y, z = axis
        cross, angle = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), angles.get(name, 0.0)
        moved = np.eye(4)
        moved[:3, :3] += np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
        T = origin @ moved @ T
    return T


def sole_middle(angles):
    """Frame (4, 4) in the pelvis between both soles, whose middles are 35 mm ahead of and below the ankles."""
    feet = [link_pose(f"{side}_ankle_roll_link", angles) for side in ("left", "right")]
    middles = [T[:3, :3] @ (0.035, 0.0, -0.035) + T[:3, 3] for T in feet]
    z = sum(T[:3, 2] for T in feet)
    z = z / np.linalg.norm(z)
    x = sum(T[:3, 0] for T in feet)
    x = x - (x @ z) * z
    x = x / np.linalg.norm(x)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = np.column_stack([x, np.cross(z, x), z]), sum(middles) / 2.0
    return T
