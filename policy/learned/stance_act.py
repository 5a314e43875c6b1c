"""ACT whose wrists are in the stance frame, as a policy: what those in the package have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod

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

FIRST_SEED = 100_000
"""Added to a seed: as `make loop` evaluates, on what was not recorded; chosen."""
JOINED = 10
"""Steps in which a chunk comes from where it begins to what the network says; measured on reaches: without, hands are
34 to 53 mm from what chunks say just after one was joined, with it 8 to 17 mm, and as many goals are reached."""


class StanceAct(ABC):
    """Answers where the robot is with the next two thirds of a second of a way to what it is told of the task.

    Args:
        name: What the CLI and reports call it.
        network: What says that.
        duration: Time of an episode [s].
        robot: The robot that it is for; the G1 with Dex3 hands, or None for it.

    Raises:
        PolicyError: If it is for another robot.
    """

    sees_robot = True

    def __init__(self, name: str, network: ActNetwork, duration: float, robot: RobotSpec | None) -> None:
        if robot not in (None, g1()):
            raise PolicyError(f"it learned on the G1 with Dex3 hands, which {robot.name} is not")
        self.name, self.duration, self.spec = name, duration, builtin("wbc32")
        self._state, self._hands = state_layout(self.spec), aligned_state(self.spec)
        self._network, self._clock = network, EpisodeClock()
        self._last: tuple[float, np.ndarray] | None = None

    @property
    @abstractmethod
    def told(self) -> str:
        """What became of its task, in words."""

    def reset(self, task: str = "") -> None:
        """Begin an episode; the task is told by numbers alone."""
        self._clock.reset()
        self._last = None

    def infer(self, observation: Observation) -> ActionChunk:
        """Chunk that answers an observation.

        Raises:
            ObservationError: If time goes back without a reset, or something that it needs is not told.
            ChunkError: If what the network made is no rotation.
        """
        anchor = Anchor.measured(observation, self.spec.robot)
        seq, _ = self._clock.tick(observation.time)
        shown = self._shown(observation, anchor, self._palms(anchor))
        state = np.concatenate([state_numbers(self._state, observation, anchor), shown])
        actions = self._network.chunk(state, shown)
        fade = np.clip(1.0 - np.arange(len(actions)) / JOINED, 0.0, 1.0)
        actions += fade[:, None] * (self._begin(observation, anchor) - actions[0])
        self._last = observation.time, actions
        return decode(self.spec, actions, anchor, seq=seq, t_obs=observation.time)

    @abstractmethod
    def _shown(self, observation: Observation, anchor: Anchor, palms: np.ndarray) -> np.ndarray:
        """What is shown of the task (E,), given both palms in the stance (2, 3)."""

    def _begin(self, observation: Observation, anchor: Anchor) -> np.ndarray:
        """Action (A,) that a chunk begins with: what the hands do."""
        return state_numbers(self._hands, observation, anchor)

    def _asked(self, time: float) -> np.ndarray | None:
        """Action (A,) that the chunk before asks for at a time [s]; None where there was none."""
        if self._last is None:
            return None
        begin, actions = self._last
        return actions[min(round((time - begin) * self.spec.fps), len(actions) - 1)]

    def _palms(self, anchor: Anchor) -> np.ndarray:
        """Palm points in the stance, shape (2, 3), [m]."""
        T = inverse(anchor.T_world_stance) @ anchor.T_world_base
        hands = (("lhand", "left"), ("rhand", "right"))
        robot = self.spec.robot
        return np.array(
            [translated(T @ anchor.poses[hand], np.array(robot.tool(side).palm_offset))[:3, 3] for hand, side in hands]
        )
