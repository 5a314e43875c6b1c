"""Observations, chunks and prefixes as plain maps, exact to the last bit: what our own server and client exchange.

Our server speaks openpi's protocol with these maps as its contents:

========  ==========================================================================================================
frame     content
========  ==========================================================================================================
metadata  ``protocol``: `PROTOCOL`; ``action_spec``: the layout with its hash; ``sees_robot``; ``takes_prefix``;
          ``name``; ``duration`` [s] or None
request   the entries of an observation (`OBSERVATION`), ``images``: camera -> uint8 (height, width, 3), ``prompt``;
          or what openpi's clients send (`policy.remote.openpi_request`), which the metadata's ``request`` lists
answer    ``actions``: (H, A) in the layout, seen from that observation's pelvis; ``server_timing``: ``infer_ms``
========  ==========================================================================================================

A request with ``session`` (a name of the client's episode: another one resets the policy), ``continues`` (whether that
session has had a chunk already) and, where the policy takes it, ``prefix``, is one of our own client's; its answer has
``chunk``, the decoded chunk itself, in place of ``actions``.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from models.spec import RobotSpec
from policy.chunk import ActionChunk
from policy.errors import did_you_mean, printable
from policy.observation import Observation
from policy.prefix import Prefix
from policy.reading import HORIZON_MAX
from policy.remote.channel import RemoteAnswerError
from policy.remote.msgpack_numpy import WireError

PROTOCOL = "g1-wholebody/1"
"""What our server says in its metadata."""
OBSERVATION = ("time", "q_body", "q_lhand", "q_rhand", "T_world_base", "images", "prompt")
"""Keys of an observation."""
OWN_KEY = "q_body"
"""Entry that only an observation of ours has: openpi's clients send a state in a layout."""
CAMERAS_MAX = 16
"""Most images of an observation."""
PROMPT_MAX = 4000
"""Most characters of a task."""
NOTES_MAX, NOTE_MAX = 16, 300
"""Notes of a chunk that are kept, and characters of each."""
_CHUNK = tuple(field.name for field in dataclasses.fields(ActionChunk))
_CHUNK_PLAIN = {"spec_id": str, "seq": int, "t_obs": float, "fps": float}
_CHUNK_OPTIONAL = tuple(field.name for field in dataclasses.fields(ActionChunk) if field.default is None)
_CHUNK_OTHER = ("hands_in", "notes")
_PREFIX = {"steps": int, "inference_delay": int, "execution_horizon": int}


def observation_to_map(observation: Observation, task: str) -> dict[str, Any]:
    """Entries of a request."""
    arrays = {name: np.asarray(getattr(observation, name)) for name in OBSERVATION[1:5]}
    return {"time": float(observation.time), **arrays, "images": dict(observation.images), "prompt": task}


def observation_from_map(data: Mapping[str, Any], robot: RobotSpec | None = None) -> Observation:
    """Observation of a request, checked to be of a robot, the G1 with Dex3 hands if not given.

    Raises:
        WireError: If an entry is missing, unknown, or of the wrong type.
        ObservationError: If its shape or content is wrong.
    """
    _check_keys("the request", data, OBSERVATION, optional=("images", "prompt"))
    arrays = {name: _array("the request", data, name) for name in OBSERVATION[1:5]}
    images = data.get("images", {})
    if not isinstance(images, dict) or not all(isinstance(name, str) for name in images):
        raise WireError("'images' of the request is no map of cameras; camera -> image is expected")
    if len(images) > CAMERAS_MAX:
        raise WireError(f"'images' of the request has {len(images)} cameras; at most {CAMERAS_MAX} are taken")
    images = {name: _array("images", images, name, numbers=False) for name in images}
    task = _plain("the request", data, "prompt", str) if "prompt" in data else ""
    if len(task) > PROMPT_MAX:
        raise WireError(f"'prompt' of the request has {len(task)} characters; at most {PROMPT_MAX} are taken")
    observation = Observation(_plain("the request", data, "time", float), **arrays, images=images, task=task)
    observation.validate(robot)
    return observation


def chunk_to_map(chunk: ActionChunk) -> dict[str, Any]:
    """Entries of a chunk; optional parts only where they are there."""
    plain = {name: kind(getattr(chunk, name)) for name, kind in _CHUNK_PLAIN.items()}
    where = {} if chunk.hands_in == "world" else {"hands_in": chunk.hands_in}
    return {**plain, **chunk.arrays(), **where, "notes": list(chunk.notes)}


