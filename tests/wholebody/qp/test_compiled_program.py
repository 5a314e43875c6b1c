"""Strategy: the compiled program against the readable one on thousands of random states, active limits included.

The readable program is solved by daqp, and for the active set that it found in extended precision: the answer is exact
for its data; the few whose active set is not the right one are left out. The data themselves are rounded, in different
ways in the two programs, and where active rows are nearly parallel that alone moves the answer by more than the
tolerance; how far is computed for each state.
"""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import stance_q
from tests.support.body_cases import standing
from tests.support.wide import wide
from wholebody.config import ControllerConfig, SafetyConfig
from wholebody.control.controller import WholeBodyController
from wholebody.control.reference_packet import PalmReference
from wholebody.qp.kernels.active_set import INFEASIBLE, TOO_MANY_ITERATIONS
from wholebody.qp.presolve import prepare
from wholebody.qp.program_inputs import ITERATION_LIMIT
from wholebody.qp.residuals import kkt_residuals
from wholebody.qp.solvers import solve
from wholebody.types import RobotState

ACTIVE = 1e-6
"""Multiplier from which a row counts as active."""
EXACT = 1e-10
"""Residuals of a reference answer that is fit to compare with."""
TOLERANCE = 1e-8
"""Largest |difference| / max(1, |value|) of accelerations, torques and forces."""
SCATTERED = ((0.2, True), (1.0, True), (2.0, True), (1.0, False))
"""How far states are scattered, and whether hands are led."""
ROUNDINGS = 4.0
"""Where rounding the data of the program moves its answer further than that: this many standard deviations of it."""


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
        task.trust = rng.uniform(0.2, 1.0)
    dq, ddq = size * rng.normal(size=(2, robot.n_joints))
    return q, v, replace(reference, palms=tuple(palms), q=q_stance, dq=dq, ddq=ddq)


def touch(controller, rng, size):
    """Each hand touches something half of the time, and pushes or is pushed; the support is tipped, the body leant."""
    if controller.compiled is None:
        return
    for row in controller.touch:
        told = rng.integers(2) * rng.normal(scale=5.0, size=3)
        wrench = min(size, 1.0) * np.concatenate([rng.normal(scale=10.0, size=3), rng.normal(size=3)])
        push, angle = rng.uniform(0.0, 30.0, 4), rng.uniform(-3.0, 3.0)
        axes = [*rng.uniform(50.0, 500.0, 3), *push[1:], np.cos(angle), np.sin(angle)]
        row[:] = [rng.uniform() * rng.integers(2), *wrench, push[0], 0.5, *told, *axes]
    controller.lean[:], controller.tipped[:] = 0.02 * rng.normal(size=(2, 2))
    controller.braced[:] = rng.uniform(0.0, 9.0)


def solved(controller, q, v, reference, hands=True):
    """The compiled program's answer."""
    controller.robot.update(q, v)
    controller.set_reference(reference)
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
    """The readable program's answer, exact where it can be, and how far rounding its data moves ``x`` and torques."""
    # Measured once: from another guess, GJK finds another pair of nearest points between parallel faces.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(controller.self_collision.proximity, "update", lambda *_: None)
        program = controller.build(hands=hands)
    answer = solve(program)
    if not answer.ok:
        return answer, np.inf, np.inf
    prepared = prepare(program, slack=True)
    z, z_box = answer.z, answer.z_box * prepared.scale
    exact, K, right, inverse = solve_active(prepared.program, z, z_box)
    n, n_eq = len(answer.x), len(answer.y)
    rows, box = np.flatnonzero(z), np.flatnonzero(z_box)
    z[rows], z_box[box] = exact[n + n_eq :][: len(rows)], exact[n + n_eq + len(rows) :]
    x, y, z, z_box = prepared.restore((exact[:n], exact[n : n + n_eq], z, z_box))
    residuals = kkt_residuals(program, x, y, z, z_box)
    noise = np.finfo(float).eps ** 2 * (K**2 @ exact**2 + right**2)
    moved = prepared.scale[:, None] * inverse[:n]
    torque = torque_map(controller) @ moved[:-2]
    spreads = (np.sqrt(rows_moved**2 @ noise) for rows_moved in (moved, torque))
    return replace(answer, x=x, y=y, z=z, z_box=z_box, residuals=residuals), *spreads


