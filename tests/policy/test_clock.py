"""Strategy: clocks by what they promise: never back, and whoever sets one is told when he tries."""

import pytest

from policy.clock import Clock, EpisodeClock, MonotonicClock, SimulatedClock
from policy.errors import ObservationError


def test_both_clocks_are_clocks():
    assert isinstance(MonotonicClock(), Clock)
    assert isinstance(SimulatedClock(), Clock)


def test_real_time_never_goes_back():
    clock = MonotonicClock()
    times = [clock.now() for _ in range(100)]
    assert times == sorted(times)
    assert times[0] >= 0.0


def test_simulated_time_is_what_was_set():
    clock = SimulatedClock(1.0)
    clock.set(1.5)
    assert clock.now() == 1.5
    clock.set(1.5)
    clock.restart(0.2)
    assert clock.now() == 0.2


@pytest.mark.parametrize("time", [0.9, float("nan")])
def test_simulated_time_cannot_be_set_back(time):
    clock = SimulatedClock(1.0)
    with pytest.raises(ValueError, match="use restart for a new episode"):
        clock.set(time)


def test_an_episode_counts_chunks_and_time_from_its_first_observation():
    clock = EpisodeClock()
    assert clock.tick(5.0) == (0, 0.0)
    assert clock.tick(6.5) == (1, 1.5)
    clock.reset()
    assert clock.tick(1.0) == (0, 0.0)
    with pytest.raises(ObservationError, match="call reset for a new episode"):
        clock.tick(0.5)
    with pytest.raises(ObservationError, match="finite"):
        clock.tick(float("inf"))
