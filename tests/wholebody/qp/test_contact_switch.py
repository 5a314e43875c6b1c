"""Strategy: the programs with a foot up, against each other and against physics, and back on both feet to the bit.

States and references are drawn near the stance. A foot that is up carries nothing at all and is free to move, all of
the load is on the other one; a foot that is relieved carries no more than its share. The memory is that of both feet.
"""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import stance_q
from tests.support.body_cases import standing
from wholebody.backends.kinematic.controller import KinematicController
from wholebody.config import ControllerConfig
from wholebody.control.controller import WholeBodyController
from wholebody.control.weights import RECOVERING, WALKING, Weights
from wholebody.errors import InputError
from wholebody.robot.contact_schedule import Contacts
from wholebody.types import RobotState

UP = {"left": (0.0, 1.0), "right": (1.0, 0.0)}
"""Loads with that foot up."""


def make(kind=WholeBodyController, **config):
    controller = kind(g1(), ControllerConfig(**config))
    q = stance_q(controller.spec, controller.robot.model)
    controller.reset(RobotState(0.0, q, np.zeros(controller.robot.nv)))
    return controller, q


def drawn(controller, q, seed):
    rng = np.random.default_rng(seed)
    scale = np.where(np.arange(controller.robot.nv) < 18, 0.01, 0.1)
    size = scale * rng.normal(size=controller.robot.nv)
    return RobotState(0.0, pin.integrate(controller.robot.model, q, size), rng.permutation(size))


def answers(controller, state, contacts):
    controller.stand_on(contacts)
    controller.robot.update(state.q, state.v)
    _, report = controller.step(state, standing(controller, state.q))
    return report


@pytest.mark.parametrize("up", ["left", "right"])
def test_all_the_load_is_on_the_foot_that_stands(up):
    controller, q = make()
    feet, robot, stays = controller.contacts.feet, controller.robot, 1 if up == "left" else 0
    for seed in range(20):
        state = drawn(controller, q, seed)
        report = answers(controller, state, Contacts(feet, UP[up]))
        assert report.qp.solver == "compiled"
        solution = report.solution
        forces = np.split(solution.forces, 2)
        assert not forces[1 - stays].any()
        robot.update(state.q, state.v)
        lift = robot.mass * (9.81 + (robot.J_com @ solution.dv + robot.drift_com)[2])
        assert forces[stays][:, 2].sum() == pytest.approx(lift, abs=1e-5)
        balance = robot.M @ solution.dv + robot.nle
        balance[6:] -= solution.tau
        for foot, force in zip(controller.feet, forces, strict=True):
            balance -= foot.force_jacobian(robot, robot.jacobian(foot.frame)).T @ force.ravel()
        assert np.abs(balance).max() < 1e-6
        there, target = controller.feet[stays].acceleration(robot)
        assert np.abs(there @ solution.dv - target).max() < 1e-6
        swing, target = controller.feet[1 - stays].acceleration(robot)
        assert np.abs(swing @ solution.dv - target).max() > 1e-2


@pytest.mark.parametrize("up", ["left", "right"])
def test_the_compiled_program_is_the_readable_one_with_a_foot_up(up):
    (one, q), (other, _) = make(), make(solver="daqp")
    for seed in range(6):
        state, contacts = drawn(one, q, seed), Contacts(one.contacts.feet, UP[up])
        a, b = answers(one, state, contacts).solution, answers(other, state, contacts).solution
        for name in ("dv", "forces", "tau"):
            x, y = getattr(a, name), getattr(b, name)
            assert np.abs(x - y).max() < 2e-4 * max(1.0, np.abs(y).max()), name


def swings(controller, foot, lift=0.01):
    """Rows that lead a foot up from where it is, turning."""
    rows = np.zeros((2, 24))
    T = controller.robot.pose(controller.feet[foot].frame)
    rows[foot, :9], rows[foot, 9:12] = (T.rotation @ pin.exp3(np.array([0.0, 0.0, 0.02]))).ravel(), T.translation
    rows[foot, 11] += lift
    rows[foot, 12:18], rows[foot, 18:24] = (0.3, 0.1, 0.2, 0.0, 0.1, 0.2), (1.0, -1.0, 2.0, 0.5, 0.0, 1.0)
    return rows


@pytest.mark.parametrize("up", ["left", "right"])
@pytest.mark.parametrize("weights", [WALKING, RECOVERING])
def test_a_foot_that_is_up_follows_its_swing_in_both_programs(up, weights):
    (one, q), (other, _) = make(), make(solver="daqp")
    foot = 0 if up == "left" else 1
    for seed in range(3):
        answers_of = []
        for controller in (one, other):
            controller.weigh(weights)
            state = drawn(controller, q, seed)
            controller.robot.update(state.q, state.v)
            reference = standing(controller, state.q)
            contacts = Contacts(controller.contacts.feet, UP[up])
            told = {**vars(reference), "contacts": contacts, "swing": swings(controller, foot)}
            _, report = controller.step(state, type(reference)(**told))
            controller.robot.update(state.q, state.v)
            answers_of.append(report.solution)
            wanted = controller.tasks.feet[foot].objective(controller.robot)
            missed = np.linalg.norm((wanted.J @ report.solution.dv - wanted.target)[:3])
            assert missed < 0.3 * np.linalg.norm(wanted.target[:3])
        a, b = answers_of
        for name in ("dv", "forces", "tau"):
            x, y = getattr(a, name), getattr(b, name)
            assert np.abs(x - y).max() < 2e-4 * max(1.0, np.abs(y).max()), name


