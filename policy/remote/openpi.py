"""What openpi's server is asked and answers: a flat or nested map of numbers, images and a prompt; raw actions back.

Every openpi policy names its inputs its own way, in the ``repack`` and ``data`` transforms of its training
configuration, and its server says nothing of them. openpi tells its users to begin with those of its LIBERO example,
which are what is meant here (`LIBERO`) unless a `KeyMap` says otherwise.

Source:
    openpi ``src/openpi/policies/libero_policy.py``, ``examples/libero/main.py``, ``examples/simple_client/main.py``.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.codec import decode
from policy.action_spec.spec import ActionSpec
from policy.action_spec.state import state_numbers
from policy.chunk import ActionChunk
from policy.errors import ObservationError, SpecError, did_you_mean, printable
from policy.observation import Observation
from policy.prefix import Prefix
from policy.reading import HORIZON_MAX
from policy.remote.channel import RemoteAnswerError

Key = str | tuple[str, ...]
"""Name of an entry, or the path to it through nested maps: ``("images", "cam_high")``."""
SIDE = 224
"""Side of the square images that openpi's clients send, and its networks see [px]."""


@dataclass(frozen=True, kw_only=True)
class KeyMap:
    """Where a policy of an openpi server finds its inputs.

    Attributes:
        state: Key of the state, sent as float32 of shape (n,).
        images: Camera of the observation -> key of the image, sent as uint8. Other cameras are not sent.
        prompt: Key of the task in words; None where the server has its own (``--default-prompt``).
        actions: Key of the actions in the answer.
        image_axes: ``hwc`` (most policies) or ``chw`` (openpi's ALOHA).
    """

    state: Key = "observation/state"
    images: Mapping[str, Key] = field(default_factory=lambda: MappingProxyType({}))
    prompt: Key | None = "prompt"
    actions: str = "actions"
    image_axes: Literal["hwc", "chw"] = "hwc"

    def __post_init__(self) -> None:
        if self.image_axes not in ("hwc", "chw"):
            raise SpecError(f"image_axes is {self.image_axes!r}; 'hwc' or 'chw' is expected")
        paths = [_path(key) for key in (self.state, self.prompt, *self.images.values()) if key is not None]
        for i, path in enumerate(paths):
            for other in paths[:i]:
                if path[: len(other)] == other or other[: len(path)] == path:
                    raise SpecError(f"the keys {other} and {path} of a key map take each other's place")

    @classmethod
    def named(cls, text: str) -> KeyMap:
        """Key map of a command line: ``libero``, ``aloha``, or a JSON object of what differs from LIBERO.

        The object maps our names, ``state``, ``prompt``, ``actions``, or a camera, to keys: text, a list of texts (a
        path through nested maps), or null for what is not sent.

        Raises:
            SpecError: If it is none of these.
        """
        if text in PRESETS or not text:
            return PRESETS[text or "libero"]
        try:
            given = json.loads(text)
        except (json.JSONDecodeError, RecursionError) as error:
            names = ", ".join(PRESETS)
            raise SpecError(
                f"'{text:.80}' is no map of keys: {names}, or JSON such as {_EXAMPLE} are expected"
            ) from error
        if not isinstance(given, dict):
            raise SpecError(
                f"the map of keys is a JSON {type(given).__name__}; an object such as {_EXAMPLE} is expected"
            )
        keys = {name: _key(name, key) for name, key in given.items()}
        fixed = {name: keys.pop(name) for name in ("state", "prompt", "actions") if name in keys}
        if fixed.get("state", "") is None or not isinstance(fixed.get("actions", ""), str):
            raise SpecError("'state' and 'actions' of a map of keys are needed, and 'actions' is one text")
        left = {camera: key for camera, key in LIBERO.images.items() if key not in keys.values()}
        images = {camera: key for camera, key in {**left, **keys}.items() if key is not None}
        return dataclasses.replace(LIBERO, images=images, **fixed)

    def request(self, state: np.ndarray, images: Mapping[str, np.ndarray], prompt: str) -> dict[str, Any]:
        """Request to the server.

        Raises:
            ObservationError: If a camera is missing.
        """
        request: dict[str, Any] = {}
        _put(request, self.state, np.asarray(state, dtype=np.float32))
        for camera, key in self.images.items():
            if camera not in images:
                has = f"it has {', '.join(images)}" if images else "it has no images"
                raise ObservationError(f"the observation has no image '{camera}'; {did_you_mean(camera, images)}{has}")
            _put(request, key, images[camera] if self.image_axes == "hwc" else images[camera].transpose(2, 0, 1))
        # Where there is none, a server that was started with a default prompt uses that.
        if self.prompt is not None and prompt:
            _put(request, self.prompt, prompt)
        return request