def solve_active(qp, z, z_box):
    """The program's answer if the rows with multipliers are all that bind; their system and its inverse."""
    rows, box, n = np.flatnonzero(z), np.flatnonzero(z_box), len(qp.g)
    E = np.vstack([qp.A, qp.C[rows], np.eye(n)[box]])
    sides = np.where(z > 0.0, qp.upper, qp.lower)[rows], np.where(z_box > 0.0, qp.x_max, qp.x_min)[box]
    right = np.concatenate([-qp.g, qp.b, *sides])
    K = np.block([[qp.H, E.T], [E, np.zeros((len(E), len(E)))]])
    # Rows that depend on each other make K singular; refinement takes the effect of the regularisation out.
    inverse = np.linalg.inv(K + np.diag(np.concatenate([np.full(n, 1e-9), np.full(len(E), -1e-9)])))
    answer, extended = np.zeros(len(right), dtype=np.longdouble), K.astype(np.longdouble)
    for _ in range(8):
        answer += inverse @ (right - extended @ answer).astype(float)
    return answer.astype(float), K, right, inverse


def torque_map(controller):
    """Joint torques for each acceleration and force, shape (n_joints, nv + n_forces)."""
    points = np.vstack(
        [foot.force_jacobian(controller.robot, foot.acceleration(controller.robot)[0]) for foot in controller.feet]
    )
    return np.hstack([controller.robot.M[6:], -points[:, 6:].T])


def multipliers(controller, z):
    """Multipliers of the compiled program in the order of the readable one: rows and bounds."""
    compiled, nv, n = controller.compiled, controller.robot.nv, controller.robot.n_joints
    points = len(compiled.forces)
    edges, pairs = compiled.tick.n_edges, compiled.tick.n_pairs
    soft = 2 * n + 5 * points
    trunk = soft + points
    low = len(controller.floor.underside.labels)
    near = trunk + 15 + np.flatnonzero(compiled.tick.soft_upper[points + 15 : points + 15 + low] < 1e300)
    first = trunk + 15 + low
    rows = [
        *(z[n : 2 * n], z[2 * n + points : soft], z[soft : soft + edges], z[trunk : trunk + 15]),
        *(z[near], z[first : first + pairs]),
    ]
    box = np.zeros(nv + 3 * points + 2)
    box[6:nv], box[nv + 2 : -2 : 3], box[-2:] = z[:n], z[2 * n : 2 * n + points], z[-2:]
    return np.concatenate(rows), box


def difference(found, expected, spread=0.0):
    """Largest scaled difference; next to where rounding moves the expected value further, a share of the tolerance."""
    size = np.maximum(1.0, np.abs(expected))
    allowed = np.maximum(1.0, ROUNDINGS * spread / (TOLERANCE * size))
    return np.max(np.abs(found - expected) / size / allowed)


@pytest.fixture(scope="module")
def default():
    return make(ControllerConfig())


@pytest.mark.parametrize(
    ("size", "hands", "states"),
    [
        *((size, hands, 200) for size, hands in SCATTERED),
        *wide(*((size, hands, 600) for size, hands in SCATTERED)),
    ],
)
def test_compiled_and_readable_program_have_the_same_answer(default, size, hands, states):
    controller, q_stance = default
    rng = np.random.default_rng(int(10 * size) + hands)
    active, differences, sensitive = 0, [], 0
    for _ in range(states):
        q, v, reference = draw(controller, q_stance, rng, size)
        found = solved(controller, q, v, reference, hands)
        expected, spread, torque_spread = readable(controller, hands)
        assert found.ok, (controller.compiled.code, found.residuals)
        if not expected.residuals.within(EXACT, EXACT):
            continue
        solution, wanted = controller.compiled.answer().solution(), controller.dynamics.read(expected)
        parts = ((found.x, expected.x, spread), (solution.tau, wanted.tau, torque_spread))
        differences.append(max(difference(*part) for part in parts))
        sensitive += any(difference(value + ROUNDINGS * far, value) > TOLERANCE for _, value, far in parts)
        z, z_box = multipliers(controller, found.z)
        edges = controller.robot.n_joints + 4 * len(solution.forces) + np.arange(controller.compiled.tick.n_edges)
        assert active_set(z, edges) == active_set(expected.z, edges)
        assert active_set(z_box[:-2]) == active_set(expected.z_box[:-2])
        active += len(active_set(z)) + len(active_set(z_box[:-2]))
    compared = len(differences)
    assert compared >= 0.85 * states
    assert np.max(differences) <= TOLERANCE
    assert sensitive <= 0.02 * states
    assert active >= (10 if hands else 4) * compared, "the states are too easy: limits have to be active"


