"""Strategy: states that cannot be used, one by one; then in the loop, in the middle of a reach."""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from models.pinocchio_model import stance_q
from policy.scripted.library import reach
from tests.support.faulty_loops import DroppedTicks, FaultyStates, frozen, not_a_number, stale
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.state_monitor import BRIDGED_MAX, StateMonitor
from wholebody.robot.state import Robot
from wholebody.sim.plant import MujocoPlant
from wholebody.types import RobotState

SPEC = g1()


@pytest.fixture(scope="module")
def plant():
    return MujocoPlant(SPEC)


@pytest.fixture
def monitored():
    """A monitor of a robot that drifts, and its state."""
    robot = Robot(SPEC)
    state = RobotState(1.0, stance_q(SPEC, robot.model), np.full(robot.nv, 0.1))
    monitor = StateMonitor(robot)
    monitor.reset(state)
    return monitor, state


def later(state, ticks=1):
    return replace(state, time=state.time + 0.002 * ticks, q=state.q + np.r_[np.zeros(7), 1e-4 * np.ones(43)])


def test_a_good_state_is_used_as_it_is(monitored):
    monitor, state = monitored
    good = later(state)
    assert monitor.usable(good, good.time, 0.002, None) == (good, None)
    assert monitor.bridged == 0.0


FAULTS = {
    "state_invalid": lambda state: replace(state, q=np.full_like(state.q, np.nan)),
    "state_stale": lambda state: state,
    "state_frozen": lambda state: replace(state, time=state.time + 0.02),
    "state_out_of_order": lambda state: replace(state, time=state.time - 0.004),
}


@pytest.mark.parametrize("reason", FAULTS)
def test_a_state_that_cannot_be_used_is_predicted_with_the_reason(monitored, reason):
    monitor, state = monitored
    used, report = monitor.usable(FAULTS[reason](state), state.time + 0.02, 0.02, None)
    assert report.reason == reason
    assert used.time == state.time + 0.02
    assert np.isfinite(used.q).all()
    assert monitor.bridged == 0.02


def test_a_lost_sample_or_two_are_not_worth_a_word(monitored):
    monitor, state = monitored
    assert monitor.usable(state, state.time + 0.002, 0.002, None)[1] is None
    assert monitor.usable(state, state.time + 0.004, 0.002, None)[1] is None


def test_a_robot_at_rest_may_repeat_itself(monitored):
    monitor, state = monitored
    still = replace(state, v=np.zeros_like(state.v))
    monitor.reset(still)
    assert monitor.usable(replace(still, time=1.1), 1.1, 0.1, None)[1] is None


def test_a_robot_that_nobody_has_seen_for_long_is_taken_to_be_at_rest(monitored):
    monitor, state = monitored
    used, _ = monitor.usable(state, state.time + 1.0, 2.0 * BRIDGED_MAX, None)
    assert not used.v.any()


def reaching(supervisor, plant):
    """The largest palm error while the state is bad and after it [m], and the reasons."""
    config = EpisodeConfig(settle=0.1, hold=0.0)
    result = run_episode(reach(0.45, 0.9), supervisor, plant, duration=2.4, config=config)
    assert result.fall is None
    return result.errors[result.times > 1.0].max(), result.reasons


@pytest.mark.parametrize(("fault", "reason"), [(frozen, "state_frozen"), (stale, "state_stale")])
def test_a_state_that_freezes_in_mid_motion_costs_little(plant, fault, reason):
    supervisor = FaultyStates(SPEC)
    supervisor.times, supervisor.seconds, supervisor.fault = (1.3,), 0.1, fault
    error, reasons = reaching(supervisor, plant)
    assert error < 5e-3
    assert reasons[reason] == pytest.approx(0.1 - 0.01, abs=0.005)


def test_states_that_are_not_finite_for_100_ticks_leave_it_standing(plant):
    supervisor = FaultyStates(SPEC)
    supervisor.times, supervisor.seconds, supervisor.fault = (1.3,), 0.2, not_a_number
    _, reasons = reaching(supervisor, plant)
    assert reasons["state_invalid"] == pytest.approx(0.2, abs=0.005)


def test_every_tenth_tick_dropped_costs_little(plant):
    error, _ = reaching(DroppedTicks(SPEC), plant)
    assert error < 5e-3
