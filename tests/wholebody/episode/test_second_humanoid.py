"""Strategy: TALOS, a humanoid of another maker, by nothing but its description: it stands for a minute, reaches three
places, and a chunk of it is judged, by plans and by simulation.
"""

import numpy as np
import pytest

from models.robots import ROBOTS
from models.talos import talos
from policy.scripted.library import reach
from tests.support.wide import wide
from wholebody.config import ControllerConfig
from wholebody.config.robot import RobotConfig
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.standing import pelvis_tilt
from wholebody.sim.fall import detect_fall
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Status
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker

PLACES = ((0.50, 0.25, 1.00), (0.55, 0.25, 1.30), (0.45, 0.25, 0.80))
"""Left palms ahead, aside and above [m]; right ones mirrored."""


@pytest.fixture(scope="module")
def robot():
    return Supervisor(talos()), MujocoPlant(talos())


@pytest.mark.parametrize("seconds", [6, *wide(60)])
def test_it_stands(robot, seconds):
    supervisor, plant = robot
    state = plant.reset()
    supervisor.reset(state)
    for _ in range(500 * seconds):
        state = plant.step(supervisor.step(state))
    assert detect_fall(plant, state, Status.TRACKING) is None
    assert pelvis_tilt(state) < 0.01
    assert np.abs(state.q[:3] - talos().stance.base[:3]).max() < 5e-3


@pytest.mark.parametrize("place", [PLACES[1], *wide((PLACES[0],), (PLACES[2],))])
def test_it_reaches(robot, place):
    x, y, z = place
    policy = reach(x, z, y=y, robot=talos())
    short = EpisodeConfig(settle=0.2, hold=0.5)
    result = run_episode(policy, *robot, duration=4.0, config=short)
    assert result.fall is None
    assert result.time_factor == 1.0
    assert result.palms.errors.max() < 2e-3
    assert result.torques == {}


def test_a_chunk_of_it_is_judged(monkeypatch):
    monkeypatch.setitem(ROBOTS, "talos", talos)
    config = ControllerConfig(robot=RobotConfig(model="talos"))
    within, beyond = (reach(x, 1.0, y=0.25, robot=talos()) for x in (0.50, 1.60))
    fast = FastChecker(config)
    assert fast.check(within, "within", 3.0).verdict == "feasible"
    assert fast.check(beyond, "beyond", 3.0).verdict == "infeasible"
    assert fast.check(within, "within", 3.0).odds is None
    verdict, _ = Checker(config=config).check(within, "within", 1.0)
    assert verdict.verdict == "feasible"
