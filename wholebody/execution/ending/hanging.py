"""A robot that hangs on a rope when it starts: found out, and held in its stance."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from models.pinocchio_model import stance_q
from wholebody.control.tick_report import TickReport
from wholebody.execution.ending.stiff_legs import STIFFEN, StiffLegs
from wholebody.execution.states import Event, Machine, State
from wholebody.execution.statuses import HANGING, PUT_DOWN
from wholebody.robot.state import Robot
from wholebody.types import JointCommand, RobotState, StatusReport

EARLY = 0.014
"""Time since the start within which it is found out [s]; measured: it is after 4 to 8 ms. Soles of a robot that was put
into a lean which it cannot hold jump after 16 ms."""
MEMORY = 0.02
"""Time over which legs are compared with what they were asked for [s]; chosen: ten periods at 500 Hz."""
RUNAWAY = 1.2
"""Speed that a joint of each leg gathers in that time beyond what was asked for [rad/s]; measured: 2.1 and 2.7, true
and realistic, of a robot that hangs. Of one that stands 0.5 at most, with motors of 15 Hz or deaf to torques."""
TURNS = 1.0
"""Speed with which both feet turn then [rad/s]; measured: 2 of a robot that hangs, 0.2 where motors cannot do what is
asked, but soles are on a floor."""
SPEED = 1.0
"""Speed of joints on their way to the stance [rad/s]; chosen: twice that of a robot that stands."""
CARRIED, STEADY, RESTS = 0.75, 0.1, 0.5
"""Share of the weight on the soles, for how long [s], and fastest joint [rad/s] of a robot that is put down; chosen: a
rope that is let down further takes the rest away within a moment."""
DAMPING = 1e-4
"""Of a leg's Jacobian, added to ``J J^T`` [m^2, no unit]; chosen: a straight leg tells no force along it."""


class Hanging:
    """Tells a robot that hangs by legs that run away from what was asked of them at first, and by feet that turn.

    By its torques it cannot be told from one that stands: they are what legs are asked for, and push against their
    stops. Held in its stance instead, on stiff legs, a robot that is put down presses the floor as its position loops
    say.

    Args:
        robot: Its model.
        states: What the robot follows.
    """

    def __init__(self, robot: Robot, states: Machine) -> None:
        spec, order = robot.spec, robot.motor_to_pin
        self._robot, self._stiff, self._stance = robot, StiffLegs(spec), stance_q(spec, robot.model)[7:]
        self._legs = [np.flatnonzero(np.isin(order, spec.limbs[leg])) for leg in ("left_leg", "right_leg")]
        self._feet = [robot.frame_id(foot.frame) for foot in spec.feet]
        self._kp, self._kd = spec.kp, spec.kd
        self._states = states
        self.reset()

    def reset(self) -> None:
        """It is taken to stand."""
        self._last: np.ndarray | None = None
        self._since = self._carried = 0.0
        self._away = np.zeros((2, len(self._legs[0])))
        self._stiff.reset()

    def look(self, state: RobotState, tick: TickReport | None, elapsed: float) -> StatusReport | None:
        """What a robot that hangs says, None if it does not; ``tick`` was asked for so long ago [s]."""
        if self._states.now is State.HANGING:
            return PUT_DOWN if self._carried >= STEADY else HANGING
        found = None if tick is None or self._since > EARLY else tick.solution
        if found is not None and self._last is not None:
            gathered = state.v - self._last - elapsed * found.dv
            self._away *= np.exp(-elapsed / MEMORY)
            self._away += [gathered[6 + leg] for leg in self._legs]
            if (np.abs(self._away).max(axis=1) > RUNAWAY).all() and self._turn(state) > TURNS:
                self._states.on(Event.HANGS)
                self._q = state.q[7:].copy()
        self._last, self._since = state.v, self._since + elapsed
        return HANGING if self._states.now is State.HANGING else None

    def _turn(self, state: RobotState) -> float:
        """Speed with which the foot turns that turns less [rad/s]."""
        model, data = self._robot.model, self._robot.scratch
        pin.forwardKinematics(model, data, state.q, state.v)
        return min(float(np.linalg.norm(pin.getFrameVelocity(model, data, foot).angular)) for foot in self._feet)

    def command(self, state: RobotState, elapsed: float) -> JointCommand:
        """What holds it, on its way to the stance, so long after the last one [s]."""
        robot = self._robot
        self._q += np.clip(self._stance - self._q, -SPEED * elapsed, SPEED * elapsed)
        gravity, order = pin.computeGeneralizedGravity(robot.model, robot.scratch, state.q)[6:], robot.pin_to_motor
        still = np.zeros(len(order))
        command = JointCommand(state.time, self._q[order], still, gravity[order], self._kp, self._kd)
        command = self._stiff.stiffened(command, True, max(elapsed, 0.1 * STIFFEN))
        off = (command.q - state.q[7:][order]) * command.kp - command.kd * state.v[6:][order]
        rests = np.abs(state.v[6:]).max() <= RESTS
        pressed = self._pressed(state.q, off[robot.motor_to_pin])
        stands = rests and pressed.sum() >= CARRIED and pressed.min() >= 0.25 * CARRIED
        self._carried = self._carried + elapsed if stands else 0.0
        return command

    def _pressed(self, q: np.ndarray, torque: np.ndarray) -> np.ndarray:
        """Share of the weight that presses each sole (2,), by torques beyond those of gravity (n,), Pinocchio order."""
        robot = self._robot
        pin.computeJointJacobians(robot.model, robot.scratch, q)
        pressed = []
        for foot, leg in zip(self._feet, self._legs, strict=True):
            axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            pin.updateFramePlacement(robot.model, robot.scratch, foot)
            J = pin.getFrameJacobian(robot.model, robot.scratch, foot, axes)[:, 6 + leg]
            force = np.linalg.solve(J @ J.T + DAMPING * np.eye(6), J @ -torque[leg])
            pressed.append(force[2] / (9.81 * robot.mass))
        return np.array(pressed)
