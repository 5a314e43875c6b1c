"""An audit: what is not done yet is judged and journalled, then all of it is written as tables, lists and a page."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from wholebody.verdict.audit.journal import Journal
from wholebody.verdict.audit.lists import write_lists
from wholebody.verdict.audit.outcome import Outcome
from wholebody.verdict.audit.summary import write_summary
from wholebody.verdict.audit.tables import require_packages, whence, write_tables

Told = Callable[[int, int, Outcome], None]
"""Called with how many inputs are done, of how many, and the last one's outcome."""


def audit(
    names: Sequence[str],
    folder: str | Path,
    judge: Callable[[Sequence[str]], Iterable[Outcome]],
    *,
    asked: Mapping[str, Any],
    progress: Told | None = None,
) -> list[Outcome]:
    """Judge what a journal does not have yet, and write the answers.

    Args:
        names: Inputs, each once.
        folder: Of the journal and the answers.
        judge: Judges inputs, in any order, as `wholebody.verdict.audit.workers.outcomes` does.
        asked: What answers depend on, for `Journal`.
        progress: See `Told`.

    Returns:
        Outcomes in the order of the inputs.

    Raises:
        InputError: If the extra is not installed, options are wrong, or the folder has another audit.
        OSError: If the answers cannot be written.
    """
    require_packages()
    journal, stamps = Journal(folder, asked), {name: stamp(name) for name in names}
    try:
        left = [name for name in names if name not in journal.done or journal.done[name].stamp != stamps[name]]
        # A long one that comes last leaves all cores but one idle.
        left.sort(key=lambda name: -sum(stamps[name][:1]))
        for done, outcome in _counted(judge(left), len(names) - len(left)):
            journal.add(replace(outcome, stamp=stamps[outcome.name]))
            if progress is not None:
                progress(done, len(names), outcome)
    finally:
        journal.close()
    # What was audited into this folder before stays in its answers, but for files that changed since or are gone.
    others = [name for name, one in journal.done.items() if name not in stamps and one.stamp == stamp(name)]
    found = [journal.done[name] for name in (*names, *others)]
    write_tables(folder, found)
    write_lists(folder, found)
    write_summary(folder, found)
    return found[: len(names)]


def _counted(outcomes: Iterable[Outcome], done: int) -> Iterator[tuple[int, Outcome]]:
    return enumerate(outcomes, done + 1)


def stamp(name: str) -> list[int]:
    """Size and time of change of an input's file, of a dataset those of its description."""
    source, episode = whence(name)
    path = Path(source) / "meta" / "info.json" if episode is not None else Path(source)
    if not path.is_file():
        return []
    about = path.stat()
    return [about.st_size, about.st_mtime_ns]
