"""What every policy offers."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from policy.action_spec.spec import ActionSpec
from policy.chunk import ActionChunk
from policy.observation import Observation


@runtime_checkable
class Policy(Protocol):
    """A source of action chunks: learned, recorded or scripted. Wrappers around policies are policies too.

    Attributes:
        spec: Layout of the raw actions behind the chunks.
        sees_robot: Whether `infer` uses the robot's state. If so, chunks are anchored at the pelvis measured in the
            observation; if not, at the nominal stance, once an episode.

    One that also has ``sees_objects = True`` is told where the scene's things are, in `Observation.objects`; one that
    has ``arranged`` says by it where they are at first, given their usual poses (k, 7).
    """

    spec: ActionSpec
    sees_robot: bool

    def reset(self, task: str = "") -> None:
        """Begin an episode: forget everything, number chunks from 0."""
        ...

    def infer(self, observation: Observation) -> ActionChunk:
        """Chunk that answers an observation.

        Raises:
            PolicyError: If the observation, or what the policy made of it, cannot be used.
        """
        ...
