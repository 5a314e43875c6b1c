"""Strategy: wrist poses come from random postures inside all bounds; Pinocchio judges the answers."""

import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import wholebody
from models import g1
from tests.support.posture_cases import PostureCases
from wholebody.config import ControllerConfig
from wholebody.errors import InputError
from wholebody.execution.supervisor import Supervisor
from wholebody.planning.posture import PostureSolver
from wholebody.planning.still_postures import PostureLimit
from wholebody.sim.plant import MujocoPlant
from wholebody.types import RobotState

SPEC, CONFIG = g1(), ControllerConfig()
PAIRS = 30
POSITION, ORIENTATION = 1e-3, np.deg2rad(0.2)
STEPS = 45
"""Bar for the median number of Gauss-Newton steps of a solution; measured 30. `docs/planner.md` has the time."""


@pytest.fixture(scope="module")
def cases():
    return PostureCases(SPEC, CONFIG)


@pytest.fixture(scope="module")
def solver():
    return PostureSolver(SPEC, CONFIG)


def stance_wrists(cases):
    return cases.wrist_poses(cases.body.q_full)


def moved(T, offset):
    out = T.copy()
    out[:3, 3] += offset
    return out


def test_c1_joint_targets_for_two_wrist_poses_are_balanced_and_reach_them(cases, solver, monkeypatch):
    generator, steps, missed = np.random.default_rng(3), [], 0
    problem = solver._one._problem
    monkeypatch.setattr(problem, "still_step", lambda k: steps.append(1) or type(problem).still_step(problem, k))
    counts = []
    for _ in range(PAIRS):
        targets = cases.wrist_poses(cases.draw(generator))
        steps.clear()
        found = solver.solve(*targets)
        counts.append(len(steps))
        missed += not found.reached
        assert cases.keeps_bounds(found.q)
        assert cases.foot_error(found.q) < 1e-5
        assert found.reached == (not found.reasons)
        for got, wanted, say, turn in zip(
            cases.wrist_poses(found.q), targets, found.position_error, found.orientation_error, strict=True
        ):
            assert np.linalg.norm(got[:3, 3] - wanted[:3, 3]) == pytest.approx(say, abs=1e-9)
            assert np.linalg.norm(pin.log3(got[:3, :3].T @ wanted[:3, :3])) == pytest.approx(turn, abs=1e-6)
            assert not found.reached or (say <= POSITION and turn <= ORIENTATION)
    assert missed <= 0.02 * PAIRS
    assert np.median(counts) < STEPS, sorted(counts)


def test_torques_and_joints_are_by_name_and_those_of_the_configuration(cases, solver):
    found = solver.solve(*stance_wrists(cases))
    assert found.reached
    assert list(found.joints) == list(cases.model.names)[2:]
    assert list(found.joints.values()) == found.q[7:].tolist()
    assert set(found.joints) == set(SPEC.joint_names)
    gravity = pin.computeGeneralizedGravity(cases.model, cases.data, found.q)
    for name, torque in found.torques.items():
        assert torque == pytest.approx(gravity[cases.model.joints[cases.model.getJointId(name)].idx_v], abs=1e-6)
    assert found.margins[PostureLimit.BALANCE] == pytest.approx(cases.edges(found.q), abs=1e-6)
    assert set(found.margins) == set(PostureLimit) - {PostureLimit.NOT_FOUND}


@pytest.mark.parametrize("offset", [(2.0, 0.0, 0.0), (0.0, 0.0, -1.5), (-0.5, 0.0, 0.0), (100.0, 0.0, 0.0)])
def test_c1_out_of_reach_is_the_nearest_posture_inside_the_bounds_and_says_why(cases, solver, offset):
    left, right = stance_wrists(cases)
    found = solver.solve(moved(left, offset), moved(right, offset))
    assert not found.reached
    assert found.reasons
    assert cases.keeps_bounds(found.q)
    assert cases.foot_error(found.q) < 1e-5


def test_both_hands_in_one_place_are_refused_by_the_distance_between_them(cases, solver):
    left, _ = stance_wrists(cases)
    between = moved(left, [0.1, -left[1, 3], 0.1])
    found = solver.solve(between, between)
    assert PostureLimit.DISTANCE in found.reasons
    assert cases.keeps_bounds(found.q)


def test_a_solution_does_not_depend_on_those_before(cases, solver):
    generator = np.random.default_rng(5)
    first, second = (cases.wrist_poses(cases.draw(generator)) for _ in range(2))
    alone = solver.solve(*first).q
    solver.solve(*second)
    np.testing.assert_array_equal(solver.solve(*first).q, alone)


def test_a_wider_margin_asked_for_is_the_one_kept(cases):
    posture = replace(CONFIG.planner.posture, com_margin=0.06)
    config = replace(CONFIG, planner=replace(CONFIG.planner, posture=posture))
    found = wholebody.solve(*stance_wrists(cases), config=config)
    assert found.margins[PostureLimit.BALANCE] < wholebody.solve(*stance_wrists(cases)).margins[PostureLimit.BALANCE]


def test_a_solution_says_in_words_what_it_is_and_what_is_in_the_way(cases, solver):
    left, right = stance_wrists(cases)
    assert str(solver.solve(left, right)).startswith("reached: left wrist 0.0 mm and 0.0 deg off")
    text = str(solver.solve(moved(left, (0.0, 0.0, -1.5)), right))
    assert "not reached" in text
    assert any(f"because {limit.sentence}" in text for limit in PostureLimit)
    assert "N m" in text


