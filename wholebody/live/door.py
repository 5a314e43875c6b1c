"""Who may come to the page, and which of their messages reach it.

Any web site that a person visits can send to this computer: so whoever comes must know a token of the page's address,
call this computer by a name that is its own (a foreign name can be made to point here), and come from the page itself.
What they send is screened before viser sees it, which believes it: only what the page's own controls send passes.
"""

from __future__ import annotations

import logging
import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from http import HTTPStatus
from ipaddress import ip_address
from math import hypot, isfinite
from secrets import compare_digest, token_urlsafe
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from policy.errors import printable
from policy.sparing_log import SparingLog

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

logger = logging.getLogger(__name__)

TOKEN_BYTES = 16
"""Random bytes of the token [no unit]; chosen: 128 bits, as for session identifiers."""
MESSAGE_MAX = 64 * 1024
"""Largest message that is taken [bytes]; chosen: a hundred times what a control sends."""
DISTANCE_MAX = 100.0
"""Largest distance that a handle or a camera may have [m]; chosen: past everything that is drawn."""
LOOPBACK = ("127.0.0.1", "localhost", "::1")
ANYWHERE = ("", "0.0.0.0", "::")

Check = Callable[[Any], bool]
"""Whether a value is one that a control of the page sends."""


class Door:
    """Guards a page.

    Args:
        host: Address that the page is served at.

    Attributes:
        token: Part of the page's address.
        values: What each control may send, by its number; whoever makes a control enters it.
        handles: Names of what can be dragged.
        visitors: How many pages are open.
    """

    def __init__(self, host: str) -> None:
        self.token, self.values, self.handles, self.visitors = token_urlsafe(TOKEN_BYTES), {}, set(), 0
        names = {*LOOPBACK, host.lower()}
        with suppress(OSError):
            names |= {socket.gethostname().lower(), socket.getfqdn().lower()} if host in ANYWHERE else set()
        self._names, self._anywhere, self._log = names, host in ANYWHERE, SparingLog(logger)

    def refuse(self, path: str, headers: Mapping[str, str]) -> str | None:
        """Why a request is not answered, or None."""
        hosts, origins = ([value for key, value in headers.raw_items() if key.lower() == one] for one in HEADERS)
        if len(hosts) != 1 or not self._is_ours(hosts[0]):
            return "this is not the name of the computer that the page is on"
        if origins and origins != [f"http://{hosts[0]}"]:
            return "another web site asks"
        asked = path.partition("?")[0].split("/")
        if len(asked) < 2 or not compare_digest(asked[1].encode(errors="replace"), self.token.encode()):
            return "open the address that `wholebody live` printed: it has a token"
        return None

    def _is_ours(self, host: str) -> bool:
        with suppress(ValueError):
            name = (urlsplit(f"//{host}").hostname or "").lower()
            return name in self._names or (self._anywhere and _is_address(name))
        return False

    def passes(self, message: bytes | str) -> bool:
        """Whether a message is one that the page's own controls send."""
        import msgspec

        if not isinstance(message, bytes):
            return False
        try:
            fields = msgspec.msgpack.decode(message)
        except (msgspec.DecodeError, ValueError, RecursionError):
            return False
        kind = fields.pop("type", None) if isinstance(fields, dict) else None
        if not isinstance(kind, str) or kind not in _KINDS:
            return False
        fields.setdefault("owner", "")
        wanted = {"owner": _is_nobody} | _KINDS[kind](self)
        return fields.keys() == wanted.keys() and all(check(fields[name]) for name, check in wanted.items())

    def say(self, what: str, *about: object) -> None:
        """Warn, sparingly."""
        self._log.warning(what, *(printable(one, 200) for one in about))

    @contextmanager
    def guarding(self) -> Iterator[None]:
        """What viser serves meanwhile is guarded; it has no hook of its own for that."""
        from websockets.asyncio import server

        plain, quiet = server.serve, logging.getLogger("wholebody.live.websockets")
        quiet.setLevel(logging.CRITICAL)  # what strangers do wrong is said here, without a traceback

        def serve(handler: Callable, host: str, port: int, *, process_request: Callable, **options: Any) -> object:
            def ask(connection: ServerConnection, request: Request) -> Response | None:
                if (why := self.refuse(request.path, request.headers)) is not None:
                    self.say("refused a request to the page: %s", why)
                    return connection.respond(HTTPStatus.FORBIDDEN, f"{why}\n")
                request.path = request.path.replace(f"/{self.token}", "", 1) or "/"
                return process_request(connection, request)

            async def screened(connection: ServerConnection) -> None:
                self.visitors += 1  # in the server's thread alone
                try:
                    await handler(_Screened(connection, self))
                finally:
                    self.visitors -= 1

            options |= {"process_request": ask, "max_size": MESSAGE_MAX, "logger": quiet}
            return plain(screened, host, port, **options)

        server.serve = serve
        try:
            yield
        finally:
            server.serve = plain