def test_a_robot_whose_hands_touch_has_the_same_answer_too():
    """Bias forces and the forces on the hands cancel in part, which rounds ten times more than the data themselves."""
    controller, q_stance = make(ControllerConfig())
    rng, differences, without = np.random.default_rng(7), [], 0
    for _ in range(200):
        q, v, reference = draw(controller, q_stance, rng, 0.5)
        plain = solved(controller, q, v, reference).x
        touch(controller, rng, 0.5)
        found = solved(controller, q, v, reference)
        expected, spread, _ = readable(controller, True)
        controller.touch[:], controller.lean[:], controller.tipped[:], controller.braced[:] = 0.0, 0.0, 0.0, 0.0
        assert found.ok
        without += np.allclose(plain, found.x)
        if expected.residuals.within(EXACT, EXACT):
            differences.append(difference(found.x, expected.x, spread))
    assert len(differences) >= 170
    assert np.max(differences) <= 10.0 * TOLERANCE
    assert without < 10, "touches have to make a difference"


def test_a_robot_with_rubber_hands_has_the_same_answer_too():
    controller, q_stance = make(ControllerConfig(), hands=False)
    rng = np.random.default_rng(5)
    for _ in range(50):
        q, v, reference = draw(controller, q_stance, rng, 0.5)
        found = solved(controller, q, v, reference)
        expected, spread, _ = readable(controller, True)
        assert found.ok
        if expected.residuals.within(EXACT, EXACT):
            assert difference(found.x, expected.x, spread) <= TOLERANCE


@pytest.mark.parametrize("hands", [True, False])
def test_hands_near_the_floor_have_the_same_answer_too(hands):
    # The hands of the stance are 0.82 m high: a floor up there is as near to them as one needs.
    safety = replace(SafetyConfig(), floor_distance=0.80)
    controller, q_stance = make(ControllerConfig(safety=safety), hands=hands)
    rng, active, compared = np.random.default_rng(19), 0, 0
    for _ in range(200):
        q, v, reference = draw(controller, q_stance, rng, 0.7)
        found = solved(controller, q, v, reference)
        expected, spread, _ = readable(controller, True)
        assert found.ok
        if expected.residuals.within(EXACT, EXACT):
            assert difference(found.x, expected.x, spread) <= TOLERANCE
            rows, _ = multipliers(controller, found.z)
            assert active_set(rows) == active_set(expected.z)
            labels = controller.build().labels
            active += sum(labels[i].startswith("floor.") for i in np.flatnonzero(np.abs(rows) > ACTIVE))
            compared += 1
    assert compared >= 170
    assert active >= 0.5 * compared


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
        assert not compiled.conclude()


def test_no_answer_is_given_where_there_is_none_in_time_or_at_all(default):
    controller, q_stance = default
    compiled = controller.compiled
    q, v, reference = draw(controller, q_stance, np.random.default_rng(13), 1.0)
    compiled.tick.iteration_limit = 3
    compiled.reset()
    assert not solved(controller, q, v, reference).ok
    assert compiled.code == TOO_MANY_ITERATIONS
    compiled.tick.iteration_limit = ITERATION_LIMIT
    fast = v.copy()
    fast[6:] = 60.0
    assert not solved(controller, q, fast, reference).ok
    assert compiled.code == INFEASIBLE
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


def test_an_answer_does_not_depend_on_episodes_before_it():
    """Distances were searched for from where the last episode had left off: answers differed in their last digits."""
    controller, q_stance = make(ControllerConfig())
    rng = np.random.default_rng(3)
    cases = [draw(controller, q_stance, rng, 1.0) for _ in range(20)]

    def answer(q, v, reference):
        controller.reset(RobotState(0.0, q_stance, np.zeros(controller.robot.nv)))
        return solved(controller, q, v, reference)

    first = [answer(*case).x for case in cases]
    for case, before in zip(reversed(cases), reversed(first), strict=True):
        np.testing.assert_array_equal(answer(*case).x, before)
