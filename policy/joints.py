"""Names of the joints that a chunk and an observation carry, in motor order.

Motor order is Unitree's: G1 DDS for the body, Dex3 DDS for the hands. The right Dex3 hand lists its index finger
before its middle finger, the left one after it, so hands are always mapped by name (`permutation`).

Source: unitree_sdk2 ``g1_joint_index``; xr_teleoperate ``robot_hand_unitree.py`` (Dex3 joint index enumerations).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from policy.errors import SpecError

_LEG = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
_ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch", "wrist_yaw")

WAIST_JOINTS = ("waist_yaw_joint", "waist_roll_joint", "waist_pitch_joint")
LEFT_ARM_JOINTS = tuple(f"left_{name}_joint" for name in _ARM)
RIGHT_ARM_JOINTS = tuple(f"right_{name}_joint" for name in _ARM)
BODY_JOINTS = (
    *(f"left_{name}_joint" for name in _LEG),
    *(f"right_{name}_joint" for name in _LEG),
    *WAIST_JOINTS,
    *LEFT_ARM_JOINTS,
    *RIGHT_ARM_JOINTS,
)
"""The 29 body joints."""

LEFT_HAND_JOINTS = tuple(
    f"left_hand_{name}_joint" for name in ("thumb_0", "thumb_1", "thumb_2", "middle_0", "middle_1", "index_0", "index_1")
)
RIGHT_HAND_JOINTS = tuple(
    f"right_hand_{name}_joint"
    for name in ("thumb_0", "thumb_1", "thumb_2", "index_0", "index_1", "middle_0", "middle_1")
)

LEFT_WRIST_FRAME, RIGHT_WRIST_FRAME = "left_wrist_yaw_link", "right_wrist_yaw_link"
TORSO_FRAME = "torso_link"


def permutation(source: Sequence[str], target: Sequence[str]) -> np.ndarray:
    """Indices such that ``x_target = x_source[indices]``, matched by joint name.

    Raises:
        SpecError: If a target joint is missing from the source, or a name occurs twice.
    """
    if len(set(source)) != len(source):
        raise SpecError(f"a joint name occurs twice in {list(source)}")
    missing = [name for name in target if name not in source]
    if missing:
        raise SpecError(f"joints {missing} are missing; there are {list(source)}")
    return np.array([list(source).index(name) for name in target], dtype=int)