def test_weights_that_come_back_leave_no_trace():
    (one, q), (other, _) = make(), make()
    state = drawn(one, q, 3)
    one.weigh(WALKING)
    answers(one, state, one.contacts)
    one.weigh(Weights.standing(one.config))
    one.compiled.forget()
    one.reset(RobotState(0.0, q, np.zeros(one.robot.nv)))
    after, fresh = answers(one, state, one.contacts).solution, answers(other, state, other.contacts).solution
    for name in ("dv", "forces", "tau"):
        assert np.array_equal(getattr(after, name), getattr(fresh, name))


def test_a_share_of_the_load_alone_keeps_the_working_set():
    controller, q = make()
    state, feet = RobotState(0.0, q, np.zeros(controller.robot.nv)), controller.contacts.feet
    controller.robot.update(q, state.v)
    reference = standing(controller, q)
    for share in (1.0, 0.02, 0.01):
        told = {**vars(reference), "contacts": Contacts(feet, (1.0, share))}
        before = controller.compiled.active
        controller.set_reference(type(reference)(**told))
        assert controller.compiled.active == before
        _, report = controller.step(state, type(reference)(**told))
        assert np.split(report.solution.forces, 2)[1][:, 2].max() <= share * controller.config.force_max + 1e-6
    assert before > 0


def test_a_foot_set_down_again_leaves_no_trace():
    (one, q), (other, _) = make(), make()
    both, state = one.contacts, drawn(one, q, 1)
    before = answers(one, state, both).solution
    answers(one, state, Contacts(both.feet, UP["left"]))
    answers(one, state, Contacts(both.feet, UP["right"]))
    one.compiled.forget()
    after, fresh = answers(one, state, both).solution, answers(other, state, both).solution
    for name in ("dv", "forces", "tau"):
        assert np.array_equal(getattr(before, name), getattr(fresh, name))
        assert np.array_equal(getattr(after, name), getattr(fresh, name))


def test_a_relieved_foot_carries_no_more_than_its_share():
    controller, q = make()
    feet, most = controller.contacts.feet, controller.config.force_max
    state, loads = drawn(controller, q, 2), []
    for share in (1.0, 0.05, 0.01):
        forces = np.split(answers(controller, state, Contacts(feet, (1.0, share))).solution.forces, 2)[1][:, 2]
        assert forces.max() <= share * most + 1e-6
        assert forces.min() >= share * controller.config.force_min - 1e-6
        loads.append(forces.sum())
    assert loads[0] > loads[1] > loads[2] > 0.0


def test_a_reference_switches_the_contacts():
    controller, q = make()
    feet, state = controller.contacts.feet, RobotState(0.0, q, np.zeros(controller.robot.nv))
    controller.robot.update(q, state.v)
    reference = standing(controller, q)
    carried = []
    for contacts in (None, Contacts(feet, UP["right"]), None, Contacts(feet)):
        _, report = controller.step(state, type(reference)(**{**vars(reference), "contacts": contacts}))
        carried.append([bool(part.any()) for part in np.split(report.solution.forces, 2)])
    assert carried == [[True, True], [True, False], [True, False], [True, True]]
    assert len(controller.balance.support.vertices) > 4


@pytest.mark.parametrize("solver", ["compiled", "daqp"])
def test_the_kinematic_program_moves_the_leg_that_is_up(solver):
    controller, q = make(KinematicController, backend="kinematic", solver=solver)
    state, feet = RobotState(0.0, q, np.zeros(controller.robot.nv)), controller.contacts.feet
    robot = controller.robot
    robot.update(q, state.v)
    reference = standing(controller, q, lift=0.1)
    controller.stand_on(Contacts(feet, UP["right"]))
    controller.step(state, reference)
    robot.update(q, np.zeros(robot.nv))
    left, right = (np.abs(robot.jacobian(foot.frame) @ controller.v).max() for foot in controller.feet)
    assert left < 1e-6 < 1e-4 < right
    assert np.isfinite(controller.tau).all()


def test_a_backend_that_lifts_no_foot_says_so():
    placo = pytest.importorskip("wholebody.backends.placo.controller")
    controller, _ = make(placo.PlacoController, backend="placo")
    with pytest.raises(InputError, match="the placo backend stands on both feet"):
        controller.stand_on(Contacts(controller.contacts.feet, UP["left"]))
