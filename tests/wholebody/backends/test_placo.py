"""Strategy: the same tasks in our program and in placo's on random states at which nothing binds must give the same
accelerations, forces and torques; then placo's closes the loop over standing and the beginning of a reach.
"""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import stance_q
from policy.scripted.library import reach
from wholebody.backends.placo.controller import PlacoController
from wholebody.backends.placo.program import PlacoProgram
from wholebody.backends.placo.tasks import mirror
from wholebody.backends.registry import make_controller
from wholebody.bench.solvers import study
from wholebody.config import BodyConfig, ControllerConfig
from wholebody.control.controller import WholeBodyController
from wholebody.control.reference_packet import BodyReference, PalmReference
from wholebody.episode.run import EpisodeConfig
from wholebody.errors import InputError
from wholebody.qp.formulation import Regularisation
from wholebody.qp.solvers import solve
from wholebody.types import RobotState


@pytest.fixture(scope="module")
def ours():
    """Without what placo cannot say: angular momentum, and a least normal force."""
    body = replace(BodyConfig(), momentum_weight=0.0)
    controller = WholeBodyController(g1(), ControllerConfig(body=body, force_min=0.0))
    controller.reset(RobotState(0.0, stance_q(controller.spec, controller.robot.model), np.zeros(controller.robot.nv)))
    return controller


@pytest.fixture(scope="module")
def theirs(ours):
    tasks = [task for task in (*ours.tasks.body, *ours.palms) if task is not ours.tasks.momentum]
    return PlacoProgram(ours.spec, ours.robot, ours.feet, tasks, None, Regularisation())


@pytest.fixture(scope="module")
def backend():
    controller = PlacoController(g1())
    controller.reset(RobotState(0.0, stance_q(controller.spec, controller.robot.model), np.zeros(controller.robot.nv)))
    return controller


def place(controller, rng):
    """A random state with resting feet, and references near it with rates and accelerations of their own."""
    robot, spec = controller.robot, controller.spec
    q = stance_q(spec, robot.model)
    legs = np.array([any(part in name for part in ("hip", "knee", "ankle")) for name in robot.joint_names])
    q[7:][~legs] += rng.normal(0.0, 0.15, int((~legs).sum()))
    robot.update(q, np.zeros(robot.nv))
    J = np.vstack([robot.jacobian(foot.frame) for foot in controller.feet])
    v = rng.normal(0.0, 0.3, robot.nv)
    v -= np.linalg.pinv(J) @ (J @ v)
    robot.update(q, v)
    controller.set_reference(near(robot, spec, rng))


def near(robot, spec, rng):
    def small(size, scale):
        return rng.normal(0.0, scale, size)

    palms = []
    for tool in spec.tools:
        T = robot.pose(tool.palm_frame)
        pose = pin.SE3(pin.exp3(small(3, 0.01)) @ T.rotation, T.translation + small(3, 2e-3))
        twist = robot.velocity(tool.palm_frame) + small(6, 0.02)
        palms.append(PalmReference(T_world=pose, twist=twist, acceleration=small(6, 0.3)))
    trunk = []
    for frame in (spec.base_body, spec.torso_body):
        R = pin.exp3(small(3, 0.01)) @ robot.pose(frame).rotation
        trunk.append((R, robot.velocity(frame)[3:] + small(3, 0.01), small(3, 0.1)))
    n, q = robot.n_joints, robot.q.copy()
    q[7:] += small(n, 0.01)
    return BodyReference(
        palms=tuple(palms),
        q=q,
        dq=robot.v[6:] + small(n, 0.05),
        ddq=small(n, 0.3),
        pelvis=trunk[0],
        torso=trunk[1],
        height=(robot.q[2] + rng.normal(0.0, 2e-3), robot.velocity(spec.base_body)[2], rng.normal(0.0, 0.1)),
        com=(robot.com + small(3, 1e-3), robot.com_velocity + small(3, 0.01), small(3, 0.05)),
        momentum=(np.zeros(3), np.zeros(3)),
    )


