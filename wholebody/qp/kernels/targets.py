"""What the tasks ask for: targets and weights of frames, centre of mass, momentum and posture, as `wholebody.tasks`.

``tick`` is the memory of `wholebody.qp.workspace`, here and in all kernels of this package. Frames are in
the order of `wholebody.robot.kernels.frames`; blocks of six rows that are computed elsewhere come after them.
"""

from __future__ import annotations

import math

from wholebody.jit.arrays import Vector
from wholebody.jit.packed import Packed
from wholebody.robot.kernels.frames import PALM_FRAME, PELVIS_FRAME, TORSO_FRAME, shorten
from wholebody.robot.kernels.rigid_body import COM, COM_DRIFT, COM_V, MOMENTUM, MOMENTUM_DRIFT
from wholebody.robot.kernels.rotation import rotation_between
from wholebody.robot.touch import (
    AXIS_MAX,
    FORCE,
    HEADING,
    MOBILITY,
    PUSH_MAX,
    SHARE,
    STIFFNESS,
    TOLD,
    TOLD_GIVE,
    TURN_TOUCHING,
)

DAMPING = 10.0
"""With which joints slow down where the program does without the hands [1/s]; chosen, no trial is on record."""


def targets(tick: Packed) -> None:
    """Fill ``target``, ``weight`` and their like for the body and the joints."""
    for i in range(2):
        hand_target(tick, i, PALM_FRAME + i)
    for k in range(tick.lifted.shape[0]):
        foot_up_target(tick, tick.lifted[k])
    orientation_target(tick, tick.pelvis_ref, tick.pelvis_gain, PELVIS_FRAME)
    orientation_target(tick, tick.torso_ref, tick.torso_gain, TORSO_FRAME)
    height_target(tick, PELVIS_FRAME)
    whole_body_target(tick)
    posture_target(tick)


