"""The controller without dynamics: reference in, joint positions and speeds out, once per tick."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from wholebody.backends.kinematic.formulation import build, gravity_torques
from wholebody.backends.kinematic.program import KinematicProgram
from wholebody.config import ControllerConfig
from wholebody.control.base import Controller
from wholebody.control.reference_packet import BodyReference, PackedReference
from wholebody.control.tick_report import TickLevel, TickReport
from wholebody.errors import InputError
from wholebody.qp.problem import QuadraticProgram
from wholebody.qp.program_inputs import BodyInputs
from wholebody.qp.solvers import solve
from wholebody.robot.state import Robot
from wholebody.types import JointCommand, RobotState


class KinematicController(Controller):
    """Inverse kinematics with hard feet, integrated; the measured state is looked at for the weight alone.

    What holds at every tick: feet at their places, the centre of mass at least ``safety.balance_margin`` inside the
    support, joint positions and speeds within their limits. What does not: accelerations, torques, friction, forces,
    distances between bodies and to the floor, the zero-moment point of fast motions. Feed-forward torques carry the
    weight of the measured configuration as if it stood still. Disturbances are not noticed: it is for slow motions, and
    for robots that another controller balances.

    Attributes:
        q: Configuration so far, shape (nq,); the commanded one.
        v: Velocity that led there, shape (nv,).
        tau: Torques that carry the weight, Pinocchio order, shape (n_joints,), [N m].
    """

    def __init__(self, spec: RobotSpec, config: ControllerConfig | None = None) -> None:
        super().__init__(spec, config or ControllerConfig(backend="kinematic"))
        robot, tasks, order = self.robot, self.tasks, self.robot.motor_to_pin
        if tasks.extra:
            raise InputError("the kinematic backend knows the built-in tasks only; `backend: native` takes more")
        self.joints = np.array([spec.position_min[order], spec.position_max[order], spec.velocity_max[order]])
        inputs = BodyInputs(
            robot=robot, feet=self.feet, tasks=tasks, balance=self.balance, joints=self.joints, config=self.config
        )
        self.compiled = KinematicProgram(inputs) if self.config.solver == "compiled" else None
        self.bind_references()
        self._measured = None if self.compiled is not None else Robot(spec)
        self.q, self.v, self.tau = pin.neutral(robot.model), np.zeros(robot.nv), np.zeros(robot.n_joints)

    @property
    def q_des(self) -> np.ndarray:
        """Commanded joint positions, Pinocchio order, shape (n_joints,), [rad]."""
        return self.q[7:]

    def reset(self, state: RobotState) -> None:
        """Start from a measured state: the feet stay where they are."""
        self.q, self.v = state.q.copy(), np.zeros(self.robot.nv)
        self.set_down(self.q, self.v)

    def _tick(self, state: RobotState) -> tuple[JointCommand, TickReport]:
        report = self._compiled() if self.compiled is not None else self._readable(("daqp",))
        if report.level is TickLevel.FAILED:
            self.v = np.zeros(self.robot.nv)
        self.q = pin.integrate(self.robot.model, self.q, self._elapsed * self.v)
        self.tau = self._weight(state.q)
        return self._command(state.time), report

    def set_reference(self, reference: BodyReference | PackedReference) -> None:
        """Hand the reference to the tasks, without its accelerations: what is wanted is a velocity."""
        super().set_reference(reference)
        memory = self._reference
        for part, n in ((memory.com, 3), (memory.pelvis, 3), (memory.torso, 3), (memory.height, 1)):
            part[-n:] = 0.0
        for palm in memory.palms:
            palm[-6:] = 0.0
        memory.posture[2] = 0.0

    def build(self) -> QuadraticProgram:
        """The program at the present configuration, in readable Python."""
        self.robot.update(self.q, np.zeros(self.robot.nv))
        tasks = [task for task in self.tasks.body if task is not self.tasks.momentum]
        return build(self.robot, self.standing, [*tasks, *self.palms], self.balance, self.joints, self.config.dt)

    def _compiled(self) -> TickReport:
        compiled, robot = self.compiled, self.robot
        if not compiled.compute(self.q):
            names = () if self.config.fallback == "none" else (self.config.fallback,)
            return self._readable(names)
        self.v = compiled.v.copy()
        robot.place(self.q, self.v)
        robot.com, robot.com_velocity = compiled.com.copy(), compiled.J_com @ self.v
        return TickReport(None, compiled.answer, TickLevel.FULL)

    def _readable(self, solvers: tuple[str, ...]) -> TickReport:
        """Answer of the readable formulation; without an acceptable one it failed, and the robot is told to stay."""
        program, answer = self.build(), None
        for name in solvers:
            answer = solve(program, name)
            if answer.ok:
                self.v = answer.x
                self.robot.com_velocity = self.robot.J_com @ self.v
                return TickReport(None, answer, TickLevel.FULL)
        return TickReport(None, answer or self.compiled.answer(), TickLevel.FAILED)

    def _weight(self, q: np.ndarray) -> np.ndarray:
        if self.compiled is not None:
            self.compiled.support(q)
            return self.compiled.tau.copy()
        self._measured.update(q, np.zeros(self.robot.nv))
        return gravity_torques(self._measured, self.standing)

    def _command(self, time: float) -> JointCommand:
        order = self.robot.pin_to_motor
        return JointCommand(time, self.q[7:][order], self.v[6:][order], self.tau[order], self.spec.kp, self.spec.kd)
