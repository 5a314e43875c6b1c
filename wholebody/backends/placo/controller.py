"""A second, independent backend of the controller: placo's dynamics and solver under the same references."""

from __future__ import annotations

from dataclasses import replace
from time import thread_time

import numpy as np

from models.spec import RobotSpec
from wholebody.backends.placo.program import PlacoLimits, PlacoProgram
from wholebody.config import ControllerConfig
from wholebody.control.controller import WholeBodyController
from wholebody.control.tick_report import TickLevel, TickReport
from wholebody.errors import InputError
from wholebody.qp.formulation import Regularisation, WholeBodySolution
from wholebody.qp.problem import QPSolution, Residuals
from wholebody.robot.contact_schedule import Contacts
from wholebody.tasks.momentum import AngularMomentumTask

PHYSICS_TOLERANCE = 1e-3
"""Largest error of an accepted answer in the equation of motion and the contacts [N, N m, m/s^2, rad/s^2]; chosen, no
trial is on record."""


class PlacoController(WholeBodyController):
    """The controller with placo's program in place of ours.

    References, the integrated desired state and the joint command are those of `WholeBodyController`; accelerations,
    forces and torques are placo's, and are judged by our own equation of motion before they are used.
    """

    def __init__(self, spec: RobotSpec, config: ControllerConfig | None = None) -> None:
        super().__init__(spec, replace(config or ControllerConfig(), solver="daqp"))
        if self.extra_tasks:
            raise InputError("the placo backend knows the built-in tasks only; `backend: native` takes more")
        tasks = [task for task in (*self.tasks.body, *self.palms) if not isinstance(task, AngularMomentumTask)]
        limits = PlacoLimits(self.joints, self.tau_max, self.config.safety)
        self.program = PlacoProgram(spec, self.robot, self.feet, tasks, limits, Regularisation())

    def _solve(self) -> TickReport:
        for level in (TickLevel.FULL, TickLevel.NO_HANDS):
            start = thread_time()
            solution = self.program.solve(relaxed=level is TickLevel.NO_HANDS)
            answer = self._judge(solution, start)
            if answer.ok:
                return TickReport(solution, answer, level)
        return TickReport(None, answer, TickLevel.FAILED)

    def _judge(self, solution: WholeBodySolution | None, start: float) -> QPSolution:
        """Placo's answer as a solution judged by us; it gives no multipliers, so optimality is not judged."""
        none, empty = np.zeros(0), np.zeros(self.dynamics.n)
        if solution is None:
            residuals = Residuals(np.inf, np.inf, np.inf)
            return QPSolution(empty, none, none, none, residuals, False, "placo", thread_time() - start)
        x = np.concatenate([solution.dv, solution.forces.ravel(), solution.slack])
        error = self.physics_error(solution)
        ok = bool(error <= PHYSICS_TOLERANCE)
        return QPSolution(x, none, none, none, Residuals(error, 0.0, 0.0), ok, "placo", thread_time() - start)

    def stand_on(self, contacts: Contacts) -> None:
        """Both feet stay there from now on; an `InputError` for contacts of which one is up or relieved."""
        if contacts.load != (1.0, 1.0):
            raise InputError("the placo backend stands on both feet; `backend: native` lifts one")
        super().stand_on(contacts)

    def physics_error(self, solution: WholeBodySolution) -> float:
        """Largest violation of the equation of motion, the rigid feet, the friction cones and the effort limits.

        By our own robot at the present state; NaN if anything is not a number [N, N m, m/s^2, rad/s^2].
        """
        robot, forces = self.robot, np.split(solution.forces, len(self.feet))
        balance = robot.M @ solution.dv + robot.nle
        balance[6:] -= solution.tau
        worst = [np.abs(solution.tau) - self.effort_max]
        for foot, force in zip(self.feet, forces, strict=True):
            J, target = foot.acceleration(robot)
            balance -= foot.force_jacobian(robot, J).T @ force.ravel()
            worst += [np.abs(J @ solution.dv - target), foot.cone_rows @ force.ravel()]
        return float(np.max(np.concatenate([np.abs(balance), *worst])))
