"""Strategy: states that cannot be used, one by one; then in the loop, in the middle of a reach."""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from models.pinocchio_model import stance_q
from policy.scripted.library import reach, scripted_policy
from tests.support.faulty_loops import DroppedTicks, FaultyStates, bent, frozen, not_a_number, pitched, stale, zeros
from wholebody.episode.run import EpisodeConfig, observe, run_episode
from wholebody.execution.state_monitor import BRIDGED_MAX, CONSISTENT, StateMonitor
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.standing import has_lost_standing
from wholebody.robot.state import Robot
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.sensors import SensorConfig, Sensors
from wholebody.types import Reason, RobotState, Status

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
    return replace(state, time=state.time + 0.002 * ticks, q=state.q + np.r_[np.zeros(7), np.full(43, 1e-4 * ticks)])


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
    "state_jumped": lambda state: pitched(1.2)(later(state), state),
}


@pytest.mark.parametrize("reason", FAULTS)
def test_a_state_that_cannot_be_used_is_predicted_with_the_reason(monitored, reason):
    monitor, state = monitored
    used, report = monitor.usable(FAULTS[reason](state), state.time + 0.02, 0.02, None)
    assert report.reason == reason
    assert used.time == state.time + 0.02
    assert np.isfinite(used.q).all()
    assert monitor.bridged == 0.02


IMPOSSIBLE = {"pitch +70": pitched(1.2), "pitch -70": pitched(-1.2), "zeros": zeros} | {
    f"joint {joint} {angle:+g}": bent(joint, angle) for joint in (0, 9, 14, 33, 42) for angle in (3.0, -3.0)
}


@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_ten_impossible_states_in_a_row_are_bridged_and_the_next_good_one_is_used(monitored, name):
    monitor, state = monitored
    for k in range(1, 11):
        now = later(state, k)
        used, report = monitor.usable(IMPOSSIBLE[name](now, state), now.time, 0.002, None)
        assert (report.status, report.reason) == (Status.HOLD, "state_jumped")
        assert not monitor.standing_lost
        np.testing.assert_allclose(used.v, state.v)
        assert np.abs(used.q[:7] - state.q[:7]).max() < 0.01
    good = later(state, 11)
    assert monitor.usable(good, good.time, 0.002, None) == (good, None)


def test_a_jump_that_lasts_is_believed_in_the_end_and_one_that_does_not_agree_with_itself_never(monitored):
    monitor, state = monitored
    believed = []
    for sign in ((1, 1), (1, -1)):
        monitor.reset(state)
        reports = []
        for k in range(1, 150):
            now = later(state, k)
            reports.append(monitor.usable(pitched(0.5 * sign[k % 2])(now, state), now.time, 0.002, None)[1])
        believed.append(sum(report is None for report in reports))
    # An unknown acceleration of 100 rad/s^2 takes a tenth of a second for 0.5 rad.
    assert 149 - believed[0] == pytest.approx(50, abs=5)
    assert believed[1] == 0


def test_a_jump_is_believed_when_five_states_in_a_row_follow_from_the_one_before(monitored):
    """After 0.3 s in which nothing could be used, so that half a radian is possible, and only agreement is missing."""
    monitor, state = monitored
    for k in range(1, 151):
        now = later(state, k)
        monitor.usable(pitched(0.5 * (1, -1)[k % 2])(now, state), now.time, 0.002, None)
    answers = []
    for k in range(151, 160):
        now = later(state, k)
        answers.append(monitor.usable(pitched(0.3)(now, state), now.time, 0.002, None)[1])
    # The first of them follows from none; the fifth that does is the sixth of all.
    assert [report is None for report in answers] == [False] * 5 + [True] * 4


def test_standing_is_lost_when_several_states_in_a_row_say_so(monitored):
    monitor, state = monitored
    lying = pitched(1.2)(state, state)
    monitor.reset(lying)
    for k in range(1, CONSISTENT + 1):
        assert not monitor.standing_lost
        now = later(lying, k)
        monitor.usable(now, now.time, 0.002, None)
    assert monitor.standing_lost


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


