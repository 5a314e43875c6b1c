"""What is being executed while a policy thinks: the input of real-time chunking."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.codec import encode
from policy.action_spec.spec import ActionSpec
from policy.base import Policy
from policy.chunk import ActionChunk
from policy.observation import Observation


@dataclass(frozen=True)
class Prefix:
    """The motion that the next chunk will find under way.

    LeRobot's words for it, arguments of ``predict_action_chunk``, are ``inference_delay`` and ``execution_horizon`` as
    here, and ``prev_chunk_left_over`` for what `left_over` returns, normalised.

    Attributes:
        executed: What is really commanded from the observation's time on, at the steps of the coming chunk; after the
            end of what is commanded the last pose is held.
        steps: How many of its steps are commanded, not held.
        inference_delay: Steps that will be over when the chunk arrives: the new chunk must repeat them.
        execution_horizon: Step from which on the new chunk is free.
    """

    executed: ActionChunk
    steps: int
    inference_delay: int
    execution_horizon: int

    def left_over(self, spec: ActionSpec, anchor: Anchor) -> np.ndarray:
        """The commanded steps as raw actions of a layout, seen from the new observation, shape (steps, A).

        Raises:
            ChunkError: If a joint layout cannot reach a pose.
        """
        return encode(spec, self.executed, anchor)[: self.steps]


@runtime_checkable
class PrefixPolicy(Policy, Protocol):
    """A policy that continues what is being executed."""

    def infer_after(self, observation: Observation, prefix: Prefix) -> ActionChunk:
        """Chunk that answers an observation and agrees with the prefix.

        Raises:
            PolicyError: If the observation, or what the policy made of it, cannot be used.
        """
        ...
