"""Strategy: one linearised loop for the file; what it says of motors is held against the robot that has them."""

import numpy as np
import pytest

from models import g1
from tests.support.carried import still
from wholebody.bench.torque_loop import Motors, linearised
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.errors import InputError
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant

SPEC = g1()


@pytest.fixture(scope="module")
def rested():
    supervisor, plant = Supervisor(SPEC), MujocoPlant(SPEC)
    run_episode(still(0.5), supervisor, plant, duration=0.5, config=EpisodeConfig(hold=1.5))
    return supervisor, plant


@pytest.fixture(scope="module")
def loop(rested):
    supervisor, plant = rested
    return linearised(supervisor.controller, plant, supervisor._follower.row)


def test_the_loop_stands_with_motors_that_answer_at_once_and_has_a_phase_margin(loop):
    assert loop.stands(Motors())
    margin = loop.phase_margin()
    assert 20.0 < margin < 90.0
    assert loop.stands(Motors(phase=np.deg2rad(margin)))
    assert not loop.stands(Motors(phase=np.deg2rad(margin + 1.0)))


def test_motors_that_answer_late_are_worse_the_later_they_answer(loop):
    radii = [loop.radius(Motors(bandwidth=hz)) for hz in (200.0, 60.0, 30.0)]
    assert radii[0] <= radii[1] <= radii[2]
    assert not loop.stands(Motors(bandwidth=30.0))
    assert loop.stands(Motors(delay=5))
    assert not loop.stands(Motors(delay=20))


def test_a_first_order_lag_is_the_limit_of_a_second_order_one_far_overdamped(loop):
    lag = 0.02
    slow = loop.radius(Motors(lag=lag))
    # 2 zeta / omega is the lag where the second pole is far away.
    omega = 2.0 * np.pi * 400.0
    assert loop.radius(Motors(bandwidth=400.0, damping=0.5 * lag * omega)) == pytest.approx(slow, abs=2e-3)


def test_the_mode_that_grows_is_said_with_its_frequency_and_joint(loop):
    size, frequency, joint = loop.worst(Motors(bandwidth=25.0))
    assert size > 1.01
    assert 10.0 < frequency < 60.0
    assert "wrist" in joint


def test_a_robot_that_moves_is_not_linearised():
    supervisor, plant = Supervisor(SPEC), MujocoPlant(SPEC)
    supervisor.reset(plant.reset())
    supervisor.step(plant.state())
    plant.data.qvel[-20:] = 1.0
    supervisor.controller.q_des[:] += 0.1
    with pytest.raises(InputError, match="at rest"):
        linearised(supervisor.controller, plant, supervisor._follower.row)
