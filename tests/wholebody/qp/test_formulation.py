"""Strategy: the program at the stance, looked at without a solver, then solved by every solver and judged by ours."""

import numpy as np
import pytest

from models import g1
from models.pinocchio_model import stance_q
from tests.support.body_cases import standing
from wholebody.config import ControllerConfig
from wholebody.control.controller import WholeBodyController
from wholebody.errors import InputError
from wholebody.qp.residuals import kkt_residuals
from wholebody.qp.solvers import solve
from wholebody.types import RobotState


@pytest.fixture(scope="module")
def made():
    return WholeBodyController(g1(), ControllerConfig())


@pytest.fixture
def controller(made):
    """Standing, whatever was asked of it before."""
    q = stance_q(made.spec, made.robot.model)
    made.reset(RobotState(0.0, q, np.zeros(made.robot.nv)))
    made.set_reference(standing(made, q))
    return made


def test_standing_needs_no_acceleration_and_carries_the_weight(controller):
    answer = solve(controller.build())
    assert answer.ok
    solution = controller.dynamics.read(answer)
    assert np.abs(solution.dv).max() < 0.05
    weight = 9.81 * controller.robot.mass
    np.testing.assert_allclose(solution.forces[:, 2].sum(), weight, rtol=1e-3)
    assert (solution.forces[:, 2] >= controller.config.force_min - 1e-6).all()


def test_the_torques_are_those_of_inverse_dynamics_under_the_forces(controller):
    solution = controller.dynamics.read(solve(controller.build()))
    robot = controller.robot
    generalised = robot.M @ solution.dv + robot.nle
    for i, foot in enumerate(controller.feet):
        J = foot.force_jacobian(robot, robot.jacobian(foot.frame))
        generalised -= J.T @ solution.forces[4 * i : 4 * i + 4].ravel()
    np.testing.assert_allclose(generalised[:6], 0.0, atol=1e-5)
    np.testing.assert_allclose(generalised[6:], solution.tau, atol=1e-8)


@pytest.mark.parametrize("solver", ["quadprog", "proxqp"])
def test_exact_solvers_agree_with_daqp(controller, solver):
    controller.set_reference(standing(controller, controller.robot.q, lift=0.01))
    program = controller.build()
    expected, answer = solve(program), solve(program, solver)
    assert expected.ok
    assert answer.ok, answer.residuals
    np.testing.assert_allclose(answer.x[: controller.robot.nv], expected.x[: controller.robot.nv], atol=1e-2)


def test_a_wrong_solution_is_not_believed(controller):
    program = controller.build()
    answer = solve(program)
    worse = answer.x.copy()
    worse[0] += 0.1
    residuals = kkt_residuals(program, worse, answer.y, answer.z, answer.z_box)
    assert not residuals.within(1e-5, 1e-6)
    worse[0] = np.nan
    assert not kkt_residuals(program, worse, answer.y, answer.z, answer.z_box).within(1e9, 1e9)


def test_an_unknown_solver_is_refused_with_those_that_exist(controller):
    with pytest.raises(InputError, match="daqp"):
        solve(controller.build(), "gurobi")
