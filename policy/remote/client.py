"""A policy that runs on another computer: this one needs no torch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any
from uuid import uuid4

from models.spec import RobotSpec
from policy.action_spec.builtin import as_spec
from policy.action_spec.spec import ActionSpec, require_same
from policy.action_spec.state import state_layout
from policy.chunk import ActionChunk
from policy.clock import EpisodeClock
from policy.errors import SpecError, printable
from policy.findings import Finding
from policy.observation import Observation
from policy.placeholder_cameras import blind, with_grey
from policy.prefix import Prefix
from policy.remote.channel import FRAME_MAX, Channel, RemoteAnswerError
from policy.remote.openpi import LIBERO, KeyMap, OpenpiDialect
from policy.remote.wire import CAMERAS_MAX, PROTOCOL, OwnDialect

TIMEOUT_MAX = 86400.0
"""Longest wait that can be asked for [s]: a day."""
SIDE_MAX = 8192
"""Largest side of a camera image that a server may ask for [px]."""
SAME = ("protocol", "action_spec", "sees_robot", "takes_prefix", "name")
"""What a server must say again after a break."""


@dataclass(frozen=True, kw_only=True)
class RemoteOptions:
    """How to talk to a policy server.

    Attributes:
        assume_spec: Layout that the user vouches for, built-in name or spec, whatever the server says.
        assume_state: Layout of the state that an openpi server is sent; that of the actions, absolute, if None.
        keys: Names of inputs and outputs on an openpi server; those of its LIBERO example if not given.
        connect_timeout: For connection, handshake and metadata together [s].
        timeout: For an answer [s].
        first_timeout: For the first answer of a connection [s]: openpi's server compiles its network then.
        api_key: For servers that want one.
        placeholder_cameras: Show grey to cameras that an observation lacks; for simulations without pictures.
        task: Task where neither `reset` nor the observation has one.
    """

    assume_spec: ActionSpec | str | None = None
    assume_state: ActionSpec | str | None = None
    keys: KeyMap = LIBERO
    connect_timeout: float = 10.0
    timeout: float = 5.0
    first_timeout: float = 120.0
    api_key: str | None = None
    placeholder_cameras: bool = False
    task: str = ""

    def __post_init__(self) -> None:
        for name in ("connect_timeout", "timeout", "first_timeout"):
            seconds = getattr(self, name)
            if not 0.0 < seconds < TIMEOUT_MAX:
                raise ValueError(f"{name} is {seconds} s; more than 0 is expected, and less than {TIMEOUT_MAX:g}")


class RemotePolicy:
    """Client of openpi's policy server, or of ours (`policy.remote.server`); `connect` makes one.

    A request that fails, for whatever reason, raises and closes the connection; the next one connects again. So an
    `Executor` with this policy reports the failure, the robot holds, and goes on when the server is back.

    Args:
        channel: Open connection.
        spec: Layout of the actions.
        dialect: Contents of the frames.
        metadata: What the server said of itself.
        options: How to talk to it.

    Attributes:
        spec: Layout of the actions.
        sees_robot: Whether the policy behind the server uses the robot's state.
        metadata: What the server said of itself.
        duration: How long the policy goes on [s], None if it has no end.
        cameras: Height and width of the cameras that it wants [px]; of an openpi server, those of the key map.
        timing: Of the last answer: ``round_trip_ms``, and ``infer_ms`` where the server says it.
    """

    def __init__(
        self,
        channel: Channel,
        spec: ActionSpec,
        dialect: OwnDialect | OpenpiDialect,
        metadata: Mapping[str, Any],
        options: RemoteOptions,
    ) -> None:
        self.spec, self.metadata, self.options = spec, metadata, options
        self.timing: dict[str, Any] = {}
        self.sees_robot = bool(metadata.get("sees_robot", True))
        self.duration = _seconds(metadata.get("duration"))
        self.cameras = dialect.cameras if isinstance(dialect, OpenpiDialect) else _cameras(metadata)
        self._channel, self._dialect = channel, dialect
        self._fresh = True
        self._clock = EpisodeClock()
        self.reset()

    @classmethod
    def connect(
        cls, uri: str, *, spec: ActionSpec | str | None = None, robot: RobotSpec | None = None, **settings: Any
    ) -> RemotePolicy:
        """Connect to a server and agree on the layout.

        openpi's server says no layout unless its metadata has one (``policy_metadata={"action_spec": {...}}`` in the
        training configuration, with the content of `ActionSpec.to_json`); else the caller has to vouch for it.

        Args:
            uri: ``ws://host:port``; the port is 8000 if none is given.
            spec: Layout that the caller decodes, built-in name or spec; what the server says if None.
            robot: The robot that it is for; the G1 with Dex3 hands if None.
            **settings: As in `RemoteOptions`, for example ``assume_spec``, ``keys``, ``timeout``.

        Raises:
            RemoteError: If there is no policy server.
            SpecError: If the layouts differ, or nothing says what the server's is.
            TypeError: If there is no such setting.
            ValueError: If a time-out is none.
        """
        options = RemoteOptions(**settings)
        channel = Channel(uri, connect_timeout=options.connect_timeout, api_key=options.api_key)
        try:
            metadata = channel.open(patient=True)
            layout = _agree(metadata, as_spec(spec, robot), as_spec(options.assume_spec, robot), robot)
            if metadata.get("protocol") != PROTOCOL:
                state = as_spec(options.assume_state, robot) or state_layout(layout)
                return cls(channel, layout, OpenpiDialect(layout, state, options.keys), metadata, options)
            kind = RemotePrefixPolicy if metadata.get("takes_prefix") is True else cls
            return kind(channel, layout, OwnDialect(layout.robot), metadata, options)
        except BaseException:
            channel.close()
            raise

    def reset(self, task: str = "") -> None:
        """Begin an episode; the server learns of it with the next observation."""
        self._task = task
        self._clock.reset()
        if isinstance(self._dialect, OwnDialect):
            self._dialect.session, self._dialect.continues = uuid4().hex, False

    def infer(self, observation: Observation) -> ActionChunk:
        """Chunk that the server answers with.

        Raises:
            ObservationError: If the observation is malformed, or lacks a camera.
            RemoteError: If there is no answer, or the policy failed there.
            ChunkError: If the answer is no chunk of the layout.
        """
        return self._ask(observation, None)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """What should be known before running it."""
        return (blind(self.cameras),) if self.options.placeholder_cameras and self.cameras else ()

    def close(self) -> None:
        """Hang up."""
        self._channel.close()

    def _ask(self, observation: Observation, prefix: Prefix | None) -> ActionChunk:
        if self.options.placeholder_cameras:
            observation = with_grey(observation, self.cameras)
        observation.validate(self.spec.robot)
        seq, _ = self._clock.tick(observation.time)
        request = self._dialect.request(observation, observation.task or self._task or self.options.task, prefix)
        if not self._channel.is_open:
            self._reconnect()
        begin = perf_counter()
        answer = self._channel.ask(request, self.options.first_timeout if self._fresh else self.options.timeout)
        self._fresh = False
        chunk = self._dialect.chunk(answer, observation, seq)
        self.timing = {"round_trip_ms": 1e3 * (perf_counter() - begin)} | _server_timing(answer)
        if chunk.spec_id != self.spec.id:
            raise RemoteAnswerError(f"the chunk has the layout '{chunk.spec_id}'; '{self.spec.id}' was agreed on")
        if isinstance(self._dialect, OwnDialect):
            self._dialect.continues = True
        return chunk

    def _reconnect(self) -> None:
        """Connect again, to a server that says the same of itself.

        Raises:
            RemoteError: If no server is there, or another.
        """
        metadata = self._channel.open()
        if any(metadata.get(key) != self.metadata.get(key) for key in SAME):
            self._channel.close()
            raise RemoteAnswerError("another policy answers there now; make a new client", uri=self._channel.uri)
        self._fresh = True


class RemotePrefixPolicy(RemotePolicy):
    """Client of a server whose policy continues what is being executed (`policy.prefix.PrefixPolicy`)."""

    def infer_after(self, observation: Observation, prefix: Prefix) -> ActionChunk:
        """Chunk that the server answers with, in agreement with a prefix.

        Raises:
            PolicyError: As `infer`.
        """
        return self._ask(observation, prefix)


def _agree(
    metadata: Mapping[str, Any], spec: ActionSpec | None, assumed: ActionSpec | None, robot: RobotSpec | None
) -> ActionSpec:
    """Layout of a server's actions."""
    stated = metadata.get("action_spec") if assumed is None else assumed
    if isinstance(stated, str):
        stated = ActionSpec.from_json(stated, robot)
    elif isinstance(stated, dict):
        stated = ActionSpec.from_dict(stated, robot)
    known = stated if isinstance(stated, ActionSpec) else None
    if spec is not None:
        require_same(spec, known)
    if known is None:
        raise SpecError(
            "the server does not say what its actions are; put 'action_spec' into its metadata, or vouch for a layout "
            "with assume_spec (--assume-spec wbc32)"
        )
    return known


