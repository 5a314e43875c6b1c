"""Files that are written whole or not at all, with an error that names them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkstemp


class OutputError(OSError):
    """A file that cannot be written, as on a full disk: no fault of what is read."""

    def __str__(self) -> str:
        return self.args[-1]


@contextmanager
def whole(path: str | Path) -> Iterator[Path]:
    """Temporary path that replaces the target at the end; where writing fails, the old file stays.

    Raises:
        OutputError: If it cannot be written.
    """
    path = Path(path)
    try:
        if path.exists() and not path.is_file():  # a device
            yield path
            return
        handle, name = mkstemp(dir=path.absolute().parent, prefix=f".{path.name}.", suffix=path.suffix)
        os.close(handle)
        try:
            yield Path(name)
            umask = os.umask(0)
            os.umask(umask)
            Path(name).chmod(0o666 & ~umask)
            Path(name).replace(path)
        finally:
            Path(name).unlink(missing_ok=True)
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        raise OutputError(error.errno, f"cannot write '{path}': {error.strerror or error}") from error


def write_text(path: str | Path, text: str, errors: str = "strict") -> None:
    """Write text as a whole file.

    Raises:
        OutputError: If it cannot be written.
    """
    with whole(path) as place:
        place.write_text(text, encoding="utf-8", errors=errors)
