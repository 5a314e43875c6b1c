"""Strategy: a short walk of another gait is made, written as a motion file, and walked in MuJoCo; hands drawn at random
come back where a robot that walks can have them."""

import numpy as np
import pytest

from policy import write_motion_csv
from policy.recorded.replay import WalkedReplay, open_recording
from tests.support.made_walks import MadeWalk, along, made_walk
from tests.support.recorded_walks import LIMITS, replayed
from wholebody.cli.options import Simulation
from wholebody.cli.simulated import settings_of
from wholebody.cli.sources import walks_of
from wholebody.config import ControllerConfig
from wholebody.execution.feet.hands_of_walks import LOWERED
from wholebody.execution.feet.recorded_walks import walk_limits
from wholebody.types import Reason

HANDS = LIMITS.nearest.__self__


def test_a_recorded_walk_is_walked_with_its_hands():
    motion = made_walk(MadeWalk((along(1.6, 0.45, 0.0, 0.3),), fps=50.0, step=0.55, swing=0.2))
    numbers, verdict, result = replayed(motion, hold=0.3)
    assert result.fall is None
    assert numbers["steps"] >= 4
    assert numbers["palms_near"] > 0.95
    assert numbers["base_off"] < 0.15
    assert verdict.verdict == "feasible_after_repair"
    pelvis, pace = [one for one in verdict.violations if one.severity == "repair"]
    assert {pelvis.code, pace.code} == {Reason.CHANGED_NUMBERS}
    assert "the pelvis tilts by up to 3 deg" in pelvis.subject
    assert "x slower than it was recorded" in pace.subject


@pytest.mark.parametrize("low", [0.0, 0.5 * LOWERED, LOWERED])
def test_hands_are_drawn_in_to_where_a_walk_can_have_them(low):
    points = np.random.default_rng(4).uniform(-0.8, 0.9, (2, 2000, 3))
    pelvis = np.eye(4)
    pelvis[2, 3] = -low
    assert HANDS.why_not_there(LIMITS.nearest(points), pelvis) is None


def test_hands_that_a_walk_can_have_stay_where_they_are():
    near = LIMITS.nearest(np.random.default_rng(5).uniform(-0.8, 0.9, (2, 500, 3)))
    np.testing.assert_allclose(LIMITS.nearest(near), near, atol=1e-3)
    inside = np.array([[[0.25, 0.15, 0.15]], [[0.25, -0.15, 0.15]]])
    np.testing.assert_array_equal(LIMITS.nearest(inside), inside)


def test_a_robot_walks_with_a_file_where_its_settings_let_it(tmp_path):
    settings = tmp_path / "settings.yaml"
    settings.write_text("steps: reach\n")
    write_motion_csv(tmp_path / "walk.csv", made_walk(MadeWalk((along(2.0, 0.45, 0.0, 0.0),))))
    limits = walks_of(settings_of(Simulation(config=settings)))
    assert isinstance(open_recording(tmp_path / "walk.csv", fps=60.0, walks=limits), WalkedReplay)
    assert walks_of(settings_of(Simulation())) is None
    assert walk_limits(ControllerConfig(steps="recover")) is None
    velocity = np.array([[0.4, 0.0, 0.0], [0.0, 0.06, 0.25]])
    np.testing.assert_allclose(LIMITS.share(velocity), [1.0, np.hypot(0.3, 0.5)])
