"""Where derived files are kept: one folder per user, files written once and whole."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import platformdirs

from models.spec import SpecError

CACHE_VARIABLE = "G1_WHOLEBODY_CACHE"
"""Environment variable that moves the cache, for example off a read-only home."""


def cache_dir() -> Path:
    """The user's cache folder, or the one named by `CACHE_VARIABLE`; it may not exist yet."""
    chosen = os.environ.get(CACHE_VARIABLE)
    return Path(chosen).resolve() if chosen else Path(platformdirs.user_cache_dir("g1-wholebody"))


def write_atomically(path: Path, content: bytes) -> Path:
    """Write a file so that other processes see all of it or nothing.

    Raises:
        SpecError: If the folder cannot be written to.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
            Path(temporary).chmod(0o644)
            Path(temporary).replace(path)
        except OSError:
            Path(temporary).unlink(missing_ok=True)
            raise
    except OSError as error:
        raise SpecError(
            f"cannot write {path}: {error.strerror}; set {CACHE_VARIABLE} to a folder that can be written to"
        ) from error
    return path
