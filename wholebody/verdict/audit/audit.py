"""An audit: what is not done yet is judged and journalled, then all of it is written as tables, lists and a page."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from policy.dataset.open import dataset_files
from wholebody.verdict.audit.journal import Journal
from wholebody.verdict.audit.lists import write_lists
from wholebody.verdict.audit.outcome import AuditOutcome
from wholebody.verdict.audit.repairs import FOLDER, file_name
from wholebody.verdict.audit.summary import write_summary
from wholebody.verdict.audit.tables import require_packages, whence, write_tables

Progress = Callable[[int, int, AuditOutcome], None]
"""Called with how many inputs are done, of how many, and the last one's outcome."""


def audit(
    names: Sequence[str],
    folder: str | Path,
    judge: Callable[[Sequence[str]], Iterable[AuditOutcome]],
    *,
    asked: Mapping[str, Any],
    progress: Progress | None = None,
) -> list[AuditOutcome]:
    """Judge what a journal does not have yet, and write the answers.

    Args:
        names: Inputs, each once.
        folder: Of the journal and the answers.
        judge: Judges inputs, in any order, as `wholebody.verdict.audit.workers.outcomes` does.
        asked: What answers depend on, for `Journal`.
        progress: See `Progress`.

    Returns:
        Outcomes in the order of the inputs.

    Raises:
        InputError: If the extra is not installed, options are wrong, or the folder has another audit.
        OSError: If the answers cannot be written.
    """
    require_packages()
    journal, stamp = Journal(folder, asked), cache(_stamp)
    stamps = {name: stamp(*whence(name)) for name in names}
    try:
        left = [name for name in names if not _done(journal.done.get(name), stamps[name], folder)]
        # A long one that comes last leaves all cores but one idle.
        left.sort(key=lambda name: -sum(stamps[name][:1]))
        for done, outcome in _counted(judge(left), len(names) - len(left)):
            journal.add(replace(outcome, stamp=stamps[outcome.name]))
            if progress is not None:
                progress(done, len(names), outcome)
        # What was audited into this folder before stays in its answers, but for files that changed since or are gone.
        others = [
            name for name, one in journal.done.items() if name not in stamps and one.stamp == stamp(*whence(name))
        ]
        found = [journal.done[name] for name in (*names, *others)]
        write_tables(folder, found)
        write_lists(folder, found)
        write_summary(folder, found)
    finally:
        journal.close()
    return found[: len(names)]


def _counted(outcomes: Iterable[AuditOutcome], done: int) -> Iterator[tuple[int, AuditOutcome]]:
    return enumerate(outcomes, done + 1)


def _done(outcome: AuditOutcome | None, stamp: list[int], folder: str | Path) -> bool:
    """Whether an input need not be judged again: it is as it was, was judged, and what it was repaired to is there."""
    if outcome is None or outcome.stamp != stamp or outcome.ending in ("crashed", "timed_out"):
        return False
    return outcome.repair is None or (Path(folder) / FOLDER / file_name(outcome.name)).is_file()


def _stamp(source: str, episode: int | None) -> list[int]:
    """Size and time of change of a file, of a dataset those of all files with numbers; nothing if it is gone."""
    files = [Path(source)] if episode is None else dataset_files(source)
    about = [path.stat() for path in files if path.is_file()]
    return [sum(one.st_size for one in about), max(one.st_mtime_ns for one in about)] if about else []
