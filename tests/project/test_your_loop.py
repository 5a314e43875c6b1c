"""Strategy: the loop of the example drives a stand-in for a robot on the wall clock, with and without faults."""

import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from models import g1
from policy import ReplayPolicy
from wholebody import MujocoPlant, Robot, Supervisor, path_to, solve
from wholebody.robot.standing import has_lost_standing

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "your_loop.py"
PAGE = (ROOT / "docs" / "your_robots_loop.md").read_text()
LOOP = runpy.run_path(str(EXAMPLE))
drive, StandIn = LOOP["drive"], LOOP["StandIn"]
SPEC = g1()
SECONDS = 2.5


def wrists(q):
    """Poses of both wrists (4, 4) of a configuration."""
    robot = Robot(SPEC)
    robot.update(q, np.zeros(robot.nv))
    return [robot.pose(tool.wrist_frame).homogeneous.copy() for tool in SPEC.tools]


@pytest.fixture(scope="module")
def targets():
    """Both wrists a little ahead and above those of the stance."""
    found = wrists(StandIn().state.q)
    for T in found:
        T[:3, 3] += (0.10, 0.0, 0.10)
    return found


@pytest.fixture
def policy(targets):
    return ReplayPolicy(path_to(solve(*targets), duration=1.2).chunk)


def errors(robot, targets):
    return [np.linalg.norm(T[:3, 3] - W[:3, 3]) for T, W in zip(wrists(robot.state.q), targets, strict=True)]


def test_c1_the_loop_of_the_page_is_that_of_the_example():
    (code,) = [block.split("```")[0] for block in PAGE.split("```python\n") if "while robot.now()" in block]
    assert code.strip() in "\n".join(line[4:] for line in EXAMPLE.read_text().splitlines())
    assert len(code.partition("while ")[2].splitlines()[1:]) <= 10


def test_the_loop_of_a_simulator_that_is_stepped_never_runs_out_of_steps(capsys):
    """A thread would take real time, in which this simulation is over."""
    ran = runpy.run_path(str(ROOT / "examples" / "stepped_loop.py"))
    assert "starved" not in capsys.readouterr().out
    assert len(ran["executor"].report.latencies) >= 4
    assert ran["state"].q[2] > 0.7


def test_the_loop_drives_a_robot_that_is_not_ours(policy, targets, capsys):
    robot = StandIn()
    drive(robot, policy, SECONDS)
    assert max(errors(robot, targets)) < 5e-3
    assert "0.000 s: hold" in capsys.readouterr().out


class Faulty(StandIn):
    """Once it moves, readings are old for 40 ms, then no numbers, then frozen."""

    before, moving = None, np.inf

    def read(self):
        readings = super().read()
        if not np.isfinite(self.moving) and max(map(abs, readings["speeds"].values())) > 0.1:
            self.moving = self.now()
        phase = self.now() - self.moving
        if 0.1 < phase <= 0.14:
            return self.before
        if 0.2 < phase <= 0.24:
            return readings | {"gyro": [np.nan] * 3}
        if 0.3 < phase <= 0.34:
            return self.before | {"time": readings["time"]}
        self.before = readings
        return readings


def test_old_broken_and_frozen_readings_are_bridged_and_said(policy, targets, capsys):
    robot = Faulty()
    drive(robot, policy, SECONDS + 0.5)
    assert max(errors(robot, targets)) < 0.01
    said = capsys.readouterr().out
    assert "no new state for 0.0" in said
    assert "must be finite" in said
    assert "repeats itself to the bit" in said


def test_positions_without_torques_let_the_robot_fall_as_the_page_says():
    supervisor, plant = Supervisor(SPEC), MujocoPlant(SPEC)
    state = plant.reset()
    supervisor.reset(state)
    command = supervisor.step(state)
    command = replace(command, tau=0.0 * command.tau)
    while state.time < 2.5 and not has_lost_standing(state):
        state = plant.step(command)
    assert has_lost_standing(state)
