"""Strategy: robots on a rope, true and realistic, found out before their first plan; begun anew once they stand."""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from policy.scripted.library import reach
from tests.support.on_rope import Hoisted, RealisticHoisted
from wholebody.episode.run import observe
from wholebody.estimation.state_estimator import StateEstimator
from wholebody.execution.planted_feet import EARLY
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.robot_errors import REALISTIC_ROBOT, RealisticPlant, RobotErrors
from wholebody.sim.sensors import REALISTIC_READINGS, Sensors
from wholebody.types import Reason, Status

SPEC = g1()


@pytest.fixture(scope="module")
def supervisor():
    return Supervisor(SPEC)


@pytest.mark.parametrize("seed", [None, 0, 1])
def test_a_robot_that_hangs_is_damped_and_says_so_before_its_first_plan(supervisor, seed):
    """Its legs thrashed at 85 rad/s, and nothing said why."""
    sensors = None
    if seed is not None:
        sensors = Sensors(SPEC, replace(REALISTIC_READINGS, seed=seed), 0.002, StateEstimator(SPEC))
        plant = RealisticHoisted(SPEC, replace(REALISTIC_ROBOT, seed=seed), encoders=sensors)
        sensors.reset()
    else:
        plant = Hoisted(SPEC)
    state, fastest, found = plant.hoisted(), 0.0, np.inf
    read = state if sensors is None else sensors.measure(state)
    supervisor.reset(read)
    while state.time < 1.0:
        state = plant.step(supervisor.step(read, state.time))
        read = state if sensors is None else sensors.measure(state)
        fastest = max(fastest, float(np.abs(state.v[6:]).max()))
        if supervisor.status.status is Status.DAMPING:
            found = min(found, state.time)
    assert found < 0.1
    assert supervisor.status.reason is Reason.STANDING_LOST
    assert "put it down" in supervisor.status.detail
    assert fastest < 10.0
    knees = 6 + supervisor.robot.joint_indices(["left_knee_joint", "right_knee_joint"])
    assert np.abs(state.v[knees]).max() < 1.0


def test_put_down_and_begun_anew_it_is_led(supervisor):
    plant = Hoisted(SPEC)
    state = plant.hoisted()
    supervisor.reset(state)
    while state.time < 0.1:
        state = plant.step(supervisor.step(state, state.time))
    assert supervisor.status.status is Status.DAMPING
    plant, policy = MujocoPlant(SPEC), reach(0.45, 0.6)
    state = plant.reset()
    supervisor.reset(state)
    policy.reset()
    assert supervisor.accept(policy.infer(observe(SPEC, supervisor, state)), state.time).reason is None
    while state.time < 2.0 * EARLY:
        state = plant.step(supervisor.step(state, state.time))
    assert supervisor.status.status in (Status.TRACKING, Status.SLOWED)


SLOW = {
    "commands that come 40 ms late": RobotErrors(command_delay=(0.04, 0.04)),
    "motors of 15 Hz": RobotErrors(motor_bandwidth=15.0),
    "motors deaf to torques": RobotErrors(feed_forward=0.0),
}


@pytest.mark.parametrize("errors", SLOW.values(), ids=SLOW)
def test_a_robot_that_stands_on_slow_legs_is_not_taken_to_hang(supervisor, errors):
    plant = RealisticPlant(SPEC, errors)
    state = plant.reset()
    supervisor.reset(state)
    while state.time < EARLY + 0.05:
        state = plant.step(supervisor.step(state, state.time))
        assert supervisor.status.status is not Status.DAMPING
