"""Names of the joints that chunks and observations carry, in motor order.

Motor order is Unitree's: G1 DDS for the body, Dex3 DDS for the hands. The right Dex3 hand lists its index finger
before its middle finger, the left one after it, so hands are always mapped by name (`permutation`).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from models.unitree_g1 import GROUPS, HAND_GROUPS
from policy.errors import SpecError

BODY_JOINTS = tuple(name for names in GROUPS.values() for name in names)
"""The 29 body joints."""
LEFT_LEG_JOINTS = GROUPS["left_leg"]
RIGHT_LEG_JOINTS = GROUPS["right_leg"]
WAIST_JOINTS = GROUPS["waist"]
LEFT_ARM_JOINTS = GROUPS["left_arm"]
RIGHT_ARM_JOINTS = GROUPS["right_arm"]
LEFT_HAND_JOINTS = HAND_GROUPS["left_hand"]
RIGHT_HAND_JOINTS = HAND_GROUPS["right_hand"]

WAIST = slice(BODY_JOINTS.index(WAIST_JOINTS[0]), BODY_JOINTS.index(WAIST_JOINTS[-1]) + 1)
"""The waist within the 29 body joints."""
LEFT_ARM = slice(BODY_JOINTS.index(LEFT_ARM_JOINTS[0]), BODY_JOINTS.index(LEFT_ARM_JOINTS[-1]) + 1)
LEFT_LEG = slice(BODY_JOINTS.index(LEFT_LEG_JOINTS[0]), BODY_JOINTS.index(LEFT_LEG_JOINTS[-1]) + 1)
RIGHT_LEG = slice(BODY_JOINTS.index(RIGHT_LEG_JOINTS[0]), BODY_JOINTS.index(RIGHT_LEG_JOINTS[-1]) + 1)
RIGHT_ARM = slice(BODY_JOINTS.index(RIGHT_ARM_JOINTS[0]), BODY_JOINTS.index(RIGHT_ARM_JOINTS[-1]) + 1)


def permutation(source: Sequence[str], target: Sequence[str]) -> np.ndarray:
    """Indices such that ``x_target = x_source[indices]``, matched by joint name; read-only.

    Raises:
        SpecError: If a target joint is missing from the source, or a name occurs twice.
    """
    return _permutation(tuple(source), tuple(target))


@lru_cache(maxsize=256)
def _permutation(source: tuple[str, ...], target: tuple[str, ...]) -> np.ndarray:
    if len(set(source)) != len(source):
        raise SpecError(f"a joint name occurs twice in {list(source)}")
    missing = [name for name in target if name not in source]
    if missing:
        raise SpecError(f"joints {missing} are missing; there are {list(source)}")
    indices = np.array([source.index(name) for name in target], dtype=int)
    indices.flags.writeable = False
    return indices
