"""The example that gates LeRobot's own loop: what is cleared is sent step by step, what cannot be done is not."""

import importlib.util
from pathlib import Path

import pytest
from lerobot.policies.act.modeling_act import ACTPolicy
from lerobot.policies.factory import make_pre_post_processors

from tests.support.tiny_policies import write_checkpoint

ROOT = Path(__file__).parents[3]
SPEC = importlib.util.spec_from_file_location("gated_policy", ROOT / "examples" / "gated_policy.py")
EXAMPLE = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(EXAMPLE)


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    path = write_checkpoint("act", tmp_path_factory.mktemp("act"), spec=EXAMPLE.LAYOUT, cameras=("head",))
    policy = ACTPolicy.from_pretrained(path)
    return policy, *make_pre_post_processors(policy.config, pretrained_path=str(path))


def test_a_chunk_that_can_be_done_is_sent(parts, capsys):
    robot = EXAMPLE.StandIn()
    (verdict,) = EXAMPLE.drive(robot, *parts, chunks=1)
    assert verdict.method == "fast"
    assert verdict.verdict != "infeasible"
    assert len(robot.sent) == EXAMPLE.SEND
    assert set(robot.sent[0]) == set(EXAMPLE.LAYOUT.feature_names)
    assert "nearest to its bound" in capsys.readouterr().out


def test_a_chunk_that_cannot_be_done_is_held_with_its_reason(parts, capsys):
    policy, preprocess, postprocess = parts
    robot, x = EXAMPLE.StandIn(), EXAMPLE.LAYOUT.feature_names.index("left_wrist_x.pos")

    def astray(actions):
        actions = postprocess(actions)
        actions[0, 10:, x] += 0.7
        return actions

    (verdict,) = EXAMPLE.drive(robot, policy, preprocess, astray, chunks=1)
    assert verdict.verdict == "infeasible"
    assert robot.sent == []
    assert capsys.readouterr().out.startswith("held: ")
