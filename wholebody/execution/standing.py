"""Stay as the robot is: hands at rest where they are, the centre of mass over the soles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from policy.geometry.rotations import matrix_to_quaternion
from wholebody.planning.plan import ChunkPlan
from wholebody.planning.trajectory import SampledTrajectory
from wholebody.reference import HandMotion, HandPath, rest_row
from wholebody.robot.state import Robot

STOP_TIME = 1.0 / 3.0
"""Distance of the two knots between which a hand comes to rest [s]."""


def hands_at_rest(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Motions of hands that stay where they are in the robot's present configuration (nq,), rows (2, 40)."""
    rows = [
        rest_row(robot.pose(tool.wrist_frame).homogeneous, q[7 + robot.joint_indices(tool.finger_joints)])
        for tool in robot.spec.tools
    ]
    return np.stack(rows)


def hands_as_measured(robot: Robot, commanded: np.ndarray) -> np.ndarray:
    """Motions of the hands as they are, rows (2, 40); fingers as commanded, accelerations unknown and taken as 0."""
    rows = commanded.copy()
    motion = HandMotion(rows)
    motion.a[:], motion.alpha[:] = 0.0, 0.0
    for i, tool in enumerate(robot.spec.tools):
        pose, twist = robot.pose(tool.wrist_frame), robot.velocity(tool.wrist_frame)
        motion.p[i], motion.quat[i] = pose.translation, matrix_to_quaternion(pose.rotation, "xyzw")
        motion.v[i], motion.w[i] = twist[:3], twist[3:]
    return rows


def standing_plan(plan: ChunkPlan, robot: Robot, q: np.ndarray, middle: np.ndarray, hands: np.ndarray) -> ChunkPlan:
    """A plan that stays as the robot is, in place of one that is not balanced.

    Pulled along by a motion that cannot be had, the robot would lose what balance is left.

    Args:
        plan: That cannot be followed.
        robot: At its present configuration.
        q: That configuration, shape (nq,).
        middle: Where the centre of mass belongs, shape (2,), [m].
        hands: Motions of the hands as they are, rows (2, 40).
    """
    still = SampledTrajectory.still(robot, q)
    com = still.com.copy()
    com[0, :, :2] = middle
    knots, rest = plan.start + np.array([0.0, STOP_TIME]), []
    for row in hands:
        hand = HandMotion(row)
        here = HandPath.from_knots(knots, np.stack([hand.T_world_hand] * 2), np.stack([hand.q_finger] * 2))
        rest.append(here.joined(hand, plan.start))
    return replace(plan, paths=tuple(rest), trajectory=replace(still, com=com, start=plan.start))
