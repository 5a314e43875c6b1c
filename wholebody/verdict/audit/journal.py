"""The journal of an audit: a line an input when it is done, so that after a kill nothing is lost or done twice."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from fcntl import LOCK_EX, LOCK_NB, flock
from pathlib import Path
from typing import Any

from wholebody.errors import InputError
from wholebody.verdict.audit.outcome import AuditOutcome

NAME = "journal.jsonl"


class Journal:
    """Lines of JSON: first what the audit was asked for, then an outcome each.

    Args:
        folder: Of the audit; made if it is not there.
        asked: What answers depend on: a journal of anything else is not gone on with.

    Attributes:
        done: Outcomes by name.

    Raises:
        InputError: If there is a journal of something else, a damaged one, or one that an audit is writing now.
        OSError: If it cannot be read or written.
    """

    def __init__(self, folder: str | Path, asked: Mapping[str, Any]) -> None:
        self._path = Path(folder) / NAME
        Path(folder).mkdir(parents=True, exist_ok=True)
        self.done: dict[str, AuditOutcome] = {}
        asked = json.loads(json.dumps(asked, sort_keys=True, default=str))
        self._file = self._path.open("a+b")
        try:
            flock(self._file, LOCK_EX | LOCK_NB)
            whole = self._read(asked)
        except BlockingIOError as error:
            self.close()
            raise InputError(f"another audit is writing to {folder}: name another folder with --to, or wait") from error
        except InputError:
            self.close()
            raise
        # A kill in the middle of a line leaves a part of it.
        self._file.truncate(whole)
        if not whole:
            self._write({"asked": asked})

    def _read(self, asked: dict[str, Any]) -> int:
        """Read what is there; how many bytes of it are whole lines."""
        self._file.seek(0)
        data = self._file.read()
        whole = data.rfind(b"\n") + 1
        for number, line in enumerate(data[:whole].splitlines()):
            try:
                row = json.loads(line)
                if number:
                    outcome = AuditOutcome(**row)
                    self.done[outcome.name] = outcome
            except (ValueError, TypeError) as error:
                raise InputError(f"{self._path} is damaged in line {number + 1}: {error}; delete it") from error
            if not number and row.get("asked") != asked:
                before = row.get("asked") or {}
                changed = sorted(key for key in {*asked, *before} if before.get(key) != asked.get(key))
                raise InputError(
                    f"{self._path} is of an audit with other settings ({', '.join(changed)}): name another folder "
                    "with --to, or delete it"
                )
        return whole

    def add(self, outcome: AuditOutcome) -> None:
        """Write an outcome; it is on the disk when this returns."""
        self.done[outcome.name] = outcome
        self._write(outcome.as_dict())

    def _write(self, line: dict[str, Any]) -> None:
        self._file.write(json.dumps(line, allow_nan=False).encode() + b"\n")
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Nothing is added any more."""
        self._file.close()
