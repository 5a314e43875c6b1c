r"""The whole-body inverse-dynamics program: the specification that every faster path has to equal.

Variables ``x = [dv (nv), f (3 per contact point), s (2 slacks)]``:

    minimise    sum_tasks w |J dv - target|^2 + w_dv |dv|^2 + w_f |f|^2 + slack penalties
    subject to  M_base dv + nle_base = J_points_base' f          six rows: the base is unactuated; nle is less what
                                                                 pushes the hands, as far as it is known
                J_foot dv = target_foot                          six rows a foot that stands: it stays
                |M_joints dv + nle_joints - J_points_joints' f| <= tau_max
                friction pyramid of every point, f_min <= f_normal <= f_max; no force on a foot that is up
                dv_min <= dv_joints <= dv_max                    viable position and velocity limits
                J_balance dv - s_0 <= bound                      centre of mass, tilt, height
                J_distance dv - s_1 <= bound                     floor, self-collision

The hard rows are those of physics. The slack rows are safety bounds: their penalty is linear and far above that of any
task, so a task never buys a violation (exact penalty), while a push that has already broken a bound does not make
the program infeasible.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wholebody.contacts.foot import FootContact
from wholebody.limits.base import Rows
from wholebody.qp.problem import QPSolution, QuadraticProgram
from wholebody.robot.state import Robot
from wholebody.tasks.base import Objective

UNBOUNDED = 1e9
"""Stands for infinity on variables [m/s^2, rad/s^2, N]; chosen: some solvers dislike true infinities in bounds."""


@dataclass(frozen=True, kw_only=True)
class Regularisation:
    """Small costs that make the program strictly convex, and the penalties of the slacks."""

    acceleration: float = 1e-6
    """Cost of |dv|^2 [1/(m/s^2)^2, 1/(rad/s^2)^2]."""
    force: float = 1e-5
    """Cost of |f|^2 [1/N^2]."""
    slack_linear: float = 1e6
    """Price of a unit of slack: above the largest multiplier a task can put on a bound."""
    slack_quadratic: float = 1e3
    """Curvature of the slack's penalty."""


@dataclass(frozen=True)
class JointBounds:
    """Per-joint bounds in Pinocchio order, each shape (n_joints,): acceleration [rad/s^2] and torque [N m]."""

    ddq_min: np.ndarray
    ddq_max: np.ndarray
    tau_max: np.ndarray


@dataclass(frozen=True)
class WholeBodySolution:
    """What the program says: accelerations, forces, torques.

    Attributes:
        dv: Generalised acceleration, shape (nv,).
        forces: Point forces in world axes, shape (n_points, 3), [N].
        tau: Joint torques in Pinocchio order, shape (n_joints,), [N m].
        slack: Slack of the balance rows and of the distance rows, shape (2,), [m/s^2 or rad/s^2].
    """

    dv: np.ndarray
    forces: np.ndarray
    tau: np.ndarray
    slack: np.ndarray


