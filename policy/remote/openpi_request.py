"""What openpi's client sends to our server, as an observation; the other side of `policy.remote.openpi`."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from itertools import islice
from typing import Any

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.spec import ActionSpec
from policy.action_spec.state import observation_of, state_layout
from policy.base import Policy
from policy.errors import ObservationError, did_you_mean
from policy.observation import Observation
from policy.remote.msgpack_numpy import WireError
from policy.remote.openpi import Key, KeyMap
from policy.remote.wire import PROMPT_MAX

ABSENT = object()
NAMED_MAX = 16
"""Entries of a request that a sentence names."""


class OpenpiRequests:
    """Reads requests by a policy's cameras and state.

    A policy that does not see the robot needs no state. Cameras that the key map does not name go by their own names,
    as ``observation/NAME``. Entries that no policy reads are left alone, as openpi leaves them.

    Args:
        policy: Who is asked.
        keys: Where the inputs are.

    Attributes:
        state: Layout of the state, None if none is read.
        keys: Where the inputs are, for exactly the policy's cameras.
    """

    def __init__(self, policy: Policy, keys: KeyMap) -> None:
        self.state = _state_of(policy)
        self.sizes: Mapping[str, tuple[int, int]] = getattr(policy, "cameras", {})
        images = {camera: keys.images.get(camera, f"observation/{camera}") for camera in self.sizes}
        self.keys = dataclasses.replace(keys, images=images)

    def describe(self) -> dict[str, Any]:
        """Every entry that is read: what it is, its type and shape, by its key; as the metadata say it."""
        axes, names = "(height, width, 3)" if self._hwc else "(3, height, width)", {}
        if self.state is not None:
            names[_text(self.keys.state)] = f"state in the layout {self.state.name}: numbers, ({self.state.dim},)"
        for camera, key in self.keys.images.items():
            height, width = self.sizes[camera]
            names[_text(key)] = f"camera {camera}: uint8, {axes}; {height} x {width} in training"
        if self.keys.prompt is not None:
            names[_text(self.keys.prompt)] = "task in words: text"
        return names

    def observation(self, request: Mapping[str, Any], time: float) -> Observation:
        """Observation of a request, checked.

        Args:
            request: Content of a frame.
            time: When it came [s].

        Raises:
            WireError: If an entry is missing, or of the wrong type.
            ObservationError: If its shape or content is wrong.
        """
        if self.state is None:
            observation = Anchor.nominal().observation(time)
        else:
            observation = observation_of(self.state, self._numbers(request), time)
        images = {camera: self._image(request, key) for camera, key in self.keys.images.items()}
        observation = dataclasses.replace(observation, images=images, task=self._prompt(request))
        observation.validate()
        return observation

    @property
    def _hwc(self) -> bool:
        return self.keys.image_axes == "hwc"

    def _prompt(self, request: Mapping[str, Any]) -> str:
        key = self.keys.prompt
        prompt = "" if key is None else _get(request, key)
        if prompt is ABSENT:
            return ""
        if not isinstance(prompt, str) or len(prompt) > PROMPT_MAX:
            found = f"{len(prompt)} characters" if isinstance(prompt, str) else type(prompt).__name__
            raise WireError(f"'{_text(key)}' of the request is {found}; text of at most {PROMPT_MAX} is expected")
        return str(prompt)

    def _numbers(self, request: Mapping[str, Any]) -> np.ndarray:
        value = self._array(request, self.keys.state)
        if value.dtype.kind not in "fiu" or value.shape != (self.state.dim,):
            raise ObservationError(
                f"'{_text(self.keys.state)}' is {value.dtype} of shape {value.shape}; the {self.state.dim} numbers of "
                f"'{self.state.name}' are expected (wholebody layouts {self.state.name})"
            )
        return value.astype(float)

    def _image(self, request: Mapping[str, Any], key: Key) -> np.ndarray:
        """A writable copy, (height, width, 3): torch warns of arrays that are not."""
        image = self._array(request, key)
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2 if self._hwc else 0] != 3:
            axes = "(height, width, 3)" if self._hwc else "(3, height, width)"
            raise ObservationError(f"'{_text(key)}' is {image.dtype} of shape {image.shape}; uint8 {axes} is expected")
        return np.array(image if self._hwc else image.transpose(1, 2, 0), order="C")

    def _array(self, request: Mapping[str, Any], key: Key) -> np.ndarray:
        value = _get(request, key)
        if value is ABSENT:
            names = [f"{name!s:.60}" for name in islice(request, NAMED_MAX)]
            has, near = ", ".join(names) or "nothing", did_you_mean(_text(key), names)
            raise WireError(
                f"the request lacks '{_text(key)}'; {near}it has {has}. This server reads "
                f"{', '.join(self.describe())}; other keys are named with --rename-map"
            )
        if not isinstance(value, np.ndarray):
            raise WireError(f"'{_text(key)}' of the request is {type(value).__name__}; an array is expected")
        return value


def _state_of(policy: Policy) -> ActionSpec | None:
    """Layout of the state that a policy reads; that of its actions where it does not say."""
    if not policy.sees_robot:
        return None
    return getattr(policy, "state_spec", state_layout(policy.spec))


def _get(request: Mapping[str, Any], key: Key) -> Any:
    found: Any = request
    for name in (key,) if isinstance(key, str) else key:
        found = found.get(name, ABSENT) if isinstance(found, Mapping) else ABSENT
    return found


def _text(key: Key) -> str:
    return key if isinstance(key, str) else " > ".join(key)
