"""The whole-body program as placo's `DynamicsSolver` poses and solves it.

The equation of motion, contacts, Jacobians, drifts, limits and the solver are placo's; from us come the references, the
gains and the weights. Two rigid feet with four unilateral point forces each, as in `wholebody.qp.formulation`.

What placo has no rows for is missing: the angular momentum, the capture point's bounds, those of the trunk and of the
pelvis height, and the least normal force. So this is a second opinion on the dynamics, not on safety.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import placo

from models.placo_model import contact_frame, load_placo
from models.spec import RobotSpec
from models.urdf import light_urdf
from wholebody.backends.placo.tasks import mirror
from wholebody.collision.proximity import watched_pairs
from wholebody.config import SafetyConfig
from wholebody.contacts.foot import FootContact
from wholebody.contacts.friction import pyramid_slope
from wholebody.limits.joint import JointLimits
from wholebody.qp.formulation import Regularisation, WholeBodySolution
from wholebody.robot.state import Robot
from wholebody.tasks.base import Task


@dataclass(frozen=True)
class PlacoLimits:
    """Bounds that placo keeps as inequalities.

    Attributes:
        joints: Positions, speeds and decelerations, Pinocchio order.
        tau_max: Joint torques, Pinocchio order, shape (n_joints,), [N m].
        safety: Within what time a speed bound is to be met, and the distances between bodies.
    """

    joints: JointLimits
    tau_max: np.ndarray
    safety: SafetyConfig


class PlacoProgram:
    """One program a tick, from the state and the references that our own robot and tasks have at the time.

    Args:
        spec: The robot.
        robot: Ours, updated by the caller.
        feet: Rigid contacts.
        tasks: Ours; each has a counterpart in placo, see `wholebody.backends.placo.tasks`.
        limits: None leaves all inequalities out but those of the contacts.
        regularisation: The small costs.
    """

    def __init__(
        self,
        spec: RobotSpec,
        robot: Robot,
        feet: Sequence[FootContact],
        tasks: Sequence[Task],
        limits: PlacoLimits | None,
        regularisation: Regularisation,
    ) -> None:
        self.spec, self.robot, self.feet, self.limits = spec, robot, tuple(feet), limits
        self.placo = load_placo(spec, contact_points=True)
        self.solver = placo.DynamicsSolver(self.placo)
        self.solver.torque_cost = 0.0
        # placo regularises all variables alike here; what forces cost more is in the contacts.
        self.solver.problem.regularization = regularisation.acceleration
        added = [self._add_foot(i, regularisation) for i in range(len(self.feet))]
        self._rigid, self._contacts = [rigid for rigid, _ in added], [force for _, forces in added for force in forces]
        self._mirrors = [mirror(self.solver, task, robot) for task in tasks]
        self._collision = None
        if limits is not None:
            self._add_limits(limits)

    def _add_foot(self, index: int, regularisation: Regularisation) -> tuple:
        """Its frame task and its contacts, one a point."""
        foot, contact = self.spec.feet[index], self.feet[index]
        rigid = self.solver.add_frame_task(foot.frame, self.placo.get_T_world_frame(foot.frame))
        rigid.configure(foot.frame, "hard", 1.0, 1.0)
        for part in (rigid.position(), rigid.orientation()):
            part.kp, part.kd = contact.kp, contact.kd
        contacts = []
        for i in range(len(foot.points)):
            frame = contact_frame(foot, i)
            # Without weight: it only gives the contact its Jacobian, the frame task above holds the foot.
            point = self.solver.add_position_task(frame, np.zeros(3))
            point.configure(frame, "soft", 0.0)
            force = self.solver.add_unilateral_point_contact(point)
            force.mu = pyramid_slope(contact.friction)
            force.weight_forces = regularisation.force - regularisation.acceleration
            contacts.append(force)
        return rigid, contacts

    def _add_limits(self, limits: PlacoLimits) -> None:
        for i, name in enumerate(self.robot.joint_names):
            self.placo.set_joint_limits(name, float(limits.joints.q_min[i]), float(limits.joints.q_max[i]))
            self.placo.set_velocity_limit(name, float(limits.joints.dq_max[i]))
            self.solver.set_torque_limit(name, float(limits.tau_max[i]))
            self.solver.set_qdd_safe(name, float(limits.joints.brake[i]))
        self.solver.dt = limits.safety.joint_horizon
        self.solver.enable_torque_limits(True)
        with TemporaryDirectory() as folder:
            # placo measures every pair in every solve: all 1159 would take longer than everything else.
            path = Path(folder) / "collisions.json"
            every = json.loads(light_urdf(self.robot.spec).with_name("collisions.json").read_text())
            there = {frozenset(pair) for pair in every}
            watched = watched_pairs(hands=bool(sum(self.robot.spec.fingers)))
            # Of a robot with other names of bodies, all that are measured.
            path.write_text(json.dumps([pair for pair in watched if frozenset(pair) in there] or every))
            self.placo.load_collision_pairs(str(path))
        self._collision = self.solver.add_avoid_self_collisions_constraint()
        self._collision.self_collisions_margin = limits.safety.self_distance

    def solve(self, *, relaxed: bool = False) -> WholeBodySolution | None:
        """Solve at the present state and references.

        Args:
            relaxed: Without hands, joint limits and self-collision: the arms give way.

        Returns:
            The answer, its slacks zero; None if placo finds none.
        """
        self.placo.state.q, self.placo.state.qd = self.robot.q, self.robot.v
        self.placo.update_kinematics()
        for rigid, foot in zip(self._rigid, self.feet, strict=True):
            rigid.T_world_frame = (foot.T_world_ref or self.robot.pose(foot.frame)).homogeneous
        for task in self._mirrors:
            task.update(self.robot, relaxed=relaxed)
        if self.limits is not None:
            self.solver.enable_joint_limits(not relaxed)
            self.solver.enable_velocity_limits(not relaxed)
            trigger = self.limits.safety.self_distance + self.limits.safety.self_trigger
            self._collision.self_collisions_trigger = -np.inf if relaxed else trigger
        try:
            result = self.solver.solve(False)
        except RuntimeError:  # how placo reports a program without a solution, by version
            return None
        if not result.success:
            return None
        forces = np.array([contact.wrench for contact in self._contacts])
        return WholeBodySolution(result.qdd.copy(), forces, result.tau[6:].copy(), np.zeros(2))
