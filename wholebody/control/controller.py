"""The whole-body controller: state and reference in, joint command out, once per tick."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.pinocchio_model import stance_q
from models.spec import RobotSpec
from wholebody.collision.floor_clearance import FloorClearance
from wholebody.collision.proximity import Proximity
from wholebody.config import ControllerConfig
from wholebody.contacts.friction import pyramid_slope
from wholebody.control.base import Controller
from wholebody.control.gains import Gains
from wholebody.control.tick_report import TickLevel, TickReport
from wholebody.control.weights import Weights
from wholebody.errors import InputError
from wholebody.limits.base import ProgramLimit
from wholebody.limits.body import HeightLimit, OrientationLimit
from wholebody.limits.floor import FloorLimit
from wholebody.limits.joint import JointLimits, viable_acceleration_bounds
from wholebody.limits.self_collision import SelfCollisionLimit
from wholebody.qp.compiled_program import CompiledProgram
from wholebody.qp.formulation import InverseDynamics, JointBounds, Regularisation, WholeBodySolution
from wholebody.qp.kernels.targets import DAMPING
from wholebody.qp.problem import QPSolution, QuadraticProgram, check_further
from wholebody.qp.program_inputs import EXTRA_ROWS, ProgramInputs
from wholebody.qp.solvers import solve
from wholebody.robot.feet import Feet
from wholebody.tasks.base import Task
from wholebody.types import JointCommand, RobotState


class WholeBodyController(Controller):
    """Inverse-dynamics QP with an integrated desired state.

    The QP sees the measured state; its accelerations are integrated into a desired state that leaks towards the
    measured one, and the joints' position loops act around that: integrating from the measured state instead would
    make them useless.

    Args:
        spec: The robot.
        config: Its configuration.
        extra_tasks: Further tasks, beside those of `task_set.make_tasks`; they cost an update of `Robot` each tick.
        extra_limits: Further limits: soft rows like those of the balance.

    Attributes:
        q_des, dq_des: Desired joint positions [rad] and speeds [rad/s], Pinocchio order, shape (n_joints,).
        joints: Their limits, Pinocchio order.
    """

    def __init__(
        self,
        spec: RobotSpec,
        config: ControllerConfig | None = None,
        *,
        extra_tasks: Sequence[Task] = (),
        extra_limits: Sequence[ProgramLimit] = (),
    ) -> None:
        super().__init__(spec, config or ControllerConfig())
        self.extra_tasks, self.extra_limits = (*self.tasks.extra, *extra_tasks), tuple(extra_limits)
        self._make_limits()
        self.dynamics = InverseDynamics(self.robot, self.feet, Regularisation())
        self.joints, self._leak_time = self._joint_limits(), np.full(self.robot.n_joints, self.config.leak)
        self.tau, self.kp, self.kd = np.zeros(self.robot.n_joints), spec.kp, spec.kd
        self.compiled: CompiledProgram | None = None
        if self.config.solver == "compiled":
            self.compiled = CompiledProgram(self.inputs())
        self.q_des, self.dq_des = np.zeros((2, self.robot.n_joints)) if self.compiled is None else self.compiled.desired
        if self.compiled is not None:
            self.effort_max, self.tau_max = self.compiled.tick.effort_max, self.compiled.tick.tau_max
        self.bind_references()

    def bind_references(self) -> None:
        """Tasks and limits read their references where the program does."""
        super().bind_references()
        memory = self._reference
        self.pelvis_limit.bind(memory.pelvis)
        self.torso_limit.bind(memory.torso)
        self.height_limit.bind(memory.height)

    def inputs(self) -> ProgramInputs:
        """What the compiled program is made of."""
        return ProgramInputs(
            robot=self.robot,
            feet=self.feet,
            tasks=self.tasks,
            balance=self.balance,
            pelvis_limit=self.pelvis_limit,
            torso_limit=self.torso_limit,
            height_limit=self.height_limit,
            self_collision=self.self_collision,
            floor=self.floor,
            safety=self._safety,
            penalties=self.dynamics.regularisation,
            joints=self.joints,
            config=self.config,
            tau_max=self.effort_max,
            extra_rows=(EXTRA_ROWS * bool(self.extra_tasks), EXTRA_ROWS * bool(self.extra_limits)),
        )

    def _joint_limits(self) -> JointLimits:
        """Joint limits of the robot, with knees and elbows kept from where they are straight."""
        spec, robot, safety, order = self.spec, self.robot, self.config.safety, self.robot.motor_to_pin
        q_min, q_max, ddq_max = spec.position_min[order], spec.position_max[order], spec.acceleration_max[order]
        knees, elbows = spec.parts("knee")[order], spec.parts("elbow")[order]
        q_min[knees] = safety.knee_min
        q_max[elbows] = np.minimum(q_max[elbows], safety.elbow_max)
        fingers = np.isin(np.arange(robot.n_joints), self.tasks.fingers)
        brake = np.minimum(ddq_max, np.where(fingers, np.inf, safety.joint_brake))
        return JointLimits(q_min, q_max, spec.velocity_max[order], ddq_max, brake)

    def _make_limits(self) -> None:
        c, safety, spec = self.config, self.config.safety, self.spec
        bound = {"rate_max": safety.trunk_rate, "brake": safety.trunk_brake}
        self.pelvis_limit = OrientationLimit(spec.base_body, angle_max=safety.pelvis_angle, **bound)
        self.torso_limit = OrientationLimit(spec.torso_body, angle_max=safety.torso_angle, **bound)
        self.height_limit = HeightLimit(
            spec.base_body, band=safety.height_band, lowest=safety.height_lowest, brake=safety.height_brake
        )
        self._safety = c.bounds == "all"
        if not self._safety and c.bounds != "physics":
            raise InputError(f"bounds is '{c.bounds}'; it must be 'all' or 'physics'")
        limits = (self.balance, self.pelvis_limit, self.torso_limit, self.height_limit)
        self.limits: tuple[ProgramLimit, ...] = (*limits, *self.extra_limits) if self._safety else self.extra_limits
        q_stance = stance_q(spec, self.robot.model)
        proximity = Proximity(spec, self.robot.model, None, q_stance, safety.self_distance)
        fingers = 6 + self.tasks.fingers
        self.self_collision = SelfCollisionLimit(
            proximity, trigger=safety.self_trigger, brake=safety.self_brake, prescribed=fingers
        )
        self.floor = FloorLimit(
            FloorClearance(spec, self.robot.model, proximity.geometry),
            distance=safety.floor_distance,
            trigger=safety.floor_trigger,
            brake=safety.floor_brake,
            prescribed=fingers,
        )

    def stand_on_floor(self, feet: Feet) -> None:
        """Set slope and friction of the floor as `Controller` does; the program has both for all feet."""
        super().stand_on_floor(feet)
        self.floor.distance = self.config.safety.floor_distance + feet.floor(self.spec).rise
        self.dynamics = InverseDynamics(self.robot, self.feet, Regularisation())
        if self.compiled is not None:
            tick = self.compiled.tick
            tick.slope, tick.floor_distance = pyramid_slope(self.feet[0].friction), self.floor.distance

    def set_gains(self, gains: Gains) -> None:
        """Position loops and tasks have these gains from the next tick on."""
        self.kp, self.kd = gains.kp, gains.kd
        posture, fingers = self.tasks.posture, self.tasks.fingers
        for palm in self.palms:
            palm.kp, palm.kd = gains.hand_kp, gains.hand_kd
        posture.kp[fingers], posture.kd[fingers] = gains.finger_kp, gains.finger_kd
        if self.compiled is not None:
            tick = self.compiled.tick
            tick.hand_kp, tick.hand_kd = gains.hand_kp, gains.hand_kd
            tick.posture_kp[:], tick.posture_kd[:] = posture.kp, posture.kd

    def weigh(self, weights: Weights) -> None:
        """Weigh the tasks so from the next tick on; what they are is in the table of `wholebody.control.weights`."""
        legs = np.isin(
            self.robot.motor_to_pin, np.concatenate([self.spec.limbs["left_leg"], self.spec.limbs["right_leg"]])
        )
        tick, safety = None if self.compiled is None else self.compiled.tick, self.config.safety
        weights.apply(self.tasks, self.feet, legs, tick)
        self.pelvis_limit.angle_max = safety.pelvis_angle + weights.leans
        self.torso_limit.angle_max = safety.torso_angle + weights.leans
        if tick is not None:
            tick.pelvis_limit[0], tick.torso_limit[0] = self.pelvis_limit.angle_max, self.torso_limit.angle_max
        self._leak_time[:] = np.where(legs, *weights.leak)
        if self.balance.active != weights.balance:
            self.balance.active = weights.balance
            if self.compiled is not None:
                self.compiled.reset()

    def reset(self, state: RobotState) -> None:
        """Start from a measured state: the feet stay where they are."""
        self.q_des[:], self.dq_des[:] = state.q[7:], state.v[6:]
        self.set_down(state.q, state.v)
        if self.compiled is not None:
            self.compiled.forget()

    def _tick(self, state: RobotState) -> tuple[JointCommand, TickReport]:
        robot, compiled = self.robot, self.compiled
        if compiled is None:
            robot.update(state.q, state.v)
            report = self._solve()
            return self._command(state, report.solution), report
        self.place(state)
        compiled.tick.dt, compiled.tick.leak[:] = self._elapsed, self._leak
        for level in (TickLevel.FULL, TickLevel.NO_HANDS):
            hands = level is TickLevel.FULL
            if compiled.compute(state.q, state.v, hands=hands):
                compiled.integrate()
                answer = compiled.answer()
                robot.com, robot.com_velocity = answer.centre()
                self.tau = answer.torques()
                q, dq, tau = answer.command()
                command = JointCommand(state.time, q, dq, tau, self.kp, self.kd)
                return command, TickReport(answer.solution, answer.qp, level)
            report = self._fall_back(level, hands)
            if report.level is not TickLevel.FAILED:
                break
        return self._command(state, report.solution), report

    @property
    def _leak(self) -> np.ndarray:
        """Share of its difference from the measured state that the desired one forgets in this tick, a joint each."""
        return np.minimum(self._elapsed / self._leak_time, 1.0)

    def place(self, state: RobotState) -> None:
        """Tell the compiled program what further tasks and limits ask for at a state; without any, this is free."""
        robot = self.robot
        if not self.extra_tasks and not self.extra_limits:
            robot.place(state.q, state.v)
            return
        robot.update(state.q, state.v)
        objectives = [task.objective(robot) for task in self.extra_tasks]
        if self.compiled is not None:
            self.compiled.set_extra(objectives, [limit.rows(robot) for limit in self.extra_limits])

    def build(self, *, hands: bool = True) -> QuadraticProgram:
        """The program at the present state; without hands also the joint bounds are wide: the arms give way.

        Raises:
            InputError: If a further task or limit asks for something that is not finite.
        """
        robot = self.robot
        self.dynamics.pushed = self.pushed()
        low, high = viable_acceleration_bounds(robot.q[7:], robot.v[6:], self.joints, self.config.safety.joint_horizon)
        tau_max = self.tau_max
        objectives = [task.objective(robot) for task in self.tasks.body]
        if hands:
            objectives += [task.objective(robot) for task in self.palms]
        else:
            low, high, tau_max = np.full_like(low, -1e4), np.full_like(high, 1e4), self.effort_max
            slowed = self.tasks.posture.objective(robot)
            objectives[-1] = replace(slowed, target=-DAMPING * robot.v[6:])
        up = [task for task, foot in zip(self.tasks.feet, self.feet, strict=True) if self.swings and foot.load == 0.0]
        objectives += [task.objective(robot) for task in up]
        further = [task.objective(robot) for task in self.extra_tasks]
        rows = [limit.rows(robot) for limit in self.limits]
        for one in further:
            check_further("task", one.J, one.target, one.weight)
        for extra in rows[len(rows) - len(self.extra_limits) :]:
            check_further(f"limit {', '.join(extra.labels)}", extra.J, extra.upper)
        objectives += further
        collision = [self.floor.rows(robot), self.self_collision.rows(robot)] if self._safety else []
        return self.dynamics.build(objectives, JointBounds(low, high, tau_max), rows, collision)

    def _solve(self) -> TickReport:
        for level in (TickLevel.FULL, TickLevel.NO_HANDS):
            answer = self._solve_readable(level is TickLevel.FULL, (self.config.solver, self.config.fallback))
            if answer.ok:
                return TickReport(self.dynamics.read(answer), answer, level)
        return TickReport(None, answer, TickLevel.FAILED)

    def _solve_readable(self, hands: bool, solvers: tuple[str, ...]) -> QPSolution:
        program = self.build(hands=hands)
        answer = solve(program, solvers[0])
        for solver in solvers[1:]:
            if not answer.ok and solver != "none":
                answer = solve(program, solver)
        return answer

    def _fall_back(self, level: TickLevel, hands: bool) -> TickReport:
        """The readable program and the second solver, where the compiled answer is not acceptable."""
        robot = self.robot
        robot.update(robot.q, robot.v)
        if self.compiled is not None and self.config.fallback == "none":
            answer = self.compiled.answer(ok=False).qp()
        else:
            answer = self._solve_readable(hands, (self.config.fallback,))
        if not answer.ok:
            return TickReport(None, answer, TickLevel.FAILED)
        return TickReport(self.dynamics.read(answer), answer, level)

    def _command(self, state: RobotState, solution: WholeBodySolution | None) -> JointCommand:
        dt, leak = self._elapsed, self._leak
        if solution is None:
            ddq = -self.dq_des / 0.1
        else:
            ddq, self.tau = solution.dv[6:], solution.tau
        self.q_des += dt * self.dq_des + 0.5 * dt**2 * ddq + leak * (state.q[7:] - self.q_des)
        self.dq_des += dt * ddq + leak * (state.v[6:] - self.dq_des)
        # Fingers press on what they hold: their position loop acts around the reference, not the leaking state.
        i, posture = self.tasks.fingers, self.tasks.posture
        self.q_des[i], self.dq_des[i] = posture.q_ref[i], posture.dq_ref[i]
        np.clip(self.q_des, self.joints.q_min, self.joints.q_max, out=self.q_des)
        order = self.robot.pin_to_motor
        return JointCommand(state.time, self.q_des[order], self.dq_des[order], self.tau[order], self.kp, self.kd)
