"""What repairs of an audit are written as: a chunk file an input, and of each dataset a copy with repaired episodes."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

from policy.action_spec.anchor import Anchor
from policy.action_spec.codec import encode
from policy.dataset.rewriting import rewrite_dataset
from policy.recorded.chunk_file import ChunkFile, read_chunk_file, write_chunk_file
from policy.recorded.replay import ReplayPolicy
from wholebody.errors import InputError
from wholebody.verdict.audit.episode_repair import EpisodeRepair, EpisodeRepairer
from wholebody.verdict.audit.outcome import AuditOutcome
from wholebody.verdict.audit.tables import whence

FOLDER = "repaired"


def repair_of(
    repairer: EpisodeRepairer, policy: ReplayPolicy, name: str, factor: float | None, folder: Path
) -> EpisodeRepair | None:
    """Write the repaired input in its own layout if that is feasible; None if nothing helps.

    Args:
        repairer: Of the input.
        policy: Plays it.
        name: Of it in the audit.
        factor: How much slower makes it feasible; None if no speed does.
        folder: Of the audit.

    Raises:
        OSError: If it cannot be written.
    """
    change = repairer.repaired(factor, retimed=may_be_slower(name))
    if change is None:
        return None
    spec, anchor = policy.spec, Anchor.nominal(robot=policy.spec.robot)
    written = ChunkFile(spec, encode(spec, change.episode, anchor), change.episode.fps)
    if not repairer.holds(written.chunk()):
        return None
    file = Path(folder) / FOLDER / file_name(name)
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_suffix(".part")
    write_chunk_file(part, written)
    part.replace(file)
    return change


def may_be_slower(name: str) -> bool:
    """Whether an input can be played slower: not where that would take videos that are encoded anew."""
    from policy.dataset.open import open_dataset

    source, episode = whence(name)
    return episode is None or not open_dataset(source).episodes[episode].videos


def file_name(name: str) -> str:
    """File name of the repaired input: its own, and a few letters that tell it from others of that name."""
    source, episode = whence(name)
    mark = sha256(str(Path(source).absolute()).encode()).hexdigest()[:6]
    return f"{Path(source).stem}{'' if episode is None else f'_{episode:06d}'}_{mark}.npz"


def write_datasets(folder: str | Path, outcomes: Sequence[AuditOutcome]) -> list[Path]:
    """Write of each dataset a copy: feasible episodes as they are, repaired ones with their new actions, no others.

    A dataset none of whose episodes was repaired has none; one of an earlier run is replaced.

    Returns:
        Their folders.

    Raises:
        InputError: If repaired actions are missing.
        DatasetError: If a dataset cannot be read or written.
    """
    by_dataset: dict[str, list[tuple[int, AuditOutcome]]] = {}
    for one in outcomes:
        source, episode = whence(one.name)
        if episode is not None:
            by_dataset.setdefault(source, []).append((episode, one))
    written = []
    for number, (source, found) in enumerate(by_dataset.items()):
        target = Path(folder) / FOLDER / f"{number:03d}_{Path(source).absolute().name}"
        if target.is_dir():
            shutil.rmtree(target)
        if not any(one.repair for _, one in found):
            continue
        kept = {episode: None for episode, one in found if one.answer == "feasible"}
        files = {episode: _repaired(folder, one.name) for episode, one in found if one.repair}
        repaired = {episode: file.actions for episode, file in files.items()}
        facts = {
            "source": Path(source).name,
            "repaired": {str(episode): one.repair for episode, one in found if one.repair},
            "left_out": [episode for episode, one in found if episode not in kept and not one.repair],
        }
        spec = next(iter(files.values())).spec
        joints = spec if spec.slot("left_wrist_position") is None else None
        rewrite_dataset(source, target, kept | repaired, facts=facts, spec=joints)
        written.append(target)
    return written


def _repaired(folder: str | Path, name: str) -> ChunkFile:
    file = Path(folder) / FOLDER / file_name(name)
    if not file.is_file():
        raise InputError(f"{file} is missing; delete {Path(folder) / 'journal.jsonl'} to have all repaired again")
    return read_chunk_file(file)