class OpenpiDialect:
    """Talks to openpi's own server.

    Args:
        spec: Layout of the actions after the server's output transforms: un-normalised.
        state: Layout of the state.
        keys: Names of inputs and outputs.

    Attributes:
        cameras: What is sent in place of cameras that are not there: openpi's server says no sizes [px].
    """

    def __init__(self, spec: ActionSpec, state: ActionSpec, keys: KeyMap) -> None:
        self.spec, self.state, self.keys = spec, state, keys
        self.cameras = dict.fromkeys(keys.images, (SIDE, SIDE))

    def request(self, observation: Observation, task: str, prefix: Prefix | None) -> dict[str, Any]:
        """What is sent for an observation; openpi's server takes no prefix."""
        return self.keys.request(state_numbers(self.state, observation), observation.images, task)

    def chunk(self, answer: Mapping[str, Any], observation: Observation, seq: int) -> ActionChunk:
        """Chunk of an answer, anchored at the observation.

        Raises:
            RemoteAnswerError: If there are no actions in it.
            ChunkError: If the actions are not of the layout.
        """
        actions = answer.get(self.keys.actions)
        if not isinstance(actions, np.ndarray) or not actions.ndim:
            found = f"there are: {printable(', '.join(str(key) for key in answer), 200)}"
            if actions is not None:
                found = f"it is {type(actions).__name__}"
            raise RemoteAnswerError(f"the answer has no array '{self.keys.actions}'; {found}")
        if len(actions) > HORIZON_MAX:
            raise RemoteAnswerError(f"the answer has {len(actions)} steps; at most {HORIZON_MAX} are taken")
        return decode(
            self.spec, actions, Anchor.measured(observation, self.spec.robot), seq=seq, t_obs=observation.time
        )


def _path(key: Key) -> tuple[str, ...]:
    return (key,) if isinstance(key, str) else tuple(key)


def _put(into: dict[str, Any], key: Key, value: Any) -> None:
    *outer, last = _path(key)
    for name in outer:
        into = into.setdefault(name, {})
    into[last] = value


def _key(name: str, key: Any) -> Key | None:
    """A key as JSON has it."""
    if key is None or isinstance(key, str):
        return key
    if isinstance(key, list) and key and all(isinstance(part, str) for part in key):
        return tuple(key)
    raise SpecError(f"the key of '{name:.60}' is {key!r:.60}; a text, a list of texts, or null is expected")


_EXAMPLE = '{"head": "observation/front_image", "left_wrist": null}'
LIBERO = KeyMap(images={"head": "observation/image", "left_wrist": "observation/wrist_image"})
"""Keys of openpi's LIBERO example, and of servers that began as a copy of it."""
ALOHA = KeyMap(
    state="state",
    images={
        "head": ("images", "cam_high"),
        "left_wrist": ("images", "cam_left_wrist"),
        "right_wrist": ("images", "cam_right_wrist"),
    },
    image_axes="chw",
)
"""Keys of openpi's ALOHA example."""
PRESETS = {"libero": LIBERO, "aloha": ALOHA}
"""Key maps by name."""
