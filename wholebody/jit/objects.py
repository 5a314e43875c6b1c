"""Machine code in the user's cache: loading it takes a hundredth of the time of making it.

A file is named by everything that it was made of, and begins with the digest of its content: one that is old or damaged
is never loaded.
"""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

from models.cache import cache_dir, write_whole

FILES_KEPT = 500
"""Files that are kept, 50 kB each; chosen: some ten revisions of all kernels. The oldest go when one more is made."""
DIGEST = 32
"""Bytes of a digest."""


def folder() -> Path:
    """Where they lie."""
    return cache_dir() / "kernels"


def find(name: str, key: str) -> bytes | None:
    """Machine code of a kernel that was made of what has this key; None if there is none, or it is damaged."""
    try:
        content = _path(name, key).read_bytes()
    except OSError:
        return None
    code = content[DIGEST:]
    return code if sha256(code).digest() == content[:DIGEST] else None


def keep(name: str, key: str, code: bytes) -> None:
    """Write machine code for later; the oldest is forgotten.

    Raises:
        RobotSpecError: If the cache cannot be written.
    """
    write_whole(_path(name, key), sha256(code).digest() + code)
    files = sorted(folder().glob("*.o"), key=_written)
    for old in files[:-FILES_KEPT]:
        old.unlink(missing_ok=True)


def _written(path: Path) -> float:
    """Time at which a file was written [s]; one that another process has forgotten meanwhile counts as the oldest."""
    try:
        return path.stat().st_mtime
    except FileNotFoundError:
        return 0.0


def _path(name: str, key: str) -> Path:
    return folder() / f"{name}-{key[:32]}.o"
