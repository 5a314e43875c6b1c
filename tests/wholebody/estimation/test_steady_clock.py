"""Strategy: a clock and stamps that go wrong one way after the other, without a robot; then in the loop."""

import numpy as np
import pytest

from models import g1
from policy.scripted.library import scripted_policy
from tests.support.faulty_loops import CLOCK_FAULTS, FaultyClocks
from tests.support.wide import wide
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.errors import InputError
from wholebody.estimation.steady_clock import AGE_MAX, CONSISTENT, FUTURE, SteadyClock
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Reason, RobotState

SPEC, DT = g1(), 0.002


def at(stamp):
    return RobotState(stamp, np.zeros(0), np.zeros(0))


@pytest.fixture
def clock():
    clock = SteadyClock(DT)
    clock.reset(5.0, 5.0)
    return clock


def run(clock, ticks, *, stamp=0.0, now=0.0, alone=False):
    """Faults of so many ticks, with these added to stamps and clock; the ages of the placed states, and time passed."""
    reasons, ages, begin = [], [], clock.now
    for _ in range(ticks):
        run.k += 1
        true = 5.0 + DT * run.k
        elapsed, stepped = clock.advance(true + stamp, None if alone else true + now)
        assert elapsed >= 0.0
        state, fault = clock.place(at(true + stamp))
        reasons.append((fault or stepped or (None,))[0])
        ages.append(state.age(clock.now))
    return reasons, np.array(ages), clock.now - begin


@pytest.fixture(autouse=True)
def _begin():
    run.k = 0


def test_clocks_that_agree_are_left_as_they_are_to_the_bit(clock):
    reasons, ages, _ = run(clock, 100)
    assert set(reasons) == {None}
    assert clock.now == 5.0 + DT * 100
    assert not ages.any()
    state = at(clock.now)
    assert clock.placed(state) is state


@pytest.mark.parametrize("step", [-3600.0, -1.0, -0.06, 0.06, 1.0, 3600.0])
def test_a_clock_that_steps_is_said_once_and_time_goes_on(clock, step):
    run(clock, 10)
    reasons, ages, passed = run(clock, 50, now=step)
    assert reasons == [Reason.CLOCK_STEPPED] + [None] * 49
    assert passed == pytest.approx(50 * DT)
    assert np.abs(ages).max() < DT
    assert clock.steady(5.0 + step) == pytest.approx(5.0, abs=DT)


@pytest.mark.parametrize("step", [-1.0, -0.06, 0.06, 1.0])
def test_stamps_that_step_are_refused_until_five_agree(clock, step):
    run(clock, 10)
    reasons, ages, passed = run(clock, 50, stamp=step)
    refused = Reason.STATE_FROM_FUTURE if step > 0.0 else Reason.STATE_OUT_OF_ORDER
    assert reasons == [refused] * (CONSISTENT - 1) + [Reason.CLOCK_STEPPED] + [None] * 45
    assert np.abs(ages[CONSISTENT:]).max() < 1e-9
    assert passed == pytest.approx(50 * DT)


def test_states_that_come_later_and_later_are_used_until_they_are_a_tenth_of_a_second_old(clock):
    """Literal, not `AGE_MAX`: ten times as much would leave a robot a second without eyes."""
    reasons = [run(clock, 1, stamp=-0.0005 * k)[0][0] for k in range(300)]
    assert reasons[:200] == [None] * 200
    assert reasons[202] == Reason.STATE_STALE


@pytest.mark.parametrize("step", [-0.7, 0.7])
def test_one_wrong_stamp_is_refused_and_the_next_state_is_used(clock, step):
    run(clock, 10)
    assert run(clock, 1, stamp=step)[0] != [None]
    reasons, ages, _ = run(clock, 20)
    assert set(reasons) == {None}
    assert np.abs(ages).max() < 1e-9


@pytest.mark.parametrize("step", [-1.0, 0.7])
def test_without_a_clock_a_step_of_the_stamps_is_none_of_time(clock, step):
    run(clock, 10, alone=True)
    reasons, ages, passed = run(clock, 50, stamp=step, alone=True)
    assert reasons == [Reason.CLOCK_STEPPED] + [None] * 49
    assert passed == pytest.approx(50 * DT)
    assert not ages.any()