class InverseDynamics:
    """Builds the program from tasks, limits and contacts, and reads its solution.

    Building and solving are apart, so that a test can look at the program without a solver.
    """

    def __init__(self, robot: Robot, contacts: Sequence[FootContact], regularisation: Regularisation) -> None:
        self.robot, self.contacts, self.regularisation = robot, tuple(contacts), regularisation
        self.n_forces = sum(contact.n_forces for contact in contacts)
        self.n = robot.nv + self.n_forces + 2
        self.pushed = np.zeros(robot.nv)
        """Known generalised force of what touches the robot elsewhere than its feet, shape (nv,)."""
        self._cone = np.zeros((sum(len(c.cone_rows) for c in contacts), self.n_forces))
        row = column = 0
        for contact in contacts:
            height, width = contact.cone_rows.shape
            self._cone[row : row + height, column : column + width] = contact.cone_rows
            row, column = row + height, column + width
        self._cone_labels = tuple(f"friction.{c.frame}" for c in contacts for _ in c.cone_rows)
        self._torque_labels = tuple(f"torque.{name}" for name in robot.joint_names)

    def build(
        self,
        objectives: Sequence[Objective],
        joints: JointBounds,
        balance: Sequence[Rows],
        collision: Sequence[Rows],
    ) -> QuadraticProgram:
        """Assemble the program at the robot's present state."""
        nv, n, n_forces = self.robot.nv, self.n, self.n_forces
        forces = slice(nv, nv + n_forces)
        H, g = self._cost(objectives)
        J_points, A_feet, b_feet = self._contact_rows()
        A = np.zeros((6 + len(b_feet), n))
        A[:6, :nv], A[:6, forces] = self.robot.M[:6], -J_points[:, :6].T
        A[6:, :nv] = A_feet
        bias = self._bias()
        b = np.concatenate([-bias[:6], b_feet])

        soft = [(rows, 0) for rows in balance] + [(rows, 1) for rows in collision]
        n_torque, n_cone = nv - 6, len(self._cone)
        n_soft = sum(len(rows.upper) for rows, _ in soft)
        C = np.zeros((n_torque + n_cone + n_soft, n))
        lower, upper = np.full(len(C), -np.inf), np.zeros(len(C))
        C[:n_torque, :nv], C[:n_torque, forces] = self.robot.M[6:], -J_points[:, 6:].T
        lower[:n_torque], upper[:n_torque] = -joints.tau_max - bias[6:], joints.tau_max - bias[6:]
        C[n_torque : n_torque + n_cone, forces] = self._cone
        labels = [*self._torque_labels, *self._cone_labels]
        at = n_torque + n_cone
        for rows, slack in soft:
            end = at + len(rows.upper)
            C[at:end, :nv], C[at:end, nv + n_forces + slack] = rows.J, -1.0
            upper[at:end] = rows.upper
            labels.extend(rows.labels)
            at = end
        x_min, x_max = self._variable_bounds(joints)
        return QuadraticProgram(H, g, A, b, C, lower, upper, x_min, x_max, tuple(labels), n_slack=2)

    def read(self, solution: QPSolution) -> WholeBodySolution:
        """Split a solution and compute the joint torques it needs."""
        nv = self.robot.nv
        dv, f = solution.x[:nv], solution.x[nv : nv + self.n_forces]
        J_points, _, _ = self._contact_rows()
        tau = self.robot.M[6:] @ dv + self._bias()[6:] - J_points[:, 6:].T @ f
        return WholeBodySolution(dv, f.reshape(-1, 3), tau, solution.x[nv + self.n_forces :])

    def _bias(self) -> np.ndarray:
        """Coriolis, centrifugal and gravity forces less the known force on the hands, shape (nv,)."""
        return self.robot.nle - self.pushed

    def _cost(self, objectives: Sequence[Objective]) -> tuple[np.ndarray, np.ndarray]:
        nv, penalties = self.robot.nv, self.regularisation
        H, g = np.zeros((self.n, self.n)), np.zeros(self.n)
        J = np.vstack([objective.J for objective in objectives])
        weight = np.concatenate([objective.weight for objective in objectives])
        target = np.concatenate([objective.target for objective in objectives])
        weighted = J.T * weight
        H[:nv, :nv] = weighted @ J
        g[:nv] = -weighted @ target
        diagonal = np.concatenate(
            [
                np.full(nv, penalties.acceleration),
                np.full(self.n_forces, penalties.force),
                np.full(2, penalties.slack_quadratic),
            ]
        )
        H[np.diag_indices(self.n)] += diagonal
        g[-2:] = penalties.slack_linear
        return H, g

    def _contact_rows(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        points, feet, targets = [], [], []
        for contact in self.contacts:
            J, target = contact.acceleration(self.robot)
            points.append(contact.force_jacobian(self.robot, J))
            if contact.load > 0.0:
                feet.append(J)
                targets.append(target)
        return np.vstack(points), np.vstack(feet), np.concatenate(targets)

    def _variable_bounds(self, joints: JointBounds) -> tuple[np.ndarray, np.ndarray]:
        free = np.full(6, UNBOUNDED)
        bounds = [(UNBOUNDED * (c.load > 0.0), *c.load_bounds, len(c.points)) for c in self.contacts]
        low = [np.tile([-side, -side, least], n) for side, least, _, n in bounds]
        high = [np.tile([side, side, most], n) for side, _, most, n in bounds]
        x_min = np.concatenate([-free, joints.ddq_min, *low, np.zeros(2)])
        x_max = np.concatenate([free, joints.ddq_max, *high, np.full(2, UNBOUNDED)])
        return x_min, x_max
