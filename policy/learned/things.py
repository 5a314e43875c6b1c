"""What a policy is told of a thing of the scene: where it is in the stance, and the way to it from each palm."""

from __future__ import annotations

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.errors import ObservationError
from policy.geometry.se3 import inverse
from policy.observation import Observation


def thing_in_stance(observation: Observation, anchor: Anchor) -> np.ndarray:
    """Place of the scene's first thing in the stance frame of an observation's anchor, shape (3,), [m].

    Raises:
        ObservationError: If nobody tells where things are, or there are none.
    """
    if observation.objects is None:
        raise ObservationError(
            "the policy needs to know where things are (`Observation.objects`), which nobody tells it here: `wholebody "
            "run` and `check` do, plans alone, `live` and servers do not"
        )
    if not len(observation.objects):
        raise ObservationError("the policy needs a thing to see, and there is none in this scene")
    T = inverse(anchor.T_world_stance)
    return T[:3, :3] @ observation.objects[0, :3] + T[:3, 3]


def shown_of(thing: np.ndarray, palms: np.ndarray) -> np.ndarray:
    """Numbers of a thing (3,) for palms (2, 3): its place, the way from the left and from the right palm, (9,) [m]."""
    return np.concatenate([thing, (thing - palms).ravel()])
