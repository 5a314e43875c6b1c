"""Faults of this package, as distinct from bad input: one sentence, where to report it, an exit code of their own."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from traceback import extract_tb

from policy.writing import OutputError

CRASH = 3
"""Exit code of a fault of ours."""
ROOT, OURS = Path(__file__).parents[2], ("models", "policy", "wholebody")
"""Folder that the packages are in, and their names."""


class CrashError(Exception):
    """Something failed that no input may make fail; the error that it was raised from says what."""


@contextmanager
def ours() -> Iterator[None]:
    """Report any failure inside as a fault of this package: input and options were checked before.

    Raises:
        OutputError: If a file cannot be written.
        CrashError: Whatever it was.
    """
    try:
        yield
    except OutputError:
        raise
    except Exception as error:
        raise CrashError from error


def sentence(error: BaseException) -> str:
    """What failed, where in our code, and where to report it."""
    error = error.__cause__ if isinstance(error, CrashError) else error
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return (
        f"this is a fault of wholebody, not of the input: {text} ({_place(error)}); please report it on the project's "
        "issue tracker, with this line, the input and `wholebody --version`"
    )


def _place(error: BaseException) -> str:
    """File and line in our packages that the error came through last."""
    found = "outside of its packages"
    for frame in extract_tb(error.__traceback__):
        path = Path(frame.filename)
        if path.is_relative_to(ROOT) and path.relative_to(ROOT).parts[0] in OURS:
            found = f"{path.relative_to(ROOT).as_posix()}:{frame.lineno}"
    return found
