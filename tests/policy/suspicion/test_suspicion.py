"""Hypotheses about numbers: found where something is wrong, silent where nothing is, applied when a user says so.

Strategy: recordings are made from smooth random postures around people's (thresholds were measured on motions that are
no part of the repository: `tests/studies/suspicion.py`). Every corruption of `tests.support.corruptions` must be named
in most of them, none in any clean one; what a user says with ``--read-as`` must give the numbers back.
"""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from policy.geometry.rotations import rpy_to_matrix
from policy.geometry.se3 import make_transform
from policy.recorded.motion_csv import Motion
from policy.suspicion.corrections import READ_AS, ReadAsError, Table, corrected, require_known
from policy.suspicion.orders import TYPICAL, _typical
from policy.suspicion.rows import state_findings
from tests.support.corruptions import BODY, CORRUPTIONS, NAMES, ROBOT, clean, corrupted, findings, isaac

COPIES, FOUND = 12, 11
CORRECTED = {
    "Isaac's order (29 body joints)": "isaac_order", "left and right exchanged": "left_right",
    "fingers in Pinocchio's order": "finger_order", "all in Pinocchio's order": "pinocchio_order",
    "mirrored finger signs": "mirrored_fingers", "degrees": "degrees",
}  # fmt: skip


def made_up(seed):
    """A motion of 6 s at 60 Hz: each joint wanders smoothly around where people have it, within its range."""
    rng, steps = np.random.default_rng(seed), np.arange(360) / 60.0
    q = np.empty((len(steps), len(BODY)))
    for i, name in enumerate(BODY):
        low, high = ROBOT.position_min[i], ROBOT.position_max[i]
        middle, spread = _typical(name, low, high)
        waves = sum(rng.normal() * np.sin(rng.uniform(1.0, 4.0) * steps + rng.uniform(0, 6)) for _ in range(2))
        q[:, i] = np.clip(middle + 0.25 * spread * (rng.normal() + waves), low + 0.02, high - 0.02)
    wrists = [i for i, name in enumerate(BODY) if "wrist" in name]
    q[:, wrists] *= 0.5
    tilt = 0.1 * np.sin(steps + rng.uniform(0, 6))
    R = rpy_to_matrix(np.column_stack([tilt, -tilt, 0.3 * np.sin(0.5 * steps)]))
    return Motion(60.0, make_transform(R, np.tile([0.1, 0.0, 0.77], (len(R), 1))), q)


MOTIONS = [made_up(seed) for seed in range(4)]


@pytest.mark.parametrize("name", CORRUPTIONS)
def test_what_is_wrong_is_named(name):
    corrupt, codes = CORRUPTIONS[name]
    rng = np.random.default_rng(3)
    hits = [
        {one.check for one in findings(corrupted(corrupt, clean(MOTIONS, rng), rng))} & set(codes)
        for _ in range(COPIES)
    ]
    assert sum(map(bool, hits)) >= FOUND


def test_nothing_is_named_where_nothing_is_wrong():
    rng = np.random.default_rng(8)
    assert [one.sentence for _ in range(40) for one in findings(clean(MOTIONS, rng))] == []


@pytest.mark.parametrize("name", CORRECTED)
def test_what_a_hypothesis_names_gives_the_numbers_back(name):
    rng = np.random.default_rng(5)
    whole = next(one for one in (clean(MOTIONS, rng) for _ in range(20)) if one.names == NAMES)
    wrong = CORRUPTIONS[name][0](whole, rng)
    assert np.abs(wrong.q - whole.q).max() > 0.1
    again = corrected(Table(whole.names, wrong.q, 30.0, ROBOT), [CORRECTED[name]])
    np.testing.assert_allclose(again.values, whole.q, atol=1e-12)


def test_a_sentence_has_hypothesis_evidence_and_option():
    rng = np.random.default_rng(5)
    whole = next(one for one in (clean(MOTIONS, rng) for _ in range(20)) if one.names == NAMES)
    (found,) = [one for one in findings(isaac(whole, rng)) if one.check == "isaac_order"]
    assert found.sentence.startswith("it looks as if the joints are in breadth-first order, Isaac's: the 27 columns")
    assert found.cure == "--read-as isaac_order reads them so"


def test_rows_can_be_read_as_they_were():
    values = np.cumsum(np.random.default_rng(0).uniform(0.1, 1.0, (20, 3)), axis=0)
    table = Table(("", "", ""), np.repeat(values, 2, axis=0), 30.0, ROBOT)
    half = corrected(table, ["doubled_rows"])
    np.testing.assert_array_equal(half.values, values)
    assert half.fps == 15.0
    rolled = replace(table, values=np.roll(values, 1, axis=0))
    np.testing.assert_array_equal(corrected(rolled, ["rows_rolled"]).values, values)


def test_what_cannot_be_said_is_refused():
    with pytest.raises(ReadAsError, match="did you mean 'isaac_order'"):
        require_known(["isaac_oder"])
    with pytest.raises(ReadAsError, match="has no meaning for these 2 columns"):
        corrected(Table(("left_elbow_joint", ""), np.zeros((3, 2)), 30.0, ROBOT), ["isaac_order"])
    assert require_known(READ_AS) is None


def test_typical_joints_are_in_range_and_mirrored():
    assert {name.partition("_")[2].removesuffix("_joint") for name in BODY if name.startswith("left")} <= set(TYPICAL)
    for i, name in enumerate(BODY):
        middle, _ = _typical(name, ROBOT.position_min[i], ROBOT.position_max[i])
        assert g1().position_min[i] < middle < g1().position_max[i]


@pytest.mark.parametrize(
    ("state", "code"),
    [
        (lambda a: a.copy(), "state_is_action"),
        (lambda a: np.vstack([a[:1], a[:-1]]), "state_is_action"),
        (lambda a: np.column_stack([a[:, 0], 5.4 - a[:, 1]]), "gripper_complement"),
        (lambda a: a + np.array([0.3, 0.0]), "state_offset"),
    ],
)
def test_a_state_beside_its_action_is_told(state, code):
    steps = np.linspace(0.0, 6.0, 60)
    action = np.column_stack([np.sin(steps), 2.7 + 2.7 * np.cos(steps)])
    found = state_findings(state(action), action, ("left_elbow_joint", "left_grasp"))
    assert [one.check for one in found] == [code]
    noisy = action + np.random.default_rng(1).normal(0.0, 2e-3, action.shape)
    assert state_findings(noisy, action, ("left_elbow_joint", "left_grasp")) == []
