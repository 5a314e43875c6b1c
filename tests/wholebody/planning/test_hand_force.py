"""Strategy: still hands that are told of a force, judged by their plans, beside the same with another force.

What a bound is made of is held against its parts elsewhere (`tests/wholebody/control/test_touch.py`); here against what
follows from it: softer holds, forces that cancel tip nothing, a told touch is no obstacle.
"""

from dataclasses import replace

import numpy as np
import pytest

from policy.action_spec.builtin import builtin
from policy.scripted.policy import stance_pose, to_chunk
from wholebody import judge


def codes(verdict):
    return [violation.code for violation in verdict.violations]


def margin(verdict, code):
    return next(one for one in verdict.margins if one.code == code)


def pushing(force, palm=(0.36, 0.20, 0.86), **more):
    """Both palms held, the left one told of a force [N]."""
    still, steps, left = stance_pose(), 50, np.array(palm)
    palms = {"p_world_lpalm": np.tile(left, (steps, 1)), "p_world_rpalm": np.tile(left * [1.0, -1.0, 1.0], (steps, 1))}
    motion = replace(still, **palms, f_world_lpalm=np.array(force), **more)
    return to_chunk(motion, builtin("wbc32").id, 0, 0.0, 30.0, steps)


def test_a_force_that_is_told_has_a_margin_and_what_would_do():
    """A palm presses down with what its wrist holds; ahead of the body it is pulled with what balance holds."""
    soft, hard = judge(pushing([0.0, 0.0, 20.0])), judge(pushing([0.0, 0.0, 40.0]))
    assert soft.verdict == "feasible"
    assert margin(soft, "hand_force").margin > 5.0
    assert (hard.verdict, codes(hard)[0]) == ("infeasible", "hand_force")
    one, bound = hard.violations[0], margin(hard, "hand_force").bound
    assert (one.value, one.bound, one.subject, one.unit) == (40.0, bound, "left hand", "N")
    assert hard.would_do[0].kind == "softer"
    assert f"would do: left hand pushing with {int(bound)} N" in hard.headline
    again = judge(pushing([0.0, 0.0, 0.99 * hard.would_do[0].force]))
    assert again.verdict == "feasible"


def test_forces_on_both_hands_count_together_and_limits_of_a_chunk_hold():
    """Two palms that press against each other tip nothing; a palm that may push with 10 N does not with 20."""
    squeeze = pushing([0.0, 30.0, 0.0], f_world_rpalm=np.array([0.0, -30.0, 0.0]))
    shove = pushing([30.0, 0.0, 0.0], f_world_rpalm=np.array([30.0, 0.0, 0.0]))
    assert margin(judge(squeeze), "hand_force").margin > 0.0 > margin(judge(shove), "hand_force").margin
    limited = replace(pushing([0.0, 0.0, 20.0]), force_max=np.full((50, 2), 10.0))
    assert margin(judge(limited), "hand_force").bound == 10.0
    by_axis = replace(limited, force_max=np.tile([40.0, 40.0, 9.0], (50, 2, 1)))
    assert margin(judge(by_axis), "hand_force").bound == pytest.approx(9.0)
    askew = replace(pushing([0.0, 12.0, 16.0]), force_max=by_axis.force_max)
    assert margin(judge(askew), "hand_force").bound == pytest.approx(9.0 / 0.8)
    assert not [one for one in judge(pushing([0.0, 0.0, 0.0])).margins if one.code == "hand_force"]


def test_hands_may_touch_the_table_told_and_untold():
    """9 mm into it, as the simulation allows; a wrist may not, told or not."""
    into, lower = [0.36, 0.20, 0.785], [0.36, 0.20, 0.76]
    force = {"f_world_rpalm": np.array([0.0, 0.0, 10.0])}
    for told in ({}, force):
        assert "scene_contact" not in codes(judge(pushing([0.0, 0.0, 10.0], into, **told), scene="table"))
        assert "scene_contact" in codes(judge(pushing([0.0, 0.0, 10.0], lower, **told), scene="table"))