@pytest.mark.parametrize("now", [np.nan, np.inf, -np.inf])
def test_a_clock_that_is_no_number_is_said_and_time_goes_on_by_the_stamps(clock, now):
    run(clock, 10)
    reasons, ages, passed = run(clock, 50, now=now)
    assert set(reasons) == {Reason.CLOCK_INVALID}
    assert passed == pytest.approx(50 * DT)
    assert np.abs(ages).max() < 1e-9
    assert set(run(clock, 10)[0]) == {None}


def test_a_loop_that_hung_is_no_step(clock):
    run(clock, 10)
    run.k += 200
    reasons, _, passed = run(clock, 1)
    assert reasons == [None]
    assert passed == pytest.approx(201 * DT)


def test_states_that_are_always_a_little_old_stay_so_after_a_step():
    clock = SteadyClock(DT)
    clock.reset(4.98, 5.0)
    run(clock, 10, stamp=-0.02)
    _, ages, _ = run(clock, 50, stamp=0.98)
    np.testing.assert_allclose(ages[CONSISTENT:], 0.02, atol=1e-9)


@pytest.mark.parametrize("stamp", [5.0 - 2.0 * AGE_MAX, 5.0 + 2.0 * FUTURE, 1e9])
def test_states_with_a_clock_of_their_own_are_placed_at_the_present(stamp):
    clock = SteadyClock(DT)
    clock.reset(stamp, 5.0)
    assert clock.placed(at(stamp)).time == pytest.approx(5.0, abs=1e-6)


@pytest.fixture(scope="module")
def loop():
    return FaultyClocks(SPEC), MujocoPlant(SPEC)


IN_THE_LOOP = {
    "a state stamped 0.7 s ahead": Reason.STATE_FROM_FUTURE,
    "stamps 1 s back": Reason.CLOCK_STEPPED,
    "the clock 1 s ahead": Reason.CLOCK_STEPPED,
    "the clock no number": Reason.CLOCK_INVALID,
    "no clock, a state stamped 0.7 s ahead": Reason.CLOCK_STEPPED,
}
SHARPEST = "a state stamped 0.7 s ahead"
"""The one of which it fell."""


@pytest.mark.parametrize("name", [SHARPEST, *wide(*(IN_THE_LOOP.keys() - {SHARPEST}))])
def test_a_waving_robot_stands_and_waves_on_whatever_its_clocks_do(loop, name):
    """It fell 1 s after one state that was stamped 0.7 s ahead."""
    supervisor, plant = loop
    supervisor.fault, supervisor.since = CLOCK_FAULTS[name], 2.799
    result = run_episode(scripted_policy("wave"), supervisor, plant, duration=3.5, config=EpisodeConfig(hold=1.5))
    assert result.fall is None
    assert result.reasons[IN_THE_LOOP[name]] > 0.0
    late = result.errors[result.times > 4.0]
    assert late.size
    assert late.max() < 5e-3 or name == "the clock no number"


@pytest.mark.parametrize("name", ["states frozen for 3 s", *wide("states no numbers for 3 s")])
def test_a_waving_robot_that_sees_nothing_for_three_seconds_stands_and_goes_on(loop, name):
    supervisor, plant = loop
    supervisor.fault, supervisor.since = CLOCK_FAULTS[name], 2.5
    result = run_episode(scripted_policy("wave"), supervisor, plant, duration=6.5, config=EpisodeConfig(hold=1.0))
    assert result.fall is None
    assert result.errors[result.times > 7.0].max() < 5e-3


@pytest.mark.parametrize("now", [np.nan, np.inf])
def test_a_present_time_that_is_no_number_begins_no_episode_and_accepts_no_chunk(loop, now):
    supervisor, plant = loop
    supervisor.fault = None
    state = plant.reset()
    with pytest.raises(InputError, match="present time"):
        supervisor.reset(state, now)
    supervisor.reset(state)
    chunk = scripted_policy("wave")
    assert supervisor.accept(chunk, now).reason is Reason.CLOCK_INVALID