def hand_target(tick: Packed, i: int, f: int) -> None:
    """Hand ``i`` at frame ``f``, as `HandTask`; its reference is rotation (9), position (3), twist and acceleration."""
    q, ref, x, velocity, drift = tick.q, tick.hand_ref[i], tick.frame_p[f], tick.frame_V[f], tick.frame_A[f]
    kp, kd, largest, size = tick.hand_kp, tick.hand_kd, tick.hand_feedback_max, tick.hand_weight
    target, weight, feedback = tick.target[f], tick.weight[f], tick.scratch
    trust, touch = tick.trust[i] if tick.hands else 0.0, tick.touch[i]
    rotation_between(ref[:9].reshape((3, 3)), tick.frame_R[f], feedback[3:])
    for k in range(3):
        feedback[k] = kp * (ref[9 + k] - q[k] - x[k])
        feedback[3 + k] *= kp
    shorten(feedback, 0, largest[0])
    shorten(feedback, 3, largest[1] * (1.0 - touch[SHARE]) + TURN_TOUCHING * touch[SHARE])
    for k in range(6):
        target[k] = ref[18 + k] + kd * (ref[12 + k] - velocity[k]) + feedback[k] - drift[k]
        weight[k] = trust * size[k // 3]
    if touch[SHARE] > 0.0:
        touching_target(ref, q, x, velocity, drift, kd, touch, feedback, target)


def foot_up_target(tick: Packed, c: int) -> None:
    """Foot ``c``, which is up, as `FootTask` if it is led; its reference is laid out as that of a hand."""
    q, ref, x, velocity, drift = tick.q, tick.foot_ref[c], tick.frame_p[c], tick.frame_V[c], tick.frame_A[c]
    kp, kd, largest, size = tick.foot_kp_up, tick.foot_kd_up, tick.foot_feedback_max, tick.foot_weight
    target, weight, feedback = tick.target[c], tick.weight[c], tick.scratch
    rotation_between(ref[:9].reshape((3, 3)), tick.frame_R[c], feedback[3:])
    for k in range(3):
        feedback[k] = kp * (ref[9 + k] - q[k] - x[k])
        feedback[3 + k] *= kp
    shorten(feedback, 0, largest[0])
    shorten(feedback, 3, largest[1])
    for k in range(6):
        target[k] = ref[18 + k] + kd * (ref[12 + k] - velocity[k]) + feedback[k] - drift[k]
        weight[k] = tick.swings * size[k // 3]


def touching_target(
    ref: Vector, q: Vector, x: Vector, velocity: Vector, drift: Vector, kd: float, touch: Vector, push: Vector,
    target: Vector
) -> None:  # fmt: skip
    """Linear rows of a hand that touches, as `HandTask`: it pushes no harder than it may, and yields to the force."""
    share, cos, sin = touch[SHARE], touch[HEADING], touch[HEADING + 1]
    for k in range(3):
        push[k] = ref[9 + k] - q[k] - x[k]
    turn_level(push, cos, -sin)
    for k in range(3):
        push[k] *= touch[STIFFNESS + k]
    turn_level(push, cos, sin)
    told = math.sqrt(touch[TOLD] ** 2 + touch[TOLD + 1] ** 2 + touch[TOLD + 2] ** 2)
    if told > 0.0:
        along = 0.0
        for k in range(3):
            along += push[k] * touch[TOLD + k] / told
        more = told + min(max(along, -TOLD_GIVE * told), TOLD_GIVE * told) - along
        for k in range(3):
            push[k] += more * touch[TOLD + k] / told
    for k in range(3):
        push[k] += kd * ref[12 + k] + ref[18 + k]
    turn_level(push, cos, -sin)
    for k in range(3):
        push[k] = min(max(push[k], -touch[AXIS_MAX + k]), touch[AXIS_MAX + k])
    turn_level(push, cos, sin)
    shorten(push, 0, touch[PUSH_MAX])
    for k in range(3):
        wanted = push[k] - kd * velocity[k] + touch[FORCE + k] * touch[MOBILITY] - drift[k]
        target[k] = (1.0 - share) * target[k] + share * wanted


def turn_level(x: Vector, cos: float, sin: float) -> None:
    """Turn a vector about the vertical by the angle of that cosine and sine."""
    x[0], x[1] = cos * x[0] - sin * x[1], sin * x[0] + cos * x[1]


def orientation_target(tick: Packed, ref: Vector, gain: Vector, f: int) -> None:
    """Angular rows of frame ``f``, as `OrientationTask`.

    Args:
        tick: The memory.
        ref: Rotation (9), rate (3) and acceleration (3), (15,).
        gain: ``kp kd feedback_max weight`` (4,).
        f: The frame.
    """
    velocity, drift, target, weight = tick.frame_V[f], tick.frame_A[f], tick.target[f], tick.weight[f]
    feedback = tick.scratch
    rotation_between(ref[:9].reshape((3, 3)), tick.frame_R[f], feedback)
    for k in range(3):
        feedback[k] *= gain[0]
    shorten(feedback, 0, gain[2])
    for k in range(3):
        target[3 + k] = ref[12 + k] + feedback[k] + gain[1] * (ref[9 + k] - velocity[3 + k]) - drift[3 + k]
        weight[3 + k] = gain[3]


def height_target(tick: Packed, f: int) -> None:
    """Vertical row of frame ``f``, as `HeightTask`."""
    ref, gain, z = tick.height_ref, tick.height_gain, tick.q[2] + tick.frame_p[f, 2]
    feedback = min(max(gain[0] * (ref[0] - z), -gain[2]), gain[2])
    tick.target[f, 2] = ref[2] + feedback + gain[1] * (ref[1] - tick.frame_V[f, 2]) - tick.frame_A[f, 2]
    tick.weight[f, 2] = gain[3]


def whole_body_target(tick: Packed) -> None:
    """Centre of mass and angular momentum, as `ComTask` and `AngularMomentumTask`."""
    sums, ref, target, weight, feedback = tick.sums, tick.com_ref, tick.body_target, tick.body_weight, tick.scratch
    kp, kd, size, damping, momentum_weight = (
        tick.com_kp, tick.com_kd, tick.com_weight, tick.momentum_kd, tick.momentum_weight
    )  # fmt: skip
    for k in range(3):
        feedback[k] = kp * (ref[k] - sums[COM + k])
    for k in range(2):
        feedback[k] += kp * tick.lean[k]
    shorten(feedback, 0, tick.com_feedback_max)
    for k in range(3):
        target[k] = ref[6 + k] + kd * (ref[3 + k] - sums[COM_V + k]) + feedback[k] - sums[COM_DRIFT + k]
        weight[k] = size[k] * (1.0 + tick.braced[0]) if k < 2 else size[k]
        target[3 + k] = ref[12 + k] + damping * (ref[9 + k] - sums[MOMENTUM + k]) - sums[MOMENTUM_DRIFT + k]
        weight[3 + k] = momentum_weight


def posture_target(tick: Packed) -> None:
    """Joints, as `PostureTask`; without the hands they slow down."""
    q, v, ref, target = tick.q, tick.v, tick.posture_ref, tick.posture_target
    kp, kd, largest = tick.posture_kp, tick.posture_kd, tick.posture_feedback_max
    hands = tick.hands
    for j in range(target.shape[0]):
        feedback = min(max(kp[j] * (ref[0, j] - q[7 + j]), -largest), largest)
        wanted = ref[2, j] + kd[j] * (ref[1, j] - v[6 + j]) + feedback
        target[j] = wanted if hands else -DAMPING * v[6 + j]
