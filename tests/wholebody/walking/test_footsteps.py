"""Strategy: steps along bases that move, against where both feet have to be and what legs can do.

The base is midway between the soles when both carry; every step is in the box of its stance foot, whatever is told; a
base that comes to its goal has both feet beside it after the last step. What is foreseen of a base is where it goes.
"""

from dataclasses import replace

import numpy as np
import pytest

from wholebody.walking.footsteps import LEFT, RIGHT, base_of, beside, box, closed, footsteps
from wholebody.walking.gait import Gait
from wholebody.walking.guide import AWAY, COMING, Guide
from wholebody.walking.places import Place, Velocity, moved

GAIT, WIDTH = Gait(), 0.24
START = Place(0.3 + 0.2j, 0.4)
SOLES = [beside(START, foot, WIDTH) for foot in (LEFT, RIGHT)]


def guided(velocity, time=1.0):
    guide = Guide(START)
    guide.follow(velocity)
    for _ in range(round(time / 0.002)):
        guide.advance(0.002)
    return guide


@pytest.mark.parametrize("velocity", [Velocity(0.3 + 0j), Velocity(0.1j), Velocity(0.2 - 0.05j, 0.3), Velocity(-0.2)])
def test_the_base_is_midway_between_the_soles_when_both_carry(velocity):
    guide, gait = guided(velocity), replace(GAIT, apart=GAIT.wide)
    steps = footsteps(SOLES, RIGHT, guide, WIDTH, gait, start=0.4, least=6, most=6)
    assert [step.foot for step in steps] == [RIGHT, LEFT, RIGHT, LEFT, RIGHT, LEFT]
    for k in range(3, 6):
        both = [steps[k - 1].sole, steps[k].sole]
        middle = both[0].between(both[1])
        time = 0.4 + k * gait.step + 0.5 * gait.double
        (base, _), *_ = guide.foresee([time])
        # On an arc both soles are a little behind: by the sine of half a step's turn.
        assert abs(middle.point - base.point) < 0.01 + 0.5 * WIDTH * abs(velocity.turn) * 0.5 * gait.step
        assert abs(middle.turn_to(base)) < 0.01


def test_every_step_is_within_what_legs_can_do():
    rng = np.random.default_rng(0)
    for _ in range(50):
        velocity = Velocity(complex(*rng.normal(0.0, 0.6, 2)), rng.normal())
        first = int(rng.integers(2))
        steps = footsteps(SOLES, first, guided(velocity), WIDTH, GAIT, start=0.4, least=5, most=5)
        there = list(SOLES)
        for step in steps:
            low, high = box(step.foot, GAIT, GAIT.apart)
            seen = there[1 - step.foot].seen(step.sole.point)
            assert low.real - 1e-9 <= seen.real <= high.real + 1e-9
            assert low.imag - 1e-9 <= seen.imag <= high.imag + 1e-9
            there[step.foot] = step.sole


def test_the_last_steps_close_the_feet_beside_the_base():
    guide = guided(Velocity(0.3 + 0j, 0.2))
    guide.follow(Velocity())
    steps = footsteps(SOLES, LEFT, guide, WIDTH, GAIT, start=0.4, least=1, most=8)
    assert len(steps) < 8
    (base, rests), *_ = guide.foresee([5.0])
    assert rests
    there = list(SOLES)
    for step in steps:
        there[step.foot] = step.sole
    assert closed(there, base, WIDTH)
    assert abs(base_of(there).point - base.point) < 0.01


def test_a_base_at_rest_on_its_feet_still_makes_one_step():
    steps = footsteps(SOLES, LEFT, Guide(START), WIDTH, GAIT, start=0.4, least=1, most=4)
    assert len(steps) == 1
    assert abs(steps[0].sole.point - SOLES[LEFT].point) < 1e-9


def test_what_is_foreseen_of_a_base_is_where_it_goes():
    guide = guided(Velocity(0.3 + 0j, 0.2), time=0.3)
    foreseen = [place for place, _ in guide.foresee([0.5, 1.5, 3.0])]
    now = 0.0
    for time, place in zip((0.5, 1.5, 3.0), foreseen, strict=True):
        while now < time - 1e-9:
            guide.advance(0.002)
            now += 0.002
        assert abs(guide.place.point - place.point) < 2e-3


def test_a_base_comes_smoothly_after_a_foot_that_is_far_from_its_place():
    guide, speeds, way = Guide(START), [], 0.2 - 0.1j
    guide.come_after(0.9 * AWAY)
    assert guide.foresee([0.0]) == [(START, True)]
    guide.come_after(way)
    (base, _), *_ = guide.foresee([0.0])
    assert abs(base.point - START.point - way) < 1e-12
    for _ in range(1500):
        before, (told, _) = guide.place.point, guide.motion()
        guide.come(0.002)
        speeds.append(guide.motion()[0])
        assert abs(guide.place.point - before - 0.002 * speeds[-1]) < 2e-6
        assert abs(speeds[-1] - told) <= 0.002 * COMING**2 * abs(way) + 1e-3
    assert speeds[-1] == 0.0
    assert abs(guide.place.point - START.point - way) < 1e-3


def test_a_base_goes_to_its_goal_and_stays():
    goal = START.to(0.7 - 0.3j, -0.8)
    guide, speeds = Guide(START), []
    guide.go_to(goal)
    for _ in range(6000):
        guide.advance(0.002)
        speeds.append(abs(guide.velocity.way))
    assert guide.rests
    assert guide.place == goal
    assert max(speeds) < 0.351, "m/s: steps to a goal are a little slower than the 0.4 that was walked"


def test_a_velocity_that_turns_leads_on_an_arc():
    place = moved(Place(0j, 0.0), Velocity(0.2 + 0j, 0.5), 2.0 * np.pi / 0.5)
    assert abs(place.point) < 1e-12
    half = moved(Place(0j, 0.0), Velocity(0.2 + 0j, 0.5), np.pi / 0.5)
    assert half.point == pytest.approx(0.8j)
