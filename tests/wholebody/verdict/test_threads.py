"""Strategy: the public functions by several threads at once, against one by one, to the bit."""

from dataclasses import asdict

import numpy as np
import pytest

from models import g1
from policy.kinematics.forward import kinematics
from tests.support.outcome_cases import outcome_case
from tests.support.thread_cases import chunks, in_threads, told
from wholebody import RobotState, as_given, reachability, solve
from wholebody.robot.state import Robot
from wholebody.verdict.fast import FastChecker


def test_chunks_judged_by_four_threads_are_told_the_same_as_one_by_one():
    """22 of 24 answers differed, and sound chunks were refused."""
    cases = chunks(12)
    alone = [told(chunk) for chunk in cases]
    assert len(set(alone)) > 6
    assert in_threads(told, cases, 4) == alone


@pytest.mark.regression
def test_outcomes_as_given_are_the_same_in_threads():
    def outcome(chunk):
        found = as_given(chunk)
        return found.fell, found.time, found.errors.tobytes()

    cases = chunks(2)
    alone = [outcome(chunk) for chunk in cases]
    assert in_threads(outcome, cases, 4) == alone


def test_postures_are_the_same_in_threads():
    T = np.tile(np.eye(4), (6, 2, 1, 1))
    T[:, 0, :3, 3], T[:, 1, :3, 3] = (0.3, 0.2, 0.8), (0.3, -0.2, 0.8)
    T[:, :, 0, 3] += 0.03 * np.arange(6)[:, None]
    alone = [solve(*pair).q.tobytes() for pair in T]
    assert in_threads(lambda pair: solve(*pair).q.tobytes(), T, 4) == alone


def test_questions_to_the_map_are_the_same_in_threads():
    told_by, points = reachability(), [(0.2 + 1e-4 * k, 0.2, 0.8) for k in range(2000)]
    alone = [told_by.room(point, (0.3, -0.2, 0.8)) for point in points]
    assert in_threads(lambda point: told_by.room(point, (0.3, -0.2, 0.8)), points, 4) == alone


def test_wrists_of_joints_are_the_same_in_threads():
    spec = g1()
    q = np.random.default_rng(0).uniform(spec.position_min[:29], spec.position_max[:29], (2000, 29))
    alone = [kinematics().poses(one)["lhand"].tobytes() for one in q]
    assert in_threads(lambda one: kinematics().poses(one)["lhand"].tobytes(), q, 4) == alone


def test_a_state_with_feet_elsewhere_leaves_nothing_behind():
    (chunk, *_), robot = chunks(1), Robot(g1())
    alone = told(chunk)
    from wholebody import judge

    begin = FastChecker().judge.stance().body
    q = begin.q.copy()
    q[7 + robot.joint_indices(["left_hip_yaw_joint"])[0]] += 0.02
    judge(chunk, RobotState(0.0, q, begin.v))
    assert told(chunk) == alone


def test_what_a_checker_judged_before_changes_no_digit_of_what_it_says():
    """Hands asked into each other were parted from where the search for another chunk had ended."""
    chunk, fresh = outcome_case(166).chunk, FastChecker()
    told = [repr(asdict(fresh.of_chunk(chunk, fresh.judge.first_pose(chunk), "", (False, False)))) for _ in range(3)]
    assert told[1:] == told[:1] * 2