def _cameras(metadata: Mapping[str, Any]) -> dict[str, tuple[int, int]]:
    """Sizes that a server states; one that is no size is left out, since nothing but grey images depends on it."""
    stated = metadata.get("cameras")
    sizes = {printable(name, 80): size for name, size in stated.items()} if isinstance(stated, Mapping) else {}
    sizes = {name: tuple(size) for name, size in list(sizes.items())[:CAMERAS_MAX] if _is_size(size)}
    # Grey images of them must go into a frame.
    return sizes if 3 * sum(height * width for height, width in sizes.values()) < FRAME_MAX else {}


def _seconds(stated: Any) -> float | None:
    """How long a server says that its policy goes on [s]; None for what is no such time."""
    plain = isinstance(stated, int | float) and not isinstance(stated, bool)
    return float(stated) if plain and 0.0 <= stated <= TIMEOUT_MAX else None


def _is_size(size: Any) -> bool:
    return isinstance(size, list) and len(size) == 2 and all(type(n) is int and 0 < n <= SIDE_MAX for n in size)


def _server_timing(answer: Mapping[str, Any]) -> dict[str, float]:
    timing = answer.get("server_timing")
    infer = timing.get("infer_ms") if isinstance(timing, dict) else None
    return {"infer_ms": float(infer)} if isinstance(infer, int | float) and 0.0 <= infer <= 1e3 * TIMEOUT_MAX else {}
