"""The reach that was learned by `make loop`: both palms go to a goal each, drawn by a seed."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.codec import decode
from policy.action_spec.state import aligned_state, state_layout, state_numbers
from policy.chunk import ActionChunk
from policy.clock import EpisodeClock
from policy.errors import PolicyError
from policy.geometry.se3 import inverse, translated
from policy.learned.act import ActNetwork
from policy.observation import Observation

WEIGHTS = Path(__file__).with_name("reach.npz")
"""The network; what it learned from is in `README.md` beside it."""
LOW, HIGH = np.array([0.26, 0.10, 0.75]), np.array([0.42, 0.30, 1.15])
"""Corners of where a goal of the left palm can be, in the stance; the right one's are mirrored [m]; chosen: low ones
need a lean, all can be reached at once."""
REACHED = 0.03
"""Distance of a palm from its goal within which it is reached [m]; as of the trials in `docs/lerobot.md`."""
FIRST_SEED = 100_000
"""Added to a seed: as `make loop` evaluates, on goals that were not recorded; chosen."""
JOINED = 10
"""Steps in which a chunk comes from where the hands are to what the network says; measured: without, hands are 34
to 53 mm from what chunks say just after one was joined, with it 8 to 17 mm, and as many goals are reached."""
SECONDS = 5.0
"""Time of an episode [s]; derived: the 150 steps of the task."""


def goals_of(rng: np.random.Generator) -> np.ndarray:
    """Goals of the left and right palm in the stance, drawn from somebody's numbers, shape (2, 3), [m]."""
    return rng.uniform(LOW, HIGH, (2, 3)) * np.array([[1.0, 1.0, 1.0], [1.0, -1.0, 1.0]])


@cache
def network() -> ActNetwork:
    """The network in the package, read once."""
    return ActNetwork.load(WEIGHTS)


class LearnedReach:
    """Answers where the robot is with the next two thirds of a second of a way to its goals.

    Args:
        seed: Of the goals.
        robot: The robot that it is for; the G1 with Dex3 hands, or None for it.

    Attributes:
        name: What the CLI and reports call it.
        goals: Of the left and right palm in the stance, shape (2, 3), [m].
        duration: Time of an episode [s].
        off: Larger distance of a palm from its goal when it was last seen [m].

    Raises:
        PolicyError: If it is for another robot.
    """

    sees_robot = True

    def __init__(self, seed: int = 0, robot: RobotSpec | None = None) -> None:
        if robot not in (None, g1()):
            raise PolicyError(f"it learned on the G1 with Dex3 hands, which {robot.name} is not")
        self.name, self.duration, self.spec = f"learned#{seed}", SECONDS, builtin("wbc32")
        self.goals = goals_of(np.random.default_rng(FIRST_SEED + seed))
        self._state, self._hands = state_layout(self.spec), aligned_state(self.spec)
        self._network, self._clock = network(), EpisodeClock()
        self.off = np.inf

    @property
    def told(self) -> str:
        """What became of its goals, in words."""
        far = f"{1e3 * self.off:.0f} mm from the goal of the farther palm when it last looked"
        return f"{far}: {'reached' if self.off <= REACHED else 'not reached'}"

    def reset(self, task: str = "") -> None:
        """Begin an episode; the task is told by the goals alone."""
        self._clock.reset()
        self.off = np.inf

    def infer(self, observation: Observation) -> ActionChunk:
        """Chunk that answers an observation.

        Raises:
            ObservationError: If time goes back without a reset.
            ChunkError: If what the network made is no rotation.
        """
        robot = self.spec.robot
        anchor = Anchor.measured(observation, robot)
        seq, _ = self._clock.tick(observation.time)
        ways = self.goals - self._palms(anchor)
        self.off = float(np.linalg.norm(ways, axis=1).max())
        shown = ways.ravel()
        state = np.concatenate([state_numbers(self._state, observation, anchor), shown])
        actions = self._network.chunk(state, shown)
        here = state_numbers(self._hands, observation, anchor)
        fade = np.clip(1.0 - np.arange(len(actions)) / JOINED, 0.0, 1.0)
        actions += fade[:, None] * (here - actions[0])
        return decode(self.spec, actions, anchor, seq=seq, t_obs=observation.time)

    def _palms(self, anchor: Anchor) -> np.ndarray:
        """Palm points in the stance, shape (2, 3), [m]."""
        T = inverse(anchor.T_world_stance) @ anchor.T_world_base
        hands = (("lhand", "left"), ("rhand", "right"))
        robot = self.spec.robot
        return np.array(
            [translated(T @ anchor.poses[hand], np.array(robot.tool(side).palm_offset))[:3, 3] for hand, side in hands]
        )
