"""Strategy: the compiled program against the readable one on thousands of random states, active limits included.

The readable program is solved by daqp and polished for its active set, so that its answer is exact to rounding; the few
answers that are not are left out.
"""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from test_qp import standing

from models.g1 import g1
from models.pinocchio_model import stance_q
from wholebody.config import ControllerConfig
from wholebody.controller import PalmReference, WholeBodyController
from wholebody.qp import blocks_core as mem
from wholebody.qp.fast import ITERATION_LIMIT
from wholebody.qp.presolve import polish, prepare
from wholebody.qp.residuals import kkt_residuals
from wholebody.qp.solvers import solve
from wholebody.types import RobotState

ACTIVE = 1e-6
"""Multiplier from which a row counts as active."""
EXACT = 1e-10
"""Residuals of a reference answer that is fit to compare with."""
TOLERANCE = 1e-8
"""Largest |difference| / max(1, |value|) of accelerations, torques and forces."""


def make(config, hands=True):
    controller = WholeBodyController(g1(hands=hands), config)
    q = stance_q(controller.spec, controller.robot.model)
    controller.reset(RobotState(0.0, q, np.zeros(controller.robot.nv)))
    return controller, q


def draw(controller, q_stance, rng, size):
    """A state near the stance and a reference near the state, both scattered by ``size``; the feet nearly at rest."""
    robot = controller.robot
    joints = size * rng.normal(size=robot.nv) * np.where(np.arange(robot.nv) < 18, 0.02, 0.2)
    q = pin.integrate(robot.model, q_stance, joints)
    v = size * rng.normal(size=robot.nv) * np.where(np.arange(robot.nv) < 18, 0.05, 0.5)
    robot.update(q, v)
    reference = standing(controller, q_stance)
    palms = [
        PalmReference(
            T_world=robot.pose(tool.palm_frame) * pin.exp6(0.1 * size * rng.normal(size=6)),
            twist=size * rng.normal(size=6),
            acceleration=3.0 * size * rng.normal(size=6),
        )
        for tool in controller.spec.tools
    ]
    for task in controller.palms:
        task.share = rng.uniform(0.2, 1.0)
    dq, ddq = size * rng.normal(size=(2, robot.n_joints))
    return q, v, replace(reference, palms=tuple(palms), q=q_stance, dq=dq, ddq=ddq)


def solved(controller, q, v, reference, hands=True):
    """The compiled program's answer."""
    controller.robot.update(q, v)
    controller.set_reference(reference)
    controller.compiled.load_reference()
    controller.compiled.load_pairs()
    return controller.compiled.solve(q, v, hands=hands)


def at_rest(controller, q):
    """Palm references where the palms are."""
    controller.robot.update(q, np.zeros(controller.robot.nv))
    poses = [controller.robot.pose(tool.palm_frame).copy() for tool in controller.spec.tools]
    return tuple(PalmReference(T_world=pose, twist=np.zeros(6), acceleration=np.zeros(6)) for pose in poses)


def active_set(z, edges=()):
    """Which multipliers push, and at which side. The heels are in line: which of those edges binds is not defined."""
    return {(int(i) if i not in edges else "edge", bool(z[i] > 0.0)) for i in np.flatnonzero(np.abs(z) > ACTIVE)}


def readable(controller, hands):
    """The readable program's answer, exact where it can be polished."""
    # Measured once: from another guess, GJK finds another pair of nearest points between parallel faces.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(controller.self_collision.proximity, "update", lambda *_: None)
        program = controller.build(hands=hands)
    answer = solve(program)
    if not answer.ok:
        return answer
    prepared = prepare(program, slack=True)
    candidate = (answer.x / prepared.scale, answer.y, answer.z, answer.z_box * prepared.scale)
    x, y, z, z_box = prepared.restore(polish(prepared.program, candidate))
    residuals = kkt_residuals(program, x, y, z, z_box)
    return replace(answer, x=x, y=y, z=z, z_box=z_box, residuals=residuals)


def multipliers(controller, z):
    """Multipliers of the compiled program in the order of the readable one: rows and bounds."""
    compiled, nv, n = controller.compiled, controller.robot.nv, controller.robot.n_joints
    points = len(compiled.forces)
    edges, pairs = compiled.counts[mem.N_EDGES], compiled.counts[mem.N_PAIRS]
    soft = 2 * n + 5 * points
    trunk = soft + points
    rows = [z[n : 2 * n], z[2 * n + points : soft], z[soft : soft + edges], z[trunk : trunk + 15 + pairs]]
    box = np.zeros(nv + 3 * points + 2)
    box[6:nv], box[nv + 2 : -2 : 3], box[-2:] = z[:n], z[2 * n : 2 * n + points], z[-2:]
    return np.concatenate(rows), box


def difference(found, expected):
    return np.max(np.abs(found - expected) / np.maximum(1.0, np.abs(expected)))


@pytest.fixture(scope="module")
def default():
    return make(ControllerConfig())


