"""Strategy: palms are compared with those of `decode`, gradients with central differences of the cost along smooth
changes, and what a step along them mends is judged by plans.
"""

import numpy as np
import pytest
import torch

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import LAYOUTS, builtin
from policy.action_spec.codec import decode, encode
from tests.support import tiny_policies as tiny
from tests.support.sampled_chunks import FPS, sampled_set
from tests.support.sent_chunks import SPEC, STANCE, sent
from tests.support.stranger_chunks import sent as turned
from wholebody import Guide, InputError, RobotState
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.guide.guide import BY
from wholebody.guide.wrists import wrists
from wholebody.robot.palms import palm_offsets, palm_poses
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.given.many import score

OFFSETS = palm_offsets(describe(ControllerConfig().robot))
OF_WRISTS = [name for name in LAYOUTS if any(slot.kind == "rot6d" for slot in builtin(name).slots)]
SET = 15
"""A set of which seven chunks are feasible by plans, and seven infeasible."""


@pytest.fixture(scope="module")
def guide():
    return Guide(fps=FPS)


@pytest.fixture(scope="module")
def actions():
    return np.stack([encode(SPEC, chunk, STANCE) for chunk in sampled_set(SET)])


@pytest.fixture(scope="module")
def checker():
    return FastChecker()


def true_scores(checker, actions):
    """Scores of verdicts by plans, begun in the stance."""
    begin, chunks = checker.judge.stance(), [decode(SPEC, one, STANCE, fps=FPS) for one in actions]
    verdicts = [checker.of_chunk(one, begin, "", (False, False), odds=False) for one in chunks]
    return np.array([score(one, checker.config.verdict) for one in verdicts])


def smooth(shape, seed):
    """A change that grows with time, of the numbers of both wrists."""
    change = np.zeros(shape)
    change[:, :, :18] = np.linspace(0.0, 1.0, shape[1])[:, None] ** 2
    change[:, :, :18] *= np.random.default_rng(seed).normal(size=(shape[0], 1, 18))
    return change


@pytest.mark.parametrize("name", OF_WRISTS)
def test_palms_are_those_of_the_decoded_chunk_and_back(name):
    spec, anchor = builtin(name), Anchor.nominal()
    try:
        both = wrists(spec, anchor, OFFSETS)
    except InputError:
        assert any("delta" in slot.mode for slot in spec.slots if "wrist" in slot.name)
        return
    numbers = encode(spec, sent(to=(0.1, 0.05, 0.2)), anchor)
    numbers = numbers + 0.01 * np.random.default_rng(0).normal(size=numbers.shape)
    chunk = decode(spec, numbers, anchor)
    for hand, T in enumerate((chunk.T_world_lhand, chunk.T_world_rhand)):
        wanted = palm_poses(np.stack([T, T], axis=1), OFFSETS)[:, hand]
        for given in (numbers, torch.tensor(numbers)):
            p, R = both[hand].palm(given)
            assert np.allclose(p, wanted[:, :3, 3], atol=1e-9)
            assert np.allclose(R, wanted[:, :3, :3], atol=1e-9)
        p, R = wanted[:, :3, 3] + 0.05, wanted[::-1, :3, :3]
        moved = both[hand].palm(both[hand].moved(numbers, p, R))
        assert np.allclose(moved[0], p, atol=1e-3)
        assert np.allclose(moved[1], R, atol=2e-2)


def test_a_layout_of_joints_has_no_gradient():
    with pytest.raises(InputError, match="rot6d"):
        Guide("joint28")


def test_what_is_infeasible_costs_more_than_what_is_feasible(guide, actions, checker):
    worst, answers = guide.worst(actions), true_scores(checker, actions)
    assert worst[answers == 0.0].max() < worst[answers > 1.0].min()
    assert np.array_equal(guide.worst(actions[3:5]), worst[3:5])


def test_gradients_are_central_differences_of_the_cost(guide, actions):
    numbers = torch.tensor(actions, requires_grad=True)
    cost = guide(numbers)
    cost.total.sum().backward()
    some, h, both = guide.worst(actions) > 0.5, 3e-3, []
    for seed in range(3):
        change = smooth(actions.shape, seed)
        slope = (guide(actions + h * change).total - guide(actions - h * change).total).numpy() / (2.0 * h)
        both.append(np.stack([slope, (numbers.grad.numpy() * change).sum((1, 2))])[:, some])
    slopes, given = np.hstack(both)
    assert np.corrcoef(slopes, given)[0, 1] > 0.97
    assert abs(slopes @ given / (given @ given) - 1.0) < 0.15


def test_parts_sum_to_the_cost_and_name_what_holds_palms_back(guide, actions):
    cost = guide(actions)
    assert set(cost.parts) == {*BY, "speed"}
    assert torch.allclose(sum(cost.parts.values()), cost.total)
    far = np.stack([encode(SPEC, sent(to=(0.6, 0.0, -0.3), time=1.5), STANCE)])
    parts = guide(far).parts
    assert float(parts["balance"] + parts["posture"] + parts["joint_range"] + parts["torque"]) > 1.0
    assert float(parts["speed"]) == 0.0


