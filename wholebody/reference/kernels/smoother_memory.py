"""What the smoother of one hand remembers, and its limits.

A *group* is what a limit on a norm applies to: the position of a hand (3 coordinates), its orientation (3), each of its
7 finger joints (1): nine groups. A group of n coordinates uses the first n entries of the scratch vectors.
"""

from __future__ import annotations

import math

from wholebody.jit.arrays import Vector
from wholebody.jit.record import record

ROW, GROUPS, FINGERS = 40, 9, 7

HAND = record(
    ("motion", ROW),  # what is commanded, as in wholebody.reference.layout
    ("target_acceleration", 13),  # of the last target: position 3, orientation 3, fingers 7
    ("time_to_go", GROUPS),  # [s]
    ("held", 14),  # pose of the last finite target: position 3, quaternion 4, fingers 7
    # Scratch of a tick: the target, a quaternion, and of the group: the error against the target and its derivatives,
    # velocity and acceleration now, motion of the target at the start of the tick, jerk.
    ("goal", ROW), ("turn", 4), ("error", 3), ("error_v", 3), ("error_a", 3), ("v", 3), ("a", 3), ("target_v", 3),
    ("target_a", 3), ("target_j", 3), ("jerk", 3), ("wanted", 3), ("brake", 3),
)  # fmt: skip

LIMITS = record(
    ("speed", GROUPS), ("acceleration", GROUPS), ("jerk", GROUPS), ("finger_lower", FINGERS), ("finger_upper", FINGERS)
)  # fmt: skip
"""Of one hand [m, rad and per s, s^2, s^3]."""


def norm(x: Vector, n: int) -> float:
    """Euclidean norm of the first ``n`` entries."""
    total = 0.0
    for i in range(n):
        total += x[i] * x[i]
    return math.sqrt(total)


def clip_norm(x: Vector, n: int, bound: float) -> bool:
    """Scale the first ``n`` entries in place to a norm of at most ``bound``; True where it was longer."""
    size = norm(x, n)
    if size <= bound:
        return False
    for i in range(n):
        x[i] *= bound / size
    return True
