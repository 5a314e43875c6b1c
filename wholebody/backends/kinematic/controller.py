"""The controller without dynamics: reference in, joint positions and speeds out, once per tick."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from wholebody.backends.kinematic.formulation import build, gravity_torques
from wholebody.backends.kinematic.program import KinematicProgram
from wholebody.backends.kinematic.workspace import KinematicInputs
from wholebody.config import ControllerConfig
from wholebody.control.reference_packet import BodyReference, PackedReference, ReferenceMemory, row_length
from wholebody.control.task_set import BodyTasks, make_feet, make_tasks
from wholebody.control.tick_report import TickLevel, TickReport
from wholebody.errors import InputError, StateError
from wholebody.limits.balance import CapturePointLimit
from wholebody.qp.problem import QuadraticProgram
from wholebody.qp.solvers import solve
from wholebody.robot.state import Robot
from wholebody.robot.support_polygon import convex_polygon
from wholebody.types import JointCommand, RobotState


class KinematicController:
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
        self.spec, self.config = spec, config or ControllerConfig(backend="kinematic")
        self.robot = robot = Robot(spec)
        tasks = make_tasks(spec, self.config, robot)
        if tasks.extra:
            raise InputError("the kinematic backend knows the built-in tasks only; `backend: native` takes more")
        self.palms, self.posture, self.com = tasks.palms, tasks.posture, tasks.com
        self.tasks = (tasks.com, tasks.torso, tasks.pelvis, tasks.height, tasks.posture, *tasks.palms)
        self.finger_indices = tasks.fingers
        self.feet, safety = make_feet(spec, self.config), self.config.safety
        self.balance = CapturePointLimit(margin=safety.balance_margin, gain=safety.balance_gain)
        order = robot.motor_to_pin
        self.joints = np.array([spec.position_min[order], spec.position_max[order], spec.velocity_max[order]])
        inputs = KinematicInputs(
            robot=robot,
            feet=self.feet,
            palms=tasks.palms,
            pelvis=tasks.pelvis,
            torso=tasks.torso,
            height=tasks.height,
            com=tasks.com,
            posture=tasks.posture,
            balance=self.balance,
            joints=self.joints,
            dt=self.config.dt,
        )
        self.compiled = KinematicProgram(inputs) if self.config.solver == "compiled" else None
        self._bind(tasks)
        self._measured = None if self.compiled is not None else Robot(spec)
        self.q, self.v, self.tau = pin.neutral(robot.model), np.zeros(robot.nv), np.zeros(robot.n_joints)

    def _bind(self, tasks: BodyTasks) -> None:
        """Tasks read their references where the program does."""
        compiled, n = self.compiled, self.robot.n_joints
        memory = ReferenceMemory(np.zeros(row_length(n)) if compiled is None else compiled.reference)
        trust = np.ones(2) if compiled is None else compiled.trust
        for i, palm in enumerate(tasks.palms):
            palm.bind(memory.palms[i], trust[i : i + 1])
        for name in ("com", "pelvis", "torso", "height", "posture"):
            getattr(tasks, name).bind(getattr(memory, name))
        self._reference = memory

    @property
    def q_des(self) -> np.ndarray:
        """Commanded joint positions, Pinocchio order, shape (n_joints,), [rad]."""
        return self.q[7:]

    def reset(self, state: RobotState) -> None:
        """Start from a measured state: the feet stay where they are."""
        self.q, self.v = state.q.copy(), np.zeros(self.robot.nv)
        self.robot.update(self.q, self.v)
        self.tau = self.robot.nle[6:].copy()
        points = np.vstack([foot.points_world(self.robot) for foot in self.feet])
        self.balance.support = convex_polygon(points[:, :2])
        for foot in self.feet:
            foot.T_world_ref = self.robot.pose(foot.frame).copy()
        if self.compiled is not None:
            self.compiled.reset()
            self.compiled.palms[:] = self._palm_frames() - self.q[:3]
            self.compiled.q[:] = self.q

    def step(self, state: RobotState, reference: BodyReference | PackedReference) -> tuple[JointCommand, TickReport]:
        """One tick.

        Args:
            state: Measured state; finite, and not changed afterwards.
            reference: What to follow; its accelerations are not used.

        Raises:
            StateError: If the controller was never reset.
            InputError: If a number of the reference is not finite.
        """
        if self.balance.support is None:
            raise StateError("`step` before `reset`: the controller does not know yet where the feet stand")
        self.set_reference(reference)
        report = self._compiled() if self.compiled is not None else self._readable(("daqp",))
        if report.level is TickLevel.FAILED:
            self.v = np.zeros(self.robot.nv)
        self.q = pin.integrate(self.robot.model, self.q, self.config.dt * self.v)
        self.tau = self._weight(state.q)
        return self._command(state.time), report

    def palm_positions(self) -> np.ndarray:
        """Palm points in world that were commanded by the last tick but one, shape (2, 3), [m]."""
        if self.compiled is None:
            return self._palm_frames()
        return self.compiled.palms + self.compiled.q[:3]

    def _palm_frames(self) -> np.ndarray:
        return np.array([self.robot.pose(palm.frame).translation for palm in self.palms])

    def trust_hands(self, trust: float) -> None:
        """Weigh both hands by this from now on, 0 to 1."""
        for palm in self.palms:
            palm.trust = trust

    def set_reference(self, reference: BodyReference | PackedReference) -> None:
        """Hand the reference to the tasks, without its accelerations: what is wanted is a velocity."""
        memory = self._reference
        memory.take(reference)
        for part, n in ((memory.com, 3), (memory.pelvis, 3), (memory.torso, 3), (memory.height, 1)):
            part[-n:] = 0.0
        for palm in memory.palms:
            palm[-6:] = 0.0
        memory.posture[2] = 0.0

    def build(self) -> QuadraticProgram:
        """The program at the present configuration, in readable Python."""
        self.robot.update(self.q, np.zeros(self.robot.nv))
        return build(self.robot, self.feet, self.tasks, self.balance, self.joints, self.config.dt)

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
        """The same in readable Python; it failed if there is no acceptable answer: the robot is told to stay."""
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
        return gravity_torques(self._measured, self.feet)

    def _command(self, time: float) -> JointCommand:
        order = self.robot.pin_to_motor
        return JointCommand(time, self.q[7:][order], self.v[6:][order], self.tau[order], self.spec.kp, self.spec.kd)