def test_every_step_on_the_way_to_a_posture_is_balanced_and_the_last_one_is_the_posture(cases, solver):
    generator = np.random.default_rng(5)
    for _ in range(10):
        found = solver.solve(*cases.wrist_poses(cases.draw(generator)))
        path = solver.path_to(found)
        path.chunk.validate()
        assert len(path.chunk) == len(path.q) == 91
        assert path.clear
        assert all(cases.keeps_bounds(q) for q in path.q)
        np.testing.assert_allclose(path.q[0], cases.body.q_full, atol=1e-6)
        np.testing.assert_allclose(path.q[-1], found.q, atol=1e-6)
        for k in range(0, 91, 9):
            for T, wanted in zip(cases.wrist_poses(path.q[k]), wrists_of(path.chunk, k), strict=True):
                np.testing.assert_allclose(T, wanted, atol=1e-9)
        assert path.margins[PostureLimit.BALANCE] == pytest.approx(min(cases.edges(q) for q in path.q), abs=1e-6)


def wrists_of(chunk, k):
    return chunk.T_world_lhand[k], chunk.T_world_rhand[k]


def test_where_the_straight_way_meets_a_bound_the_robot_goes_around(cases, solver):
    generator, around = np.random.default_rng(5), 0
    for _ in range(20):
        found = solver.solve(*cases.wrist_poses(cases.draw(generator)))
        straight = [pin.interpolate(cases.model, cases.body.q_full, found.q, x) for x in np.linspace(0.0, 1.0, 20)]
        if all(cases.keeps_bounds(q) for q in straight):
            continue
        around += 1
        assert solver.path_to(found).clear
    assert around >= 2


def test_a_way_begins_where_the_robot_is_and_at_its_time(cases, solver):
    generator = np.random.default_rng(8)
    first, second = (solver.solve(*cases.wrist_poses(cases.draw(generator))) for _ in range(2))
    q = first.q.copy()
    q[cases.body.fingers] *= 0.5
    path = solver.path_to(second, RobotState(7.5, q, np.zeros(cases.model.nv)), duration=2.0, fps=20.0, seq=4)
    assert (path.chunk.t_obs, path.chunk.seq, path.chunk.fps, len(path.chunk)) == (7.5, 4, 20.0, 41)
    np.testing.assert_allclose(path.q[0], q, atol=1e-6)
    np.testing.assert_allclose(path.chunk.q_lhand[0], q[cases.body.fingers[:7]], atol=1e-9)
    np.testing.assert_allclose(path.chunk.q_rhand[-1], second.q[cases.body.fingers[7:]], atol=1e-9)
    speeds = np.abs(np.diff(cases.body.body_of(path.q)[:, 7:], axis=0)).max(axis=1)
    assert speeds[0] < 0.1 * speeds.max()
    assert speeds[-1] < 0.1 * speeds.max()


def test_a_robot_goes_to_a_posture_and_stays_there(cases, solver):
    found = solver.solve(*cases.wrist_poses(cases.draw(np.random.default_rng(2))))
    supervisor, plant = Supervisor(SPEC), MujocoPlant(SPEC)
    state = plant.reset()
    supervisor.reset(state)
    supervisor.accept(solver.path_to(found, state).chunk)
    while state.time < 4.5:
        state = plant.step(supervisor.step(state))
    wrists = zip(cases.wrist_poses(state.q), cases.wrist_poses(found.q), strict=True)
    assert max(np.linalg.norm(T[:3, 3] - wanted[:3, 3]) for T, wanted in wrists) < 1e-3


@pytest.mark.parametrize(("duration", "fps"), [(0.0, 30.0), (-1.0, 30.0), (np.nan, 30.0), (1e9, 30.0), (3.0, 0.0)])
def test_a_way_that_takes_no_time_or_for_ever_is_refused(cases, solver, duration, fps):
    found = solver.solve(*stance_wrists(cases))
    with pytest.raises(InputError, match="are possible"):
        solver.path_to(found, duration=duration, fps=fps)


def test_what_is_no_solution_is_refused():
    with pytest.raises(InputError, match=r"posture is a ndarray; give what `wholebody\.solve` returns"):
        wholebody.path_to(np.zeros(50), None)


def test_a_way_to_a_posture_that_misses_its_targets_says_so(cases, solver):
    left, right = stance_wrists(cases)
    (note,) = solver.path_to(solver.solve(moved(left, (2.0, 0.0, 0.0)), right)).chunk.notes
    assert re.match(r"goes to the nearest posture found, not reached: left wrist \d+\.\d mm and .* off; because ", note)
    assert not solver.path_to(solver.solve(left, right)).chunk.notes


def test_a_start_that_is_no_state_is_refused(cases, solver):
    found = solver.solve(*stance_wrists(cases))
    with pytest.raises(InputError, match="finite"):
        solver.path_to(found, RobotState(0.0, np.full(50, np.nan), np.zeros(49)))


@pytest.mark.parametrize(
    ("T", "message"),
    [
        (np.full((4, 4), np.nan), r"\[0, 0\] is nan; give a finite pose"),
        (np.eye(3), r"shape \(3, 3\)"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "rotation"),
        (np.diag([1.0, 1.0, 1.1, 1.0]), "rotation"),
        (np.eye(4) * 2.0, r"last row is \[0.0, 0.0, 0.0, 2.0\]"),
        (np.diag([2.0, 2.0, 2.0, 1.0]), "rotation(?!.*last row)"),
        (np.vstack([np.eye(4)[:3], [0.0, 0.0, 1.0, 1.0]]), "last row(?!.*rotation)"),
        ("left", "not finite|numbers"),
    ],
)
def test_what_is_no_pose_is_refused(solver, T, message):
    with pytest.raises(InputError, match=message):
        solver.solve(T, np.eye(4))
    with pytest.raises(InputError, match="T_world_rhand"):
        solver.solve(np.eye(4), T)
