"""Whether one state of a robot can follow from another; compiled by `wholebody.jit.entry`."""

from __future__ import annotations

import math

from wholebody.jit.arrays import Vector


def follows(
    q_before: Vector, v_before: Vector, q_after: Vector, v_after: Vector, period: float, seconds: float, jumps: Vector,
    speed: Vector, acceleration: Vector
) -> bool:  # fmt: skip
    """Whether positions and speeds have changed by no more than these speeds and unknown accelerations explain.

    Args:
        q_before: Configuration (7 + n,), base quaternion xyzw.
        v_before: Velocity (6 + n,).
        q_after: Configuration afterwards, likewise.
        v_after: Velocity afterwards, likewise.
        period: From one to the other [s].
        seconds: Time for which accelerations are unknown [s].
        jumps: Of base position [m], base orientation and joints [rad] that noise may make (3,).
        speed: Changes of speed that a blow may make, as the velocity (6 + n,).
        acceleration: Unknown accelerations, likewise.
    """
    fell, half = 0.5 * seconds**2, 0.5 * period
    for i in range(v_after.shape[0]):
        if not abs(v_after[i] - v_before[i]) <= speed[i] + seconds * acceleration[i]:
            return False
    for i in range(6, v_after.shape[0]):
        went = half * abs(v_after[i] + v_before[i])
        if not abs(q_after[i + 1] - q_before[i + 1]) <= jumps[2] + went + fell * acceleration[i]:
            return False
    place = went = turned = cosine = 0.0
    for i in range(3):
        place += (q_after[i] - q_before[i]) ** 2
        went += half * abs(v_after[i] + v_before[i])
        turned += half * abs(v_after[i + 3] + v_before[i + 3])
    if not math.sqrt(place) <= jumps[0] + went + fell * acceleration[0]:
        return False
    # Half the angle between two orientations has the scalar product of their quaternions as its cosine.
    for i in range(3, 7):
        cosine += q_after[i] * q_before[i]
    angle = 2.0 * math.acos(min(abs(cosine), 1.0))
    return angle <= jumps[1] + turned + fell * acceleration[3]
