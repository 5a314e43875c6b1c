"""What can go wrong at the policy boundary, as exceptions that are also ``ValueError``."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

MESSAGE_MAX = 2000
"""Most characters of a message; the middle of a longer one is left out."""


def printable(text: object, most: int = MESSAGE_MAX) -> str:
    r"""Text from outside on one line of at most `most` characters, safe for a terminal.

    What moves a cursor, ends a line or turns the direction of writing is written as an escape, as in ``\x1b``.
    """
    text = str(text)
    if len(text) > most:
        text = f"{text[: 2 * most // 3]} ... {text[len(text) - most // 3 :]}"
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


class PolicyError(Exception):
    """Base of every exception of this package; its message is `printable`."""

    def __init__(self, message: object = "") -> None:
        super().__init__(printable(message))


class RotationError(PolicyError, ValueError):
    """Numbers that are no rotation.

    Attributes:
        index: Which of several, flattened; 0 for a single one.
    """

    def __init__(self, message: str, *, index: int = 0) -> None:
        super().__init__(message)
        self.index = index


class ObservationError(PolicyError, ValueError):
    """An observation with a wrong shape or a value that is not finite."""


class SpecError(PolicyError, ValueError):
    """An action spec that is malformed, or two specs that differ."""


class ChunkError(PolicyError, ValueError):
    """An action chunk, or raw actions, that cannot be executed.

    Attributes:
        step: Offending step, or None where the chunk as a whole is wrong.
        slot: Offending slot or field, or None.
    """

    def __init__(self, message: str, *, step: int | None = None, slot: str | None = None) -> None:
        super().__init__(message)
        self.step = step
        self.slot = slot


class FileFormatError(PolicyError, ValueError):
    """A chunk or motion file that is malformed.

    Attributes:
        path: The file.
    """

    def __init__(self, message: str, *, path: str = "") -> None:
        super().__init__(f"{path}: {message}" if path else message)
        self.path = path


class DatasetError(PolicyError, ValueError):
    """A dataset that cannot be read or converted.

    Attributes:
        feature: Offending feature, such as ``action``, or None.
        frame: Offending frame over all episodes, or None.
    """

    def __init__(self, message: str, *, feature: str | None = None, frame: int | None = None) -> None:
        super().__init__(message)
        self.feature = feature
        self.frame = frame


def did_you_mean(given: object, known: Iterable[str]) -> str:
    """``did you mean 'x'? `` with the nearest known name, empty if none is near."""
    # Comparing takes the product of the lengths.
    near = difflib.get_close_matches(str(given)[:100], [str(name)[:100] for name in known][:200], n=1)
    return f"did you mean '{near[0]}'? " if near else ""
