"""Strategy: sines, lines and scatter told at even and uneven times; what is foretold is compared with what comes."""

import numpy as np
import pytest

from policy.targets.foretelling import GAP, LENGTH, Foretelling, braked

AGES = np.array([0.0, 0.1, 0.2])


def told(motion, times, speed=2.5, far=9.0):
    foretelling = Foretelling(speed, far)
    for time in times:
        foretelling.add(time, np.atleast_1d(motion(time)))
    return foretelling


def off(motion, rate=30.0, scatter=0.0):
    """How far off [1] a motion is foretold at `AGES`, RMS of many beginnings, rows."""
    rng, errors = np.random.default_rng(0), []
    for begin in np.linspace(0.0, 1.0, 40):
        times = begin + np.arange(0.0, 0.6, 1.0 / rate)
        track = told(lambda t: motion(t) + scatter * rng.normal(), times)
        errors.append(track.at(AGES, 0.3)[:, 0] - motion(times[-1] + AGES))
    return np.sqrt(np.mean(np.square(errors), axis=0))


def test_a_wave_is_foretold_better_than_by_going_on_with_its_velocity_and_acceleration():
    w = 2.0 * np.pi

    def wave(t):
        return 0.08 * np.sin(w * t)

    at_once, soon, later = off(wave)
    assert at_once < 1e-4
    # The parabola through the last three values is off by the third derivative, 0.08 w^3, times age^3 / 6 and more.
    assert soon < 0.08 * w**3 * 0.1**3 / 6.0 / np.sqrt(2.0) * 2.0
    assert later < 0.08 * w**3 * 0.2**3 / 6.0 / np.sqrt(2.0)


def test_scatter_of_a_target_that_rests_is_not_foretold_as_a_motion():
    soon = off(lambda _: 0.0 * _, scatter=1e-3)[1]
    assert soon < 0.015


def test_a_motion_that_says_no_more_comes_to_rest():
    track = told(lambda t: 1.0 * t, np.arange(0.0, 0.6, 1.0 / 30.0))
    late = track.at(np.array([1.0, 2.0, 3.0]), 0.3)[:, 0]
    assert np.abs(np.diff(late)).max() < 1e-6
    assert 0.5 * LENGTH < late[-1] - track.last[1][0] < 2.0 * LENGTH


@pytest.mark.parametrize("value", [0.3, -1e3])
def test_a_value_that_is_repeated_is_foretold_to_the_bit(value):
    track = told(lambda _: value, np.cumsum(np.random.default_rng(1).uniform(0.005, 0.1, 40)))
    assert (track.at(AGES, 0.3) == value).all()


def test_uneven_times_say_the_same_of_a_line():
    times = np.cumsum(np.random.default_rng(2).uniform(0.02, 0.05, 20))
    uneven = told(lambda t: 0.5 * t, times).at(AGES, 0.3)[:, 0] - 0.5 * times[-1]
    even = told(lambda t: 0.5 * t, np.arange(20) / 30.0).at(AGES, 0.3)[:, 0] - 0.5 * 19 / 30.0
    np.testing.assert_allclose(uneven, even, atol=4e-3)


def test_a_jump_and_a_long_silence_begin_anew():
    for times in ([0.0, 0.033, 0.066], [0.0, 0.033, 0.033 + 1.1 * GAP]):
        track = told(lambda t: 0.0 if t < 0.05 else 0.2, times)
        np.testing.assert_array_equal(track.at(AGES, 0.3)[:, 0], 0.2)


def test_no_value_is_foretold_further_off_than_said():
    track = told(lambda t: 2.0 * t, np.arange(0.0, 0.6, 1.0 / 30.0), far=0.1)
    ages = np.linspace(0.0, 0.3, 20)
    assert np.abs(track.at(ages, 0.3) - track.last[1]).max() == pytest.approx(0.1)
    np.testing.assert_allclose(track.at(ages[:5], 0.3), track.at(ages, 0.3)[:5], atol=1e-12, err_msg="whoever asks")


def test_another_origin_changes_nothing_else():
    one, other = (told(np.sin, np.arange(0.0, 0.6, 0.03)) for _ in range(2))
    other.shifted(np.array([5.0]))
    np.testing.assert_allclose(other.at(AGES, 0.3), one.at(AGES, 0.3) - 5.0, atol=1e-9)


def test_braked_ages_go_on_and_then_come_to_rest_smoothly():
    ages = np.linspace(0.0, 1.0, 10_001)
    braking = braked(ages, 0.2, 0.26)
    np.testing.assert_array_equal(braking[ages <= 0.2], ages[ages <= 0.2])
    assert braking[-1] == pytest.approx(0.2 + 0.13)
    rate = np.gradient(braking, ages)
    assert rate.max() <= 1.0 + 1e-6
    assert np.abs(np.gradient(rate, ages)).max() < 10.0


def test_a_step_aside_begins_anew_and_is_not_foretold_as_a_motion():
    """As where a policy's chunks meet: a line that goes on beside itself."""
    times = np.arange(18) / 30.0
    steps, near = (Foretelling(2.5, 9.0, step) for step in (0.012, np.inf))
    for time in times:
        for track in (steps, near):
            track.add(time, np.array([0.1 * time + (0.02 if time > 0.55 else 0.0)]))
    beside = [track.at(AGES, 0.3)[1, 0] - 0.1 * (times[-1] + 0.1) - 0.02 for track in (steps, near)]
    assert abs(beside[0]) <= 0.011
    assert beside[1] > 0.03


@pytest.mark.parametrize("aside", [0.005, 0.008, 0.02])
def test_a_step_aside_is_told_by_how_much_a_motion_bent_before(aside):
    """Hands that held a carton lurched by 65 mm where a policy's chunks met with 8 mm, and lost it."""
    track = Foretelling(2.5, 0.15, 0.002)
    for time in np.arange(18) / 30.0:
        track.add(time, np.array([0.1 * time * time + (aside if time > 0.56 else 0.0)]))
    np.testing.assert_array_equal(track.at(AGES, 0.3)[:, 0], track.last[1][0])


def test_a_motion_that_bends_by_more_at_every_value_takes_no_step():
    for motion in (lambda t: 0.3 * np.sin(5.0 * t), lambda t: 2.0 * t**3):
        track = told(motion, np.arange(18) / 30.0)
        stepping = Foretelling(2.5, 9.0, 0.002)
        for time in np.arange(18) / 30.0:
            stepping.add(time, np.atleast_1d(motion(time)))
        np.testing.assert_array_equal(stepping.at(AGES, 0.3), track.at(AGES, 0.3))


def test_a_target_that_sets_off_at_once_is_a_motion_from_its_second_value_on():
    track = Foretelling(2.5, 9.0, 0.012)
    for time in np.arange(-10, 3) / 30.0:
        track.add(time, np.array([max(time + 1.0 / 30.0, 0.0)]))
    assert track.at(AGES, 0.3)[1, 0] - track.last[1][0] > 0.07
