"""Where derived files are kept: one folder per user, files written once and whole."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import platformdirs

from models.spec import RobotSpecError

CACHE_VARIABLE = "G1_WHOLEBODY_CACHE"
"""Environment variable that moves the cache, for example off a read-only home."""


def cache_dir() -> Path:
    """The user's cache folder, or the one named by `CACHE_VARIABLE`; it may not exist yet."""
    chosen = os.environ.get(CACHE_VARIABLE)
    return Path(chosen).resolve() if chosen else Path(platformdirs.user_cache_dir("g1-wholebody"))


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path to write to that becomes `path` at the end, so that other processes see all of it or nothing.

    Raises:
        RobotSpecError: If the folder cannot be written to.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            temporary.chmod(0o644)
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise RobotSpecError(
            f"cannot write {path}: {error.strerror}; set {CACHE_VARIABLE} to a folder that can be written to"
        ) from error


def write_whole(path: Path, content: bytes) -> Path:
    """Write a file through `whole_file`; returns its path."""
    with whole_file(path) as temporary:
        temporary.write_bytes(content)
    return path