def test_hands_in_each_other_cost_distance_and_hands_that_leap_cost_speed(guide):
    fast = guide(np.stack([encode(SPEC, sent(to=(0.1, 0.0, 0.1), time=0.1), STANCE)])).parts
    assert float(fast["speed"]) > 0.01
    chunk = sampled_set(54)[9]  # one palm in the other
    parts = guide(np.stack([encode(SPEC, chunk, STANCE)])).parts
    assert float(parts["self_distance"]) > 0.5 * float(sum(parts.values()))


def test_the_gradient_of_speed_is_that_of_its_cost(guide):
    actions = np.stack([encode(SPEC, sent(to=(0.1, 0.0, 0.1), time=0.1), STANCE)])
    change = np.random.default_rng(0).normal(size=actions.shape) * (np.arange(32) < 18)
    numbers, h = torch.tensor(actions, requires_grad=True), 1e-6
    guide(numbers).parts["speed"].sum().backward()
    ends = [float(guide(actions + sign * h * change).parts["speed"].detach()) for sign in (1.0, -1.0)]
    slope = (ends[0] - ends[1]) / (2.0 * h)
    assert slope == pytest.approx(float((numbers.grad.numpy() * change).sum()), rel=1e-4)


def test_a_correction_lowers_the_true_score_of_what_is_infeasible(guide, actions, checker):
    before = true_scores(checker, actions)
    bad = actions[before > 1.0]
    after = true_scores(checker, guide.corrected(bad))
    assert len(bad) > 5
    assert (after < before[before > 1.0]).mean() >= 0.9
    assert (after <= 1.0).mean() >= 0.5
    still = guide.corrected(actions[before == 0.0])
    assert np.abs(still - actions[before == 0.0])[:, :, :3].max() < checker.config.verdict.palm_feasible


def test_a_free_orientation_costs_nothing():
    palms = palm_poses(STANCE.T_world_base @ np.stack([STANCE.poses[x] for x in ("lhand", "rhand")]), OFFSETS)
    share = np.linspace(0.0, 1.0, 50)
    goals = np.array([[0.5, 0.25, 1.0], palms[1, :3, 3]])  # an arm's length ahead, fingers to the robot
    chunk = turned(goals, [np.array([0.0, 0.0, 2.8]), np.zeros(3)], share, FPS)
    actions = np.stack([encode(SPEC, chunk, STANCE)])
    bound, free = (Guide(fps=chunk.fps, orientation_free=(free, free)).worst(actions)[0] for free in (False, True))
    assert 2.0 * free < bound > 0.5


def test_costs_are_of_the_state_that_is_given(checker):
    """10 cm further ahead are in reach from the stance, and not of hands that are 40 cm ahead already."""
    spec, body = builtin("gr00t_g1"), checker.judge.first_pose(sent(jump=(0.4, 0.0, 0.0))).body
    actions = np.stack([encode(spec, sent(to=(0.1, 0.0, 0.0)), STANCE)])
    assert Guide(spec, state=RobotState(0.0, body.q, body.v), fps=FPS).worst(actions)[0] > 0.5
    assert Guide(spec, fps=FPS).worst(actions)[0] < 0.2


def test_a_policy_is_trained_with_the_cost_as_a_loss(guide, tmp_path):
    """The chunks of a tiny ACT are led into reach by steps of Adam on their cost alone."""
    network, _, _ = tiny.build("act", tmp_path, spec=SPEC)
    middle = torch.tensor(tiny.stats(SPEC)["action"]["mean"]) + torch.tensor([0.35, 0.0, -0.2] + [0.0] * 29)
    seen = tiny.observation()
    batch = {f"observation.images.{name}": torch.rand(1, 3, 64, 64) for name in tiny.CAMERAS}
    batch["observation.state"] = torch.zeros(1, network.config.input_features["observation.state"].shape[0])
    batch["observation.images"] = [batch[f"observation.images.{name}"] for name in seen.images]
    chooser, costs = torch.optim.Adam(network.model.action_head.parameters(), lr=0.03), []
    for _ in range(12):
        numbers = middle + 0.1 * network.model(batch)[0]
        loss = guide(numbers.double()).total.mean()
        chooser.zero_grad()
        loss.backward()
        chooser.step()
        costs.append(float(loss.detach()))
    assert costs[-1] < 0.5 * costs[0]


@pytest.mark.parametrize(
    ("wrong", "said"), [(np.zeros((50, 32)), "is expected"), (np.full((1, 50, 32), np.nan), "not finite")]
)
def test_misuse_is_told(guide, wrong, said):
    with pytest.raises(InputError, match=said):
        guide.corrected(wrong)
