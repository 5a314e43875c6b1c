"""Strategy: a tiny π0.5 whose noise is samples half of which plans call infeasible, with and without guidance."""

import numpy as np
import pytest

from policy.action_spec.builtin import builtin
from tests.support import tiny_policies as tiny
from tests.support.guided_pi05 import guided_pi05, samples_of
from tests.support.sampled_chunks import FPS, sampled_set
from wholebody import FastChecker, Guide, InputError, guided

SET = 15


@pytest.fixture(scope="module")
def policy(tmp_path_factory):
    return guided_pi05(tmp_path_factory.mktemp("pi05"))


@pytest.fixture(scope="module")
def guide():
    return Guide(fps=FPS)


def test_guidance_halves_what_is_infeasible_and_ends_with_its_block(policy, guide):
    checker = FastChecker()

    def infeasible(chunks):
        begin = checker.judge.stance()
        return sum(checker.of_chunk(x, begin, "", (False, False), odds=False).verdict == "infeasible" for x in chunks)

    samples = sampled_set(SET)
    plain = samples_of(policy, samples)
    with guided(policy, guide):
        with guided(policy, guide, strength=0.0):
            pass
        led = samples_of(policy, samples)
    again = samples_of(policy, samples[:1])
    assert infeasible(plain) >= 6
    assert infeasible(led) <= infeasible(plain) / 2
    assert np.array_equal(again[0].T_world_lhand, plain[0].T_world_lhand)


def test_a_chunk_that_can_be_done_is_left_where_it_is(policy, guide):
    samples = [sampled_set(SET)[10]]
    plain = samples_of(policy, samples)[0]
    with guided(policy, guide):
        led = samples_of(policy, samples)[0]
    assert np.abs(led.T_world_lhand - plain.T_world_lhand)[:, :3, 3].max() < 0.01


def test_strength_is_the_share_of_the_correction(policy, guide):
    samples = [sampled_set(SET)[0]]
    plain, found = samples_of(policy, samples)[0], []
    for strength in (0.0, 0.5, 1.0):
        with guided(policy, guide, strength=strength):
            led = samples_of(policy, samples)[0]
        found.append(np.abs(led.T_world_rhand - plain.T_world_rhand).max())
    assert found[0] == 0.0 < found[1] < found[2]


def test_what_does_not_denoise_or_has_another_layout_is_refused(policy, guide, tmp_path_factory):
    act = tiny.load(tiny.saved("act", tmp_path_factory))
    with pytest.raises(InputError, match="does not denoise"), guided(act, guide):
        pass
    other = Guide(builtin("wbc32-v1"), fps=FPS)
    with pytest.raises(InputError, match="give it that layout"), guided(policy, other):
        pass
