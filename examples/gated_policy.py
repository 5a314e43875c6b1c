"""A gate in LeRobot's own loop: a chunk is asked for, judged in milliseconds, and only then sent, or held.

The policy, its processors and the loop are LeRobot's; the controller behind `send_action` is anybody's. `judge` neither
simulates nor commands anything. `docs/verdict.md` says what its answer means.

    python examples/gated_policy.py                an ACT of random weights, made on the spot
    python examples/gated_policy.py CHECKPOINT     your own ACT, that answers in wbc32
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch
from lerobot.policies.act.modeling_act import ACTPolicy
from lerobot.policies.factory import make_pre_post_processors

from models import g1
from policy import Anchor, builtin, decode
from policy.action_spec.state import state_layout, state_numbers
from wholebody import MujocoPlant, Robot, judge
from wholebody.episode.observation import observation_of

LAYOUT = builtin("wbc32")
SEND = 25
"""Steps of a chunk that are sent before the next one is asked for."""


class StandIn:
    """In place of your robot: what LeRobot's loop asks of one, and what a gate needs to know of it."""

    def __init__(self):
        self.spec, self.sent = g1(), []
        self.robot, self.state = Robot(self.spec), MujocoPlant(self.spec).reset()

    def get_observation(self):
        """State in the slots of the layout, images in [0, 1] with channels first."""
        numbers = state_numbers(state_layout(LAYOUT), self.seen())
        return {
            "observation.state": torch.from_numpy(numbers.astype(np.float32)),
            "observation.images.head": torch.full((3, 64, 64), 0.5),
        }

    def seen(self):
        """Joints and pelvis as measured: what the numbers of a chunk are relative to."""
        return observation_of(self.spec, self.robot, self.state)

    def send_action(self, action):
        """One step, by name. Yours goes to your controller."""
        self.sent.append(action)

    def hold(self):
        """Stay: nothing new is sent."""


def drive(robot, policy, preprocess, postprocess, chunks=2):
    """The loop. The gate is the line with `judge`."""
    verdicts = []
    for _ in range(chunks):
        seen, state = robot.seen(), robot.state
        batch = preprocess(robot.get_observation())
        with torch.no_grad():
            actions = postprocess(policy.predict_action_chunk(batch))[0].double().numpy()
        chunk = decode(LAYOUT, actions, Anchor.measured(seen), t_obs=seen.time)
        verdict = judge(chunk, state, orientation_free=LAYOUT.orientation_free)
        verdicts.append(verdict)
        if verdict.verdict == "infeasible":
            print(f"held: {verdict.violations[0].code}, {verdict.violations[0].subject}")
            robot.hold()
            continue
        print(f"{verdict.verdict}, judged by a {verdict.decided_by}; nearest to its bound: {verdict.margins[0].code}")
        for action in actions[:SEND]:
            robot.send_action(dict(zip(LAYOUT.feature_names, action, strict=True)))
    return verdicts


def main(path):
    """A checkpoint as LeRobot loads it."""
    policy = ACTPolicy.from_pretrained(path)
    preprocess, postprocess = make_pre_post_processors(policy.config, pretrained_path=str(path))
    return drive(StandIn(), policy, preprocess, postprocess)


def main_with_tiny_weights():
    """The same with random weights: the ones that the tests use."""
    sys.path.insert(0, str(Path(__file__).parent.parent))
    from tests.support.tiny_policies import write_checkpoint

    with TemporaryDirectory() as folder:
        return main(write_checkpoint("act", folder, cameras=("head",)))


if __name__ == "__main__":
    main(sys.argv[1]) if len(sys.argv) > 1 else main_with_tiny_weights()
