"""Strategy: chunks that one change cures, and one that nothing cures."""

import numpy as np
import pytest

from tests.support.planted_causes import holder, planted
from tests.support.sent_chunks import sent
from wholebody.config import ControllerConfig, LoadConfig
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.repair import slowed


@pytest.fixture(scope="module")
def checker():
    return FastChecker()


def test_a_path_is_slowed_down_along_itself():
    chunk = sent(to=(0.3, 0.0, 0.0))
    slow = slowed(chunk, 2.0)
    assert len(slow) == 2 * len(chunk) - 1
    np.testing.assert_allclose(slow.T_world_lhand[::2], chunk.T_world_lhand, atol=1e-9)
    np.testing.assert_allclose(slow.q_lhand[::2], chunk.q_lhand, atol=1e-9)
    assert slowed(chunk, 1.0) is chunk


def test_what_is_too_fast_is_slowed_down_no_more_than_it_needs(checker):
    repairer = checker.repairer(sent(to=(0.4, 0.1, 0.2), time=0.35))
    change = repairer.repaired()
    assert (change.kind, change.moved, change.turned) == ("slower", pytest.approx(0.0, abs=1e-9), pytest.approx(0.0))
    assert repairer.holds(change.chunk)
    assert not repairer.holds(slowed(repairer.chunk, 0.93 * change.slower))


def test_of_a_load_that_is_too_heavy_less_would_do():
    checker = FastChecker(ControllerConfig(loads=LoadConfig(source="told", left=5.0)))
    repairer = checker.repairer(sent(to=(0.18, 0.15, 0.15), time=1.4))
    one = checker.explainer.single_changes(repairer.chunk, checker.judge.first_pose(repairer.chunk)).lighter()
    assert 0.0 < one.lighter < 5.0
    assert checker.judge.loads == (5.0, 0.0)
    assert not repairer.holds(one.chunk)
    checker.judge.carry(5.0 - one.lighter, 0.0)
    assert repairer.holds(one.chunk)


def test_palms_are_turned_alone_where_moving_them_too_would_be_another_motion():
    one = planted("arm_torque", 0)
    checker = holder(one.config, one.scene)
    repairer = checker.repairer(one.chunk)
    change = repairer.repaired()
    assert change.kind == "turned"
    assert change.moved == pytest.approx(0.0, abs=1e-9)
    assert 0.0 < change.turned <= checker.config.verdict.turn_repair
    assert repairer.holds(change.chunk)


def test_another_motion_is_no_repair_and_what_it_would_take_is_told(checker):
    repairer = checker.repairer(sent(to=(2.0, 0.0, 0.0), time=1.5))
    assert repairer.repaired() is None
    (single,) = checker.explainer.single_changes(repairer.chunk, checker.judge.first_pose(repairer.chunk)).all()
    assert single.kind == "moved"
    assert single.moved > 1.0
    assert repairer.holds(single.chunk)
