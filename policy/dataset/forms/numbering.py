"""What LeRobot's folders list: episodes and tasks, by their numbers."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from policy.dataset.format import EPISODES_MAX
from policy.dataset.forms.tables import ROWS_MAX
from policy.errors import DatasetError


def in_order(rows: list[dict[str, Any]], where: Path) -> list[dict[str, Any]]:
    """Entry of each episode, by its number.

    Raises:
        DatasetError: If a number or length is none, or the numbers are not those from 0 on.
    """
    if len(rows) > EPISODES_MAX:
        raise DatasetError(f"{where} lists {len(rows)} episodes; at most {EPISODES_MAX} are read")
    for row in rows:
        index, length = row["episode_index"], row["length"]
        if type(index) is not int or type(length) is not int or not 1 <= length <= ROWS_MAX:
            raise DatasetError(
                f"{where} has an episode_index {index!r:.40} of length {length!r:.40}; whole numbers are expected, "
                f"a length from 1 to {ROWS_MAX}"
            )
        if not isinstance(row["tasks"], list | None) or not all(isinstance(task, str) for task in row["tasks"] or ()):
            raise DatasetError(
                f"{where} has tasks {row['tasks']!r:.60} in episode {index}; a list of texts is expected"
            )
    rows = sorted(rows, key=lambda row: row["episode_index"])
    if [row["episode_index"] for row in rows] != list(range(len(rows))):
        raise DatasetError(f"{where} does not list the episodes 0 to {len(rows) - 1} once each")
    return rows


def in_numbers(pairs: Iterable[tuple[int, str]], file: Path) -> tuple[str, ...]:
    """Every task of a dataset, by its number.

    Raises:
        DatasetError: If they are no tasks, or not numbered from 0 on.
    """
    pairs = list(pairs)
    if not all(type(number) is int and isinstance(text, str) for number, text in pairs):
        raise DatasetError(f"{file} has a task that is no text, or whose task_index is no whole number")
    pairs.sort()
    if [number for number, _ in pairs] != list(range(len(pairs))):
        raise DatasetError(f"{file} does not number its {len(pairs)} tasks from 0 on")
    return tuple(text for _, text in pairs)
