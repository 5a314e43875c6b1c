"""Strategy: the prefix as raw actions, seen from a pelvis that has moved, decodes to what is executed."""

import numpy as np

from policy.action_spec.builtin import builtin
from policy.action_spec.codec import decode
from policy.prefix import Prefix, PrefixPolicy
from policy.scripted.library import scripted_policy
from tests.support.policy_cases import anchor_somewhere, wandering_chunk


def test_the_left_over_actions_are_what_is_executed_seen_from_the_new_observation():
    spec, before, now = builtin("wbc32"), anchor_somewhere(0), anchor_somewhere(5)
    executed = wandering_chunk(before, steps=8)
    raw = Prefix(executed, 5, 2, 4).left_over(spec, now)
    assert raw.shape == (5, 32)
    again = decode(spec, raw, now, t_obs=executed.t_obs)
    np.testing.assert_allclose(again.T_world_lhand, executed.T_world_lhand[:5], atol=1e-9)
    np.testing.assert_allclose(again.q_rhand, executed.q_rhand[:5], atol=1e-12)


def test_a_script_is_no_prefix_policy():
    assert not isinstance(scripted_policy("wave"), PrefixPolicy)