def test_a_plan_is_brought_to_a_stop_when_nothing_was_seen_for_a_tenth_of_a_second(plant):
    policy, supervisor = reach(0.45, 0.9), FaultyStates(SPEC)
    policy.reset()
    state = plant.reset()
    supervisor.reset(state)
    supervisor.accept(policy.infer(observe(SPEC, supervisor, state)))
    supervisor.times, supervisor.seconds, supervisor.fault = (0.7,), 0.4, stale
    rates = {}
    while state.time < 1.1:
        state = plant.step(supervisor.step(state))
        rates[round(state.time - 0.7, 3)] = supervisor.rate
    assert rates[0.1] == pytest.approx(1.0, abs=1e-3)
    assert rates[0.12] < 1.0
    assert rates[0.4] < 0.5, rates


def test_states_that_are_not_finite_for_100_ticks_leave_it_standing(plant):
    supervisor = FaultyStates(SPEC)
    supervisor.times, supervisor.seconds, supervisor.fault = (1.3,), 0.2, not_a_number
    _, reasons = reaching(supervisor, plant)
    assert reasons["state_invalid"] == pytest.approx(0.2, abs=0.005)


def test_glitches_in_mid_motion_cost_nothing(plant):
    class Glitches(FaultyStates):
        """Each of the kinds once for one tick, and once for ten."""

        kinds = (not_a_number, zeros, pitched(1.2), pitched(-1.2), bent(14, 3.0), bent(3, -3.0))

        def fault(self, state, good):
            return self.kinds[int((state.time - 0.5) / 0.15) % 6](state, good)

        def step(self, state, now=None):
            self.seconds = 0.0021 if state.time < 1.4 else 0.02
            return super().step(state, now)

    supervisor = Glitches(SPEC)
    clean, _ = reaching(supervisor, plant)
    supervisor.times = tuple(0.501 + 0.15 * np.arange(12))
    error, reasons = reaching(supervisor, plant)
    assert error - clean < 1e-3
    assert reasons[Reason.STATE_INVALID] == pytest.approx(0.022, abs=0.005)
    assert reasons[Reason.STATE_JUMPED] == pytest.approx(5 * 0.022, abs=0.02)


def test_a_robot_that_is_knocked_over_is_let_down_and_damped(plant):
    class Pushed(MujocoPlant):
        def reset(self):
            state = super().reset()
            self.push("torso_link", np.array([300.0, 0.0, 0.0]), start=0.5, duration=0.1)
            return state

    pushed, supervisor = Pushed(SPEC), FaultyStates(SPEC)
    state = pushed.reset()
    supervisor.reset(state)
    reasons = []
    while supervisor.status.status is not Status.DAMPING:
        assert state.time < 6.0
        state = pushed.step(supervisor.step(state))
        reasons.append(supervisor.status.reason)
        assert reasons[-1] in (Reason.DESCENDING, Reason.STANDING_LOST) or not has_lost_standing(state)
    assert list(dict.fromkeys(reasons))[-2:] == [Reason.DESCENDING, Reason.STANDING_LOST]
    # It is not to move by itself again when somebody lifts it: not before a reset.
    standing = plant.reset()
    for _ in range(1000):
        state = replace(standing, time=state.time + 0.002)
        supervisor.step(state)
        assert supervisor.status.status is Status.DAMPING
    assert not supervisor.monitor.standing_lost
    supervisor.reset(state)
    supervisor.step(replace(standing, time=state.time + 0.002))
    assert supervisor.status.status is not Status.DAMPING


def test_a_known_delay_of_the_state_costs_little_and_a_misjudged_one_is_stable(plant):
    """It took 8 and 16 mm for 10 and 20 ms."""
    policy, supervisor = scripted_policy("lissajous"), Supervisor(SPEC)
    config, largest = EpisodeConfig(settle=0.1, hold=0.0), []
    for delay, misjudged in ((0.0, 0.0), (0.02, 0.0), (0.02, 0.005)):
        sensors = Sensors(SPEC, SensorConfig(delay=delay, delay_misjudged=misjudged), 0.002)
        result = run_episode(policy, supervisor, plant, duration=2.8, config=config, sensors=sensors)
        assert result.fall is None
        assert not {reason for reason in result.reasons if reason.startswith("state_")}
        largest.append(1e3 * result.errors[result.times > 2.1].max())
    assert largest[1] < largest[0] + 1.0
    assert largest[2] < largest[0] + 8.0


@pytest.mark.parametrize("every", [10, 2])
def test_ticks_that_are_dropped_cost_little(plant, every):
    """The controller integrated for one period however much time had passed: with every second tick it fell."""
    supervisor = DroppedTicks(SPEC)
    supervisor.every = every
    error, _ = reaching(supervisor, plant)
    assert error < 5e-3
