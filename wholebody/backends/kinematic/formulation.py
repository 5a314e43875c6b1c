r"""The kinematic program: the specification that its compiled form has to equal.

Variables ``v (nv)``, the velocity of the robot:

    minimise    sum_tasks w |J v - target|^2 + w_v |v|^2
    subject to  J_foot v = gain (T_foot_ref - T_foot)            six rows a foot: the feet stay
                n . J_com v <= balance_gain (edge - margin - n . c)   the centre of mass stays over the soles
                -dq_max <= v_joints <= dq_max                    joint speeds
                q_min <= q + dt v_joints <= q_max                joint positions

No masses but those of the centre of mass, no forces, no torques, no accelerations: what comes out is a motion that the
limbs can make, not one that the robot can make while it stands.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wholebody.contacts.foot import FootContact
from wholebody.limits.balance import CapturePointLimit
from wholebody.qp.formulation import UNBOUNDED
from wholebody.qp.problem import QuadraticProgram
from wholebody.robot.state import Robot
from wholebody.tasks.base import Objective, Task

FOOT_GAIN = 50.0
"""How fast a foot that is not at its place goes back there [1/s]; chosen: ten ticks of 2 ms."""
SPEED_PENALTY = 1e-6
"""Penalty on squared speeds [1/(m/s)^2, 1/(rad/s)^2]: makes the program strictly convex; chosen: far below any weight
of a task."""
RETREAT = 0.1
"""Largest speed that is demanded of a centre of mass outside the support [m/s]; chosen, no trial is on record."""


def build(
    robot: Robot,
    feet: Sequence[FootContact],
    tasks: Sequence[Task],
    balance: CapturePointLimit,
    joints: np.ndarray,
    dt: float,
) -> QuadraticProgram:
    """The program at the robot's present configuration.

    Args:
        robot: Updated at rest (``v = 0``): the tasks then ask for ``kd`` times the velocity that they want.
        feet: Contacts that stay where they were set down.
        tasks: What to do, each with its damping ``kd``; accelerations of their references must be zero.
        balance: The support, and how to keep inside.
        joints: Rows ``q_min q_max dq_max``, Pinocchio order, shape (3, n_joints).
        dt: Control period [s].
    """
    H, g = _cost(robot, tasks)
    A = np.vstack([robot.jacobian(foot.frame) for foot in feet])
    b = np.concatenate([FOOT_GAIN * _distance(robot, foot) for foot in feet])
    C, upper = _balance_rows(robot, balance)
    low, high = speed_bounds(robot.q[7:], joints, dt)
    free = np.full(6, UNBOUNDED)
    x_min, x_max = np.concatenate([-free, low]), np.concatenate([free, high])
    labels = tuple(f"com.edge{i}" for i in range(len(upper)))
    return QuadraticProgram(H, g, A, b, C, np.full(len(upper), -np.inf), upper, x_min, x_max, labels)


def speed_bounds(q: np.ndarray, joints: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest joint speeds, shape (n_joints,) each, [rad/s].

    A joint that is outside its range comes back at its largest speed at most.

    Args:
        q: Joint positions, shape (n_joints,), [rad].
        joints: As in `build`.
        dt: Control period [s].
    """
    q_min, q_max, dq_max = joints
    low = np.clip((q_min - q) / dt, -dq_max, dq_max)
    high = np.clip((q_max - q) / dt, -dq_max, dq_max)
    return low, high


def gravity_torques(robot: Robot, feet: Sequence[FootContact]) -> np.ndarray:
    """Joint torques that hold the robot still, with the shortest point forces that carry its weight, (n_joints,) [N m].

    Args:
        robot: Updated at rest.
        feet: All on the floor; whether a force would have to pull is not looked at.
    """
    J = np.vstack([foot.force_jacobian(robot, robot.jacobian(foot.frame)) for foot in feet])
    forces = np.linalg.pinv(J[:, :6].T) @ robot.nle[:6]
    return robot.nle[6:] - J[:, 6:].T @ forces


def _cost(robot: Robot, tasks: Sequence[Task]) -> tuple[np.ndarray, np.ndarray]:
    H, g = SPEED_PENALTY * np.eye(robot.nv), np.zeros(robot.nv)
    for task in tasks:
        wanted: Objective = task.objective(robot)
        weighted = wanted.J.T * wanted.weight
        H += weighted @ wanted.J
        g -= weighted @ (wanted.target / task.kd)
    return H, g


def _distance(robot: Robot, foot: FootContact) -> np.ndarray:
    """Place of a foot minus where it is, world axes, shape (6,)."""
    T, ref = robot.pose(foot.frame), foot.T_world_ref
    return np.concatenate([ref.translation - T.translation, pin.log3(ref.rotation @ T.rotation.T)])


def _balance_rows(robot: Robot, balance: CapturePointLimit) -> tuple[np.ndarray, np.ndarray]:
    """One row an edge of the support."""
    normals, offsets = balance.support.normals, balance.support.offsets
    left = offsets - balance.margin - normals @ robot.com[:2]
    return normals @ robot.J_com[:2], np.maximum(balance.gain * left, -RETREAT)
