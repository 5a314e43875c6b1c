"""Strategy: a task and a limit that the package does not have, each one class with one method, through the compiled and
through the readable program: equal answers on random states, and each does what it is for.
"""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import stance_q
from tests.support.body_cases import standing
from wholebody.backends.kinematic.controller import KinematicController
from wholebody.config import ControllerConfig
from wholebody.control import task_set
from wholebody.control.controller import WholeBodyController
from wholebody.errors import InputError
from wholebody.limits.base import Rows
from wholebody.qp.program_inputs import EXTRA_ROWS
from wholebody.qp.solvers import solve
from wholebody.tasks.base import Objective
from wholebody.tasks.body_tasks import BodyTasks
from wholebody.types import RobotState

SPEC = g1()
POINT = np.array([2.0, 1.0, 0.9])
"""What the torso looks at, in world [m]."""


class LookAt:
    """Turn the x axis of a body towards a point: three rows, angular."""

    def __init__(self, frame, point, *, kp=40.0, kd=12.0, weight=20.0):
        self.frame, self.point, self.kp, self.kd, self.weight = frame, point, kp, kd, np.full(3, weight)

    def error(self, robot):
        """Rotation vector [rad], of the sine of the angle, from the x axis to the direction of the point."""
        T = robot.pose(self.frame)
        direction = self.point - T.translation
        return np.cross(T.rotation[:, 0], direction / np.linalg.norm(direction))

    def objective(self, robot):
        wanted = self.kp * self.error(robot) - self.kd * robot.velocity(self.frame)[3:]
        return Objective(robot.jacobian(self.frame)[3:], wanted - robot.drift(self.frame)[3:], self.weight)


class SpeedLimit:
    """No component of the velocity of a frame exceeds a speed: six rows."""

    def __init__(self, frame, speed, dt=0.02):
        self.frame, self.speed, self.dt = frame, speed, dt
        self.labels = tuple(f"speed.{axis}.{side}" for side in ("max", "min") for axis in "xyz")

    def rows(self, robot):
        J, v, drift = robot.jacobian(self.frame)[:3], robot.velocity(self.frame)[:3], robot.drift(self.frame)[:3]
        upper = [(self.speed - sign * v) / self.dt - sign * drift for sign in (1.0, -1.0)]
        return Rows(np.vstack([J, -J]), np.concatenate(upper), self.labels)


def make(config=None, **extra):
    controller = WholeBodyController(SPEC, config, **extra)
    q = stance_q(SPEC, controller.robot.model)
    controller.reset(RobotState(0.0, q, np.zeros(controller.robot.nv)))
    return controller, q


@pytest.mark.parametrize("bounds", ["all", "physics"])
def test_a_further_task_and_limit_have_the_same_answer_compiled_and_readable(bounds):
    limit = SpeedLimit(SPEC.tools[0].palm_frame, 0.05)
    controller, q0 = make(
        ControllerConfig(bounds=bounds), extra_tasks=[LookAt("torso_link", POINT)], extra_limits=[limit]
    )
    robot, rng, pushed = controller.robot, np.random.default_rng(6), 0
    for k in range(40):
        size = np.where(np.arange(robot.nv) < 18, 0.02, 0.1)
        q, v = pin.integrate(robot.model, q0, size * rng.normal(size=robot.nv)), size * rng.normal(size=robot.nv)
        controller.set_reference(standing(controller, q0))
        controller.place(RobotState(0.0, q, v))
        assert controller.compiled.compute(q, v, hands=k % 4 > 0)
        found = controller.compiled.answer().solution()
        expected = solve(controller.build(hands=k % 4 > 0))
        assert expected.ok
        wanted = controller.dynamics.read(expected)
        assert np.abs(found.dv - wanted.dv).max() < 1e-6 * max(1.0, np.abs(wanted.dv).max())
        assert np.abs(found.tau - wanted.tau).max() < 1e-6 * max(1.0, np.abs(wanted.tau).max())
        labels = controller.build().labels
        pushed += any(labels[i].startswith("speed.") for i in np.flatnonzero(np.abs(expected.z) > 1e-6))
    assert pushed > 10, "the states are too easy: the further limit has to bind"


def follow(controller, q, seconds):
    """Integrate the program's accelerations from rest."""
    model, v, dt = controller.robot.model, np.zeros(controller.robot.nv), controller.config.dt
    for k in range(round(seconds / dt)):
        _, report = controller.step(RobotState(k * dt, q, v), standing(controller, stance_q(SPEC, model)))
        assert report.level == 0
        assert report.qp.solver == "compiled"
        dv = report.solution.dv
        q, v = pin.integrate(model, q, dt * (v + 0.5 * dt * dv)), v + dt * dv
        yield q, v


def test_the_torso_turns_to_the_point_and_the_palm_keeps_its_speed():
    task, limit = LookAt("torso_link", POINT, weight=2000.0), SpeedLimit(SPEC.tools[0].palm_frame, 0.004)
    controller, q0 = make(extra_tasks=[task], extra_limits=[limit])
    robot = controller.robot
    robot.update(q0, np.zeros(robot.nv))
    before = np.linalg.norm(task.error(robot))
    fastest = 0.0
    for q, v in follow(controller, q0, 1.0):
        robot.update(q, v)
        fastest = max(fastest, np.abs(robot.velocity(limit.frame)[:3]).max())
    assert np.linalg.norm(task.error(robot)) < 0.7 * before
    assert 0.0035 < fastest < 0.0041


def test_one_line_in_the_task_set_is_enough(monkeypatch):
    made = task_set.make_tasks

    def with_look(spec, config, robot):
        tasks = made(spec, config, robot)
        return BodyTasks(**{**vars(tasks), "extra": (LookAt("torso_link", POINT),)})

    monkeypatch.setattr("wholebody.control.base.make_tasks", with_look)
    controller, q0 = make()
    assert isinstance(controller.extra_tasks[0], LookAt)
    assert len(list(follow(controller, q0, 0.02))) == 10
    with pytest.raises(InputError, match="backend: native"):
        KinematicController(SPEC)


@pytest.mark.parametrize("solver", ["compiled", "daqp", "quadprog", "piqp"])
def test_a_limit_that_is_not_finite_is_named_whatever_solves(solver):
    class Broken(SpeedLimit):
        def rows(self, robot):
            return replace(super().rows(robot), upper=np.full(6, np.nan))

    controller, q0 = make(ControllerConfig(solver=solver), extra_limits=[Broken("torso_link", 1.0)])
    controller.robot.update(q0, np.zeros(controller.robot.nv))
    with pytest.raises(InputError, match=r"limit speed\.x\.max.*not finite"):
        controller.step(RobotState(0.0, q0, np.zeros(controller.robot.nv)), standing(controller, q0))


def test_rows_without_room_are_refused():
    controller, q0 = make(extra_tasks=[LookAt("torso_link", POINT)])
    robot = controller.robot
    robot.update(q0, np.zeros(robot.nv))
    one = LookAt("torso_link", POINT).objective(robot)
    controller.compiled.set_extra([one] * (EXTRA_ROWS // 3), [])
    with pytest.raises(InputError, match=f"room for {EXTRA_ROWS} and 0"):
        controller.compiled.set_extra([one] * (EXTRA_ROWS // 3 + 1), [])
    for name in ("J", "target", "weight"):
        with pytest.raises(InputError, match="not finite"):
            controller.compiled.set_extra([replace(one, **{name: np.nan * getattr(one, name)})], [])
    with pytest.raises(InputError, match="room for"):
        controller.compiled.set_extra([], [SpeedLimit("torso_link", 1.0).rows(robot)])