def chunk_from_map(data: Any, robot: RobotSpec | None = None) -> ActionChunk:
    """Chunk of an answer, checked to be of a robot, the G1 with Dex3 hands if not given.

    Raises:
        WireError: If an entry is missing, unknown, or of the wrong type.
        ChunkError: If its shape or content is wrong.
    """
    if not isinstance(data, dict):
        raise WireError(f"the chunk is {type(data).__name__}; a map is expected")
    _check_keys("the chunk", data, _CHUNK, optional=(*_CHUNK_OPTIONAL, *_CHUNK_OTHER))
    plain = {name: _plain("the chunk", data, name, kind) for name, kind in _CHUNK_PLAIN.items()}
    arrays = {name: _array("the chunk", data, name) for name in data if name not in (*_CHUNK_PLAIN, *_CHUNK_OTHER)}
    where = {"hands_in": _plain("the chunk", data, "hands_in", str)} if "hands_in" in data else {}
    notes = data.get("notes", [])
    if not isinstance(notes, list) or not all(isinstance(note, str) for note in notes):
        raise WireError("'notes' of the chunk are no list of sentences")
    steps = max((len(array) if array.ndim else 0 for array in arrays.values()), default=0)
    if steps > HORIZON_MAX:
        raise WireError(f"the chunk has {steps} steps; at most {HORIZON_MAX} are taken")
    # Notes go into reports.
    notes = tuple(printable(note, NOTE_MAX) for note in notes[:NOTES_MAX])
    chunk = ActionChunk(**plain, **arrays, **where, notes=notes)
    chunk.validate(robot=robot)
    return chunk


def prefix_to_map(prefix: Prefix) -> dict[str, Any]:
    """Entries of a prefix."""
    return {"executed": chunk_to_map(prefix.executed), **{name: int(getattr(prefix, name)) for name in _PREFIX}}


def prefix_from_map(data: Any, robot: RobotSpec | None = None) -> Prefix:
    """Prefix of a request, checked to be of a robot, the G1 with Dex3 hands if not given.

    Raises:
        WireError: If an entry is missing, unknown, or of the wrong type.
        ChunkError: If its chunk is wrong.
    """
    if not isinstance(data, dict):
        raise WireError(f"the prefix is {type(data).__name__}; a map is expected")
    _check_keys("the prefix", data, ("executed", *_PREFIX))
    counts = {name: _plain("the prefix", data, name, int) for name in _PREFIX}
    return Prefix(chunk_from_map(data["executed"], robot), **counts)


class OwnDialect:
    """Talks to our own server; its chunks are of a robot, the G1 with Dex3 hands if not given."""

    def __init__(self, robot: RobotSpec | None = None) -> None:
        self.session, self.continues, self._robot = "", False, robot

    def request(self, observation: Observation, task: str, prefix: Prefix | None) -> dict[str, Any]:
        """What is sent for an observation."""
        request = observation_to_map(observation, task) | {"session": self.session, "continues": self.continues}
        return request if prefix is None else request | {"prefix": prefix_to_map(prefix)}

    def chunk(self, answer: Mapping[str, Any], observation: Observation, seq: int) -> ActionChunk:
        """Chunk of an answer.

        Raises:
            RemoteAnswerError: If there is none in it.
            ChunkError: If it is wrong.
        """
        try:
            chunk = chunk_from_map(answer.get("chunk"), self._robot)
        except WireError as error:
            raise RemoteAnswerError(str(error)) from error
        # A server that was started anew counts from 0 again.
        return dataclasses.replace(chunk, seq=seq)


def _check_keys(what: str, data: Mapping[str, Any], known: Iterable[str], optional: Iterable[str] = ()) -> None:
    for key in data:
        if key not in known:
            raise WireError(f"{what} has an entry '{key!s:.60}'; {did_you_mean(key, known)}known: {', '.join(known)}")
    missing = [name for name in known if name not in data and name not in optional]
    if missing:
        raise WireError(f"{what} lacks {', '.join(missing)}")


def _plain(what: str, data: Mapping[str, Any], key: str, kind: type) -> Any:
    value = data[key]
    accepted = (int, float) if kind is float else kind
    if not isinstance(value, accepted) or isinstance(value, bool):
        raise WireError(f"'{key}' of {what} is {type(value).__name__}; {kind.__name__} is expected")
    try:
        return kind(value)
    except OverflowError as error:
        raise WireError(f"'{key}' of {what} is beyond what a double holds") from error


def _array(what: str, data: Mapping[str, Any], key: str, *, numbers: bool = True) -> np.ndarray:
    """A writable copy: torch warns of arrays that are not."""
    value = data[key]
    if not isinstance(value, np.ndarray) or (numbers and value.dtype.kind != "f"):
        found = value.dtype if isinstance(value, np.ndarray) else type(value).__name__
        raise WireError(
            f"'{key}' of {what} is {found}; an array of {'floating point' if numbers else 'uint8'} is needed"
        )
    return value.copy()
