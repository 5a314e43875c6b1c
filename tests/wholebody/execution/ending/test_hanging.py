"""Strategy: a robot that begins on a rope, held there, refused its chunks, let down, and joined to the next one."""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from policy.scripted.library import reach
from tests.support.on_rope import Hoisted
from wholebody.episode.run import observe
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.fall import detect_fall
from wholebody.sim.robot_errors import RealisticPlant, RobotErrors
from wholebody.types import Reason

SPEC = g1()
DOWN, SPEED = 1.5, 0.2


@pytest.fixture(scope="module")
def supervisor():
    return Supervisor(SPEC)


def test_a_hoisted_robot_says_so_holds_its_stance_and_is_led_once_it_was_put_down(supervisor):
    plant, policy = Hoisted(SPEC), reach(0.45, 0.6)
    plant.down = DOWN, SPEED, np.inf
    state, fastest = plant.hoisted(), 0.0
    supervisor.reset(state)
    while "stiff legs now" not in supervisor.status.detail:
        state = plant.step(supervisor.step(state, state.time))
        assert state.time < DOWN + 2.0
        if state.time >= 0.05:
            assert supervisor.status.reason is Reason.HANGING
        if 0.05 <= state.time < DOWN:
            fastest = max(fastest, float(np.abs(state.v[6:]).max()))
    assert fastest < 2.0, "legs that push against nothing move at 15 rad/s"
    policy.reset()
    chunk = policy.infer(observe(SPEC, supervisor, state))
    assert supervisor.accept(chunk, state.time).reason is Reason.HANGING
    supervisor.reset(state)
    supervisor.raise_()
    begin = state.time
    while supervisor.status.reason is not Reason.NO_CHUNK:
        state = plant.step(supervisor.step(state, state.time))
        assert state.time < begin + 3.0
    aside = np.eye(4)
    aside[:2, 3] = plant.soles()[:, :2].mean(axis=0)
    there = replace(
        chunk, t_obs=state.time, T_world_lhand=aside @ chunk.T_world_lhand, T_world_rhand=aside @ chunk.T_world_rhand
    )
    assert supervisor.accept(there, state.time).reason is None
    for _ in range(1000):
        state = plant.step(supervisor.step(state, state.time))
    assert supervisor.chunk is there
    assert detect_fall(plant, state, supervisor.status.status) is None
    assert np.abs(plant.soles()[:, 2]).max() < 0.005


def test_a_hoisted_robot_may_be_left_as_it_is(supervisor):
    plant = Hoisted(SPEC)
    state = plant.hoisted()
    supervisor.reset(state)
    for _ in range(100):
        state = plant.step(supervisor.step(state, state.time))
    assert supervisor.lower().reason is Reason.HANGING
    assert supervisor.lowered


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
    while state.time < 0.2:
        state = plant.step(supervisor.step(state, state.time))
        assert supervisor.status.reason is not Reason.HANGING