class _Screened:
    """A connection from which only what `Door.passes` is received."""

    def __init__(self, connection: ServerConnection, door: Door) -> None:
        self._connection, self._door = connection, door

    def __getattr__(self, name: str) -> object:
        return getattr(self._connection, name)

    async def recv(self) -> bytes:
        """The next message that passes."""
        while True:
            message = await self._connection.recv()
            if self._door.passes(message):
                return message
            self._door.say("left out a message of %s bytes to the page, which none of its controls sends", len(message))


HEADERS = ("host", "origin")
"""Headers that say who asks, and whom."""


def between(low: float, high: float) -> Check:
    """Whether a value is a number of a slider."""
    return lambda value: _is_number(value) and low <= value <= high


def one_of(*options: object) -> Check:
    """Whether a value is one of some."""
    return lambda value: type(value) in {type(one) for one in options} and value in options


def _is_number(value: object, most: float = float("inf")) -> bool:
    return type(value) in (int, float) and isfinite(value) and abs(value) <= most


def _is_nobody(value: object) -> bool:
    return value == ""


def _point(value: object) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(_is_number(one, DISTANCE_MAX) for one in value)


def _rotation(value: object) -> bool:
    numbers = isinstance(value, list) and len(value) == 4 and all(_is_number(one, 1.1) for one in value)
    return numbers and 0.9 < hypot(*value) < 1.1


def _is_address(name: str) -> bool:
    try:
        ip_address(name)
    except ValueError:
        return False
    return True


def _updates(door: Door) -> dict[str, Check]:
    """A control's new value: which it may be depends on the control, so the two are looked at together."""
    known, chosen = door.values, []

    def control(uuid: object) -> bool:
        chosen[:] = [known[uuid]] if isinstance(uuid, str) and uuid in known else []
        return bool(chosen)

    def value(updates: object) -> bool:
        return (
            isinstance(updates, dict) and updates.keys() == {"value"} and bool(chosen) and chosen[0](updates["value"])
        )

    return {"uuid": control, "updates": value}


def _camera(_: Door) -> dict[str, Check]:
    numbers = dict.fromkeys(("fov", "near", "far", "image_height", "image_width"), _is_number)
    return {"wxyz": _rotation} | dict.fromkeys(("position", "look_at", "up_direction"), _point) | numbers


def _drag(door: Door) -> dict[str, Check]:
    return {"name": one_of(*door.handles)}


_KINDS: dict[str, Callable[[Door], dict[str, Check]]] = {
    "GuiUpdateMessage": _updates,
    "ViewerCameraMessage": _camera,
    "TransformControlsDragStartMessage": _drag,
    "TransformControlsDragEndMessage": _drag,
    "TransformControlsUpdateMessage": lambda door: _drag(door) | {"wxyz": _rotation, "position": _point},
}
"""What the page's controls send, and how each field is checked; a tunnel to the outside is nothing of theirs."""
