"""Strategy: the real process with MuJoCo in it, driven by commands that the test makes, on the wall clock."""

import time
from types import SimpleNamespace

import numpy as np
import pytest

from models import g1
from wholebody.errors import WholebodyError
from wholebody.live.loop import ControlLoop, LoopStatistics
from wholebody.live.robot_process import RobotProcess, World
from wholebody.types import JointCommand, Reason, Status, StatusReport

N = g1().n_joints


def driven(stiffness, seconds):
    """What the process tells at its end after holding the stance so stiffly for so long, and the last state's time."""
    robot = RobotProcess(World(), 0.002)
    first = robot.start()
    stance = np.array(g1().stance.joint_positions)
    command = JointCommand(0.0, stance, np.zeros(N), np.zeros(N), np.full(N, stiffness), np.full(N, 1.0))
    robot.go(time.monotonic())
    last, end = first, time.monotonic() + seconds
    while time.monotonic() < end:
        last = robot.receive(0.01) or last
        robot.send(command)
    return robot.close(), last.time


@pytest.mark.alone
def test_time_runs_at_real_speed_and_a_limp_robot_is_told_to_have_fallen():
    told, now = driven(stiffness=0.0, seconds=2.0)
    assert now == pytest.approx(2.0, abs=0.2)
    assert told["fall"]


def test_a_robot_that_has_not_fallen_yet_is_not():
    told, _ = driven(stiffness=100.0, seconds=0.2)
    assert told["fall"] == ""


def test_a_scene_that_there_is_not_is_told_where_it_was_asked_for():
    robot = RobotProcess(World(scene="moon"), 0.002)
    with pytest.raises((WholebodyError, ValueError), match="moon"):
        robot.start()
    robot.close()


def test_a_plan_that_is_refused_after_the_last_chunk_was_asked_for_does_not_end_the_loop():
    loop = SimpleNamespace(executor=None, statistics=LoopStatistics())
    ControlLoop._refused(loop, StatusReport(Status.HOLD, Reason.NOT_JOINED))
    assert loop.statistics.refusals == {"not_joined": 1}