@pytest.mark.parametrize("states", [40, pytest.param(200, marks=pytest.mark.regression)])
def test_the_same_tasks_give_the_same_accelerations_and_torques_where_nothing_binds(ours, theirs, states):
    rng, compared, worst_dv, worst_tau = np.random.default_rng(4), 0, 0.0, 0.0
    for _ in range(10 * states):
        place(ours, rng)
        answer = solve(ours.build())
        assert answer.ok
        if np.abs(answer.z).any() or np.abs(answer.z_box[:-2]).any():
            continue
        expected, found = ours.dynamics.read(answer), theirs.solve()
        scale = max(1.0, np.abs(expected.dv).max())
        worst_dv = max(worst_dv, np.abs(found.dv - expected.dv).max() / scale)
        worst_tau = max(worst_tau, np.abs(found.tau - expected.tau).max())
        np.testing.assert_allclose(found.forces, expected.forces, atol=1e-3)
        compared += 1
        if compared == states:
            break
    assert compared == states
    assert worst_dv < 1e-4
    assert worst_tau < 1e-3


def test_a_far_reference_pulls_placo_as_it_pulls_us(ours, theirs):
    """The proportional parts of our tasks are limited, placo's are not."""
    place(ours, np.random.default_rng(1))
    hand = ours.palms[0]
    hand.p_world_ref[0] += 0.5
    objective = hand.objective(ours.robot)
    theirs.solve()
    part = next(m for m in theirs._mirrors if getattr(m, "task", None) is hand).frame.position()
    np.testing.assert_allclose(part.A, objective.J[:3], atol=1e-9)
    np.testing.assert_allclose(part.b.ravel(), objective.target[:3], atol=1e-6)


def test_an_answer_that_breaks_the_equation_of_motion_is_noticed(backend):
    place(backend, np.random.default_rng(2))
    solution = backend.program.solve()
    assert backend.physics_error(solution) < 1e-6
    assert backend.physics_error(replace(solution, tau=solution.tau + 0.1)) > 0.05
    lifted = solution.forces.copy()
    lifted[0, 2] = -5.0
    assert backend.physics_error(replace(solution, forces=lifted)) > 1.0
    assert np.isnan(backend.physics_error(replace(solution, dv=np.full_like(solution.dv, np.nan))))


def test_a_tick_of_the_backend_is_placos(backend):
    q = stance_q(backend.spec, backend.robot.model)
    state = RobotState(0.0, q, np.zeros(backend.robot.nv))
    backend.reset(state)
    place(backend, np.random.default_rng(5))
    command, report = backend.step(state, near(backend.robot, backend.spec, np.random.default_rng(6)))
    assert (report.level, report.qp.solver) == (0, "placo")
    np.testing.assert_array_equal(command.tau, report.solution.tau[backend.robot.pin_to_motor])


def test_without_any_answer_the_last_torques_are_held(backend, monkeypatch):
    state = RobotState(0.0, stance_q(backend.spec, backend.robot.model), np.zeros(backend.robot.nv))
    backend.reset(state)
    place(backend, np.random.default_rng(3))
    monkeypatch.setattr(backend.program, "solve", lambda relaxed=False: None)
    report = backend._solve()
    assert report.level == 2
    assert report.solution is None


def test_a_task_that_placo_does_not_know_is_refused(ours, theirs):
    with pytest.raises(InputError, match="AngularMomentumTask"):
        mirror(theirs.solver, ours.tasks.momentum, ours.robot)


def test_an_unknown_backend_is_refused_with_those_that_exist():
    with pytest.raises(InputError, match="native, placo"):
        make_controller(g1(), ControllerConfig(backend="tsid"))


def test_placo_alone_stands_and_begins_a_reach():
    times = EpisodeConfig(settle=0.1, hold=0.1)
    (row,) = study(g1(), "placo", [reach(0.45, 1.0)], seconds=0.5, episode=times)
    assert row.solver == "placo"
    assert row.ticks == 350
    assert row.failures == 0
    assert not row.fell
    assert row.largest < 2e-3
    assert row.primal < 1e-6
