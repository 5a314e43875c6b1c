"""What to do with the episodes of datasets: those to delete, as LeRobot's tool takes them, and those to slow down."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from policy.writing import write_text
from wholebody.verdict.audit.outcome import AuditOutcome
from wholebody.verdict.audit.tables import whence

SLOW_DOWN = "slow_down.json"


def to_delete(outcomes: Sequence[AuditOutcome]) -> dict[str, list[int]]:
    """Episodes by dataset that cannot be done at any speed, or not be read."""
    found: dict[str, list[int]] = {}
    for one in outcomes:
        source, episode = whence(one.name)
        if episode is not None and one.slower is None and one.answer in ("infeasible", "malformed"):
            found.setdefault(source, []).append(episode)
    return found


def slow_down(outcomes: Sequence[AuditOutcome]) -> list[dict[str, Any]]:
    """Inputs that are feasible when they are slower, with the factor on their time."""
    slower = (one for one in outcomes if one.slower is not None)
    return [dict(zip(("source", "episode"), whence(one.name), strict=True)) | {"slower": one.slower} for one in slower]


def delete_settings(dataset: str, episodes: list[int]) -> dict[str, Any]:
    """Settings of ``lerobot-edit-dataset --config_path FILE``: a copy of the dataset without some episodes."""
    folder = Path(dataset).absolute()
    return {
        "repo_id": f"local/{folder.name}",
        "root": str(folder),
        "new_repo_id": f"local/{folder.name}_audited",
        "new_root": str(folder.with_name(f"{folder.name}_audited")),
        "operation": {"type": "delete_episodes", "episode_indices": episodes},
    }


def _episodes(dataset: str) -> int:
    """How many it has; none if it is no dataset."""
    info = Path(dataset) / "meta" / "info.json"
    return int(json.loads(info.read_text(encoding="utf-8"))["total_episodes"]) if info.is_file() else 0


def write_lists(folder: str | Path, outcomes: Sequence[AuditOutcome]) -> list[Path]:
    """Write the slow-down list, and a file of settings for each dataset with episodes to delete; where they are.

    A dataset of which nothing would be left has none: LeRobot's tool makes no empty one.

    Raises:
        OSError: If one cannot be written.
    """
    folder = Path(folder)
    for old in folder.glob("delete_*.json"):
        old.unlink()
    files = {SLOW_DOWN: slow_down(outcomes)}
    for i, (dataset, episodes) in enumerate(to_delete(outcomes).items()):
        if len(episodes) < _episodes(dataset):
            files[f"delete_{i:03d}_{Path(dataset).absolute().name}.json"] = delete_settings(dataset, episodes)
    for name, data in files.items():
        write_text(folder / name, json.dumps(data, indent=2) + "\n")
    return [folder / name for name in files]
