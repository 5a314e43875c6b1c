"""Strategy: swings flown period by period, also while place and time of the landing change.

No coordinate jumps: speeds and accelerations between two periods are bounded. The sole arrives in place, at its time,
with the landing speed, and nowhere lower than the floor before.
"""

import numpy as np
import pytest

from wholebody.walking.places import Place
from wholebody.walking.swing import EARLY, FASTEST_DOWN, LANDING_SPEED, LIFTED, Course, Swing

DT, TIME, LIFT = 0.002, 0.55, 0.05


def fly(goals, times):
    """A swing from the origin whose goal and time to the landing are told anew at each period."""
    swing, path, done = Swing.from_rest(Place(0j, 0.0), 0.0), [], 0.0
    for goal, left in zip(goals, times, strict=True):
        total = done + max(left, DT)
        swing = swing.advance(goal, 0.0, LIFT, min(done / total, 1.0), left, DT)
        done += DT
        path.append(swing)
    return path


def steady(goal, time=TIME):
    n = round(time / DT)
    return fly([goal] * n, [time - k * DT for k in range(n)])


def test_it_lands_in_place_at_its_time_with_the_landing_speed():
    goal = Place(0.3 + 0.05j, 0.2)
    path = steady(goal)
    last = path[-1]
    assert abs(last.place.point - goal.point) < 1e-6
    assert last.place.heading == pytest.approx(0.2)
    assert last.height.x == pytest.approx(0.0, abs=3e-4)
    assert last.height.v == pytest.approx(-LANDING_SPEED, abs=1e-3)
    heights = np.array([one.height.x for one in path])
    assert heights.max() == pytest.approx(LIFT, abs=1e-4)
    assert abs(heights.argmax() * DT - LIFTED * TIME) < 0.02
    assert heights.min() >= 0.0


def test_it_stands_still_over_its_place_before_it_lands():
    path = steady(Place(0.3 + 0j, 0.0))
    late = path[-round(0.5 * EARLY / DT) :]
    assert max(abs(one.way.v) for one in late) < 0.02


def test_a_goal_that_moves_makes_no_jump():
    rng, n = np.random.default_rng(1), round(TIME / DT)
    changes = [Place(0.2 + 0.05 * complex(*rng.normal(size=2)), 0.0) for _ in range(4)]
    goals = [changes[min(4 * k // n, 2)] for k in range(n)]
    times = [TIME - k * DT - (0.1 if k > n // 2 else 0.0) for k in range(n)]
    keep = [k for k in range(n) if times[k] > 0.0]
    path = fly([goals[k] for k in keep], [times[k] for k in keep])
    speed = np.abs(np.diff([one.way.v for one in path]))
    assert speed.max() < 60.0 * DT
    assert abs(path[-1].place.point - goals[keep[-1]].point) < 0.02
    lifted = np.abs(np.diff([one.height.v for one in path]))
    assert lifted.max() < 60.0 * DT


def test_past_its_time_it_goes_on_down_and_faster():
    path = fly([Place(0.1 + 0j, 0.0)] * 312, [TIME - k * DT for k in range(312)])
    assert path[-1].height.x < -0.02
    assert path[-1].height.v == -FASTEST_DOWN
    assert path[-1].way.v == 0.0


def test_a_sole_that_stood_tilted_is_flat_once_it_is_up():
    swing, leans = Swing.from_rest(Place(0j, 0.0), 0.0, 0.12 - 0.05j), []
    n = round(TIME / DT)
    for k in range(n):
        swing = swing.advance(Place(0.3 + 0j, 0.0), 0.0, LIFT, k / n, TIME - k * DT, DT, 0.02j)
        leans.append(swing.lean.x)
    assert abs(leans[0] - (0.12 - 0.05j)) < 1e-5, "at first it is led as it stood"
    assert np.abs(np.diff(leans)).max() < 2.5 * abs(leans[0] - 0.02j) * DT / (LIFTED * TIME)
    assert set(leans[round(LIFTED * n) + 2 :]) == {0.02j}


def test_a_course_is_a_quintic():
    course, path = Course(0.2, 0.5, -1.0), []
    for k in range(100):
        course = course.towards(Course(1.0, -0.3, 0.2), 0.2 - k * DT, DT)
        path.append(course.x)
    assert (course.x, course.v, course.a) == pytest.approx((1.0, -0.3, 0.2))
    # The sixth differences of a polynomial of the fifth degree vanish.
    assert np.abs(np.diff([0.2, *path], 6)).max() < 1e-9


def test_a_foot_turns_the_shorter_way():
    """Headings are measured between -pi and pi, and a base that goes on turning has none of these bounds."""
    swing = Swing.from_rest(Place(0j, np.pi - 0.1), 0.0)
    for k in range(100):
        swing = swing.advance(
            Place(0.1 + 0j, 0.1 - np.pi), 0.0, 0.04, k / 100.0, TIME * (1.0 - k / 100.0), TIME / 100.0
        )
    assert swing.heading.x == pytest.approx(np.pi + 0.1)
