"""Grey pictures for the cameras of a policy, where a simulation takes none."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping

import numpy as np

from policy.findings import Finding
from policy.observation import Observation

GREY = 128
"""Level of a grey image."""


def grey_images(sizes: Mapping[str, tuple[int, int]]) -> dict[str, np.ndarray]:
    """A grey image for every camera.

    Args:
        sizes: Height and width by camera [px].
    """
    return {name: np.full((height, width, 3), GREY, dtype=np.uint8) for name, (height, width) in sizes.items()}


def with_grey(observation: Observation, sizes: Mapping[str, tuple[int, int]]) -> Observation:
    """The observation, with grey images for the cameras that it lacks."""
    return dataclasses.replace(observation, images={**grey_images(sizes), **observation.images})


def blind(cameras: Iterable[str]) -> Finding:
    """The warning that goes with it."""
    text = f"where the robot has no pictures, {', '.join(cameras)} see grey: the policy acts blindly"
    return Finding("cameras", "warning", text)