@pytest.mark.parametrize(
    ("size", "hands", "states"), [(0.2, True, 600), (1.0, True, 600), (2.0, True, 600), (1.0, False, 400)]
)
def test_compiled_and_readable_program_have_the_same_answer(default, size, hands, states):
    controller, q_stance = default
    rng = np.random.default_rng(int(10 * size) + hands)
    active, differences = 0, []
    for _ in range(states):
        q, v, reference = draw(controller, q_stance, rng, size)
        found = solved(controller, q, v, reference, hands)
        expected = readable(controller, hands)
        assert found.ok, (controller.compiled.code, found.residuals)
        if not expected.residuals.within(EXACT, EXACT):
            continue
        solution, wanted = controller.compiled.read(found), controller.dynamics.read(expected)
        parts = ((solution.dv, wanted.dv), (solution.forces, wanted.forces), (solution.tau, wanted.tau))
        differences.append(max(difference(*part) for part in (*parts, (solution.slack, wanted.slack))))
        z, z_box = multipliers(controller, found.z)
        edges = (
            controller.robot.n_joints + 4 * len(solution.forces) + np.arange(controller.compiled.counts[mem.N_EDGES])
        )
        assert active_set(z, edges) == active_set(expected.z, edges)
        assert active_set(z_box[:-2]) == active_set(expected.z_box[:-2])
        active += len(active_set(z)) + len(active_set(z_box[:-2]))
    compared = len(differences)
    assert compared >= 0.75 * states
    # In one state of a thousand, two active rows are parallel but for 1e-6, and both answers are that much less exact.
    assert np.max(differences) <= 1e-6
    assert np.mean(np.array(differences) > TOLERANCE) <= 0.003
    assert active >= (10 if hands else 4) * compared, "the states are too easy: limits have to be active"


def test_a_robot_with_rubber_hands_has_the_same_answer_too():
    controller, q_stance = make(ControllerConfig(), hands=False)
    rng = np.random.default_rng(5)
    for _ in range(50):
        q, v, reference = draw(controller, q_stance, rng, 0.5)
        found = solved(controller, q, v, reference)
        expected = readable(controller, True)
        assert found.ok
        if expected.residuals.within(EXACT, EXACT):
            assert difference(found.x[: len(q) - 1], expected.x[: len(q) - 1]) <= TOLERANCE


def test_the_working_set_of_the_last_tick_changes_the_way_but_not_the_answer(default):
    controller, q_stance = default
    rng = np.random.default_rng(7)
    q, v, reference = draw(controller, q_stance, rng, 1.0)
    cold, warm = 0, 0
    for _ in range(50):
        q = pin.integrate(controller.robot.model, q, 0.002 * v)
        controller.compiled.reset()
        alone = solved(controller, q, v, reference)
        cold += controller.compiled.iterations
        again = controller.compiled.solve(q, v)
        warm += controller.compiled.iterations
        assert difference(again.x, alone.x) <= TOLERANCE
    assert warm == 50
    assert cold > 500


def test_where_the_robot_stands_does_not_matter(default):
    controller, q_stance = default
    q, v, reference = draw(controller, q_stance, np.random.default_rng(9), 0.5)
    here = solved(controller, q, v, replace(reference, palms=at_rest(controller, q)))
    tau = controller.compiled.tau.copy()
    far, moved = q.copy(), np.array([120.0, -80.0, 0.0])
    far[:3] += moved
    support = controller.balance.support
    controller.balance.support = replace(support, offsets=support.offsets + support.normals @ moved[:2])
    controller.compiled.reset()
    com = (reference.com[0] + moved, *reference.com[1:])
    there = solved(controller, far, v, replace(reference, com=com, palms=at_rest(controller, far)))
    controller.balance.support = support
    controller.compiled.reset()
    assert here.ok
    assert there.ok
    assert difference(controller.compiled.tau, tau) <= 1e-7


def test_an_answer_that_is_not_one_is_not_believed(default):
    controller, q_stance = default
    compiled = controller.compiled
    q, v, reference = draw(controller, q_stance, np.random.default_rng(11), 0.5)
    assert solved(controller, q, v, reference).ok
    for array, change in ((compiled.dv, 1e-3), (compiled.forces, 1e-2), (compiled.dv, np.nan)):
        assert compiled.solve(q, v).ok
        array[0] += change
        compiled.conclude()
        assert not compiled.judged().within(1e-6, 1e-6)


def test_no_answer_is_given_where_there_is_none_in_time_or_at_all(default):
    controller, q_stance = default
    compiled = controller.compiled
    q, v, reference = draw(controller, q_stance, np.random.default_rng(13), 1.0)
    compiled.counts[mem.ITERATION_LIMIT] = 3
    compiled.reset()
    assert not solved(controller, q, v, reference).ok
    assert compiled.code == mem.TOO_MANY_ITERATIONS
    compiled.counts[mem.ITERATION_LIMIT] = ITERATION_LIMIT
    fast = v.copy()
    fast[6:] = 60.0
    assert not solved(controller, q, fast, reference).ok
    assert compiled.code == mem.INFEASIBLE
    assert solved(controller, q, v, reference).ok


def test_the_command_is_that_of_the_readable_integration(default):
    controller, q_stance = default
    q, v, reference = draw(controller, q_stance, np.random.default_rng(17), 0.5)
    state = RobotState(0.25, q, v)
    controller.q_des[:], controller.dq_des[:] = q[7:] + 0.01, v[6:] - 0.02
    before = controller.compiled.desired.copy()
    found, report = controller.step(state, reference)
    assert report.qp.solver == "compiled"
    after = controller.compiled.desired.copy()
    controller.compiled.desired[:] = before
    expected = controller._command(state, report.solution)
    np.testing.assert_allclose(controller.compiled.desired, after, atol=1e-13)
    for name in ("time", "q", "dq", "tau", "kp", "kd"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-13)


def test_a_state_that_is_not_finite_has_no_answer(default):
    controller, q_stance = default
    q, v, reference = draw(controller, q_stance, np.random.default_rng(15), 0.5)
    v[8] = np.nan
    assert not solved(controller, q, v, reference).ok
