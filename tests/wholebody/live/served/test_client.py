"""Strategy: the real processes, in lockstep, driven by this test, and by a program that is killed.

What the plugin for LeRobot makes of them is tested beside it.
"""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from policy.action_spec.anchor import Anchor
from wholebody.errors import InputError, SimulationError, WholebodyError
from wholebody.live.served.client import ServedRobot
from wholebody.live.served.messages import Served

ROOT = Path(__file__).parents[4]
STEP = 1.0 / 30.0
PROGRAM = """
import sys
from wholebody.live.served.client import ServedRobot
from wholebody.live.served.messages import Served
robot = ServedRobot(Served(clock="lockstep", report=sys.argv[1]))
robot.start()
print("stands", flush=True)
while True:
    robot.advance(0.1)
    robot.see()
"""
LONG = 600.0
"""Time that is waited at most [s]."""


@pytest.fixture(scope="module")
def robot():
    robot = ServedRobot(Served(clock="lockstep"))
    robot.start()
    yield robot
    robot.close()


def left_wrist(seen):
    anchor = Anchor.measured(seen.observation)
    return anchor.T_world_base @ anchor.poses["lhand"]


def test_a_hand_goes_where_it_is_told_to(robot):
    T = left_wrist(robot.see())
    T[2, 3] += 0.15
    for _ in range(45):
        robot.put(lhand=T)
        robot.advance(STEP)
    assert left_wrist(robot.see())[:3, 3] == pytest.approx(T[:3, 3], abs=5e-3)


def test_a_target_that_is_none_is_refused_and_the_robot_goes_on(robot):
    before = left_wrist(robot.see())
    robot.put(lhand=np.full((4, 4), np.nan))
    robot.put(nose=np.eye(4))
    robot.advance(0.5)
    seen = robot.see()
    assert not seen.fallen
    assert left_wrist(seen)[:3, 3] == pytest.approx(before[:3, 3], abs=3e-3)


def test_the_program_has_loaded_nothing_heavy():
    heavy = {"pinocchio", "mujoco", "llvmlite"}
    code = f"import sys, wholebody.live.served.client; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == "[]"


def test_the_end_is_told():
    robot = ServedRobot(Served(clock="lockstep"))
    robot.start()
    robot.put(nose=np.eye(4))
    robot.put(nose=np.eye(4))
    report = robot.close()
    assert report["lowered"]
    assert not report["fell"]
    assert sum(report["targets_refused"].values()) == 2
    assert robot.close() == {}
    with pytest.raises(SimulationError, match="not been started, or was ended"):
        robot.see()


def test_a_setting_that_is_wrong_is_told_where_the_robot_is_started():
    robot = ServedRobot(Served(clock="lockstep", config="/nowhere.yaml"))
    with pytest.raises((WholebodyError, OSError, ValueError), match=r"nowhere\.yaml"):
        robot.start()
    assert not robot.running


def test_a_realistic_robot_is_as_its_seed_says():
    robot = ServedRobot(Served(clock="lockstep", realistic=True))
    robot.start()
    seen = [robot.reset(seed).observation.q_body for seed in (3, 4, 3)]
    assert np.array_equal(seen[0], seen[2])
    assert 1e-5 < np.abs(seen[0] - seen[1]).max() < 0.1
    assert not robot.close()["fell"]
    with pytest.raises(InputError, match="in lockstep"):
        ServedRobot(Served(realistic=True)).start()


def test_a_program_that_is_killed_leaves_a_robot_that_crouches(tmp_path):
    report = tmp_path / "report.json"
    program = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, report], stdout=subprocess.PIPE, text=True, cwd=ROOT, stderr=subprocess.DEVNULL
    )
    assert program.stdout.readline() == "stands\n"
    program.send_signal(signal.SIGKILL)
    program.wait()
    told = waited_for(report)
    assert told["lowered"]
    assert not told["fell"]


def waited_for(report):
    """What is in a report once it is there."""
    end = time.monotonic() + LONG
    while not report.exists() and time.monotonic() < end:
        time.sleep(0.1)
    return json.loads(report.read_text())


def test_processes_that_were_killed_are_told(tmp_path):
    robot = ServedRobot(Served(clock="lockstep"))
    robot.start()
    os.kill(robot._process.pid, signal.SIGKILL)
    with pytest.raises(SimulationError, match="ended"):
        robot.see()
    assert robot.close() == {}
