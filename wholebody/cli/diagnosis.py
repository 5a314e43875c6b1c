"""A dry run of a checkpoint: whether it would do on the robot what it did in training.

Every check of `policy.lerobot.policy`, then a chunk from the nominal stance, decoded as it would be executed.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.chunk import ActionChunk
from policy.errors import ObservationError, PolicyError
from policy.findings import CheckpointError, Finding, Level
from policy.geometry.rotations import angle_between
from policy.lerobot.checkpoint import Checkpoint, LoadOptions, open_checkpoint
from policy.observation import Observation
from policy.placeholder_cameras import grey_images
from wholebody.config import START_MAX

if TYPE_CHECKING:
    from policy.action_spec.spec import ActionSpec
    from policy.lerobot.policy import LeRobotPolicy

LEVELS: tuple[Level, ...] = ("ok", "warning", "error")
"""Levels of a finding, in the order of the exit codes 0, 1, 2."""
DRY_TASK = "pick up the object"
"""Task of the dry run where none is given."""


@dataclass(frozen=True)
class Diagnosis:
    """Findings about a checkpoint.

    Attributes:
        checkpoint: Its folder.
        findings: One for every check, in order.
    """

    checkpoint: str
    findings: tuple[Finding, ...]

    @property
    def exit_code(self) -> int:
        """0 if all is well, 1 with warnings, 2 with errors: such a checkpoint is not run."""
        return max(LEVELS.index(finding.level) for finding in self.findings)

    def lines(self) -> list[str]:
        """One line a check."""
        return [f"{finding.level:<8}{finding.check:<12}{finding.sentence}" for finding in self.findings]

    def to_json(self) -> str:
        """JSON of the diagnosis: checkpoint, verdict, exit_code, and checks, each with check, level, text and cure."""
        checks = [vars(finding) for finding in self.findings]
        head = {"checkpoint": self.checkpoint, "verdict": LEVELS[self.exit_code], "exit_code": self.exit_code}
        return json.dumps(head | {"checks": checks}, indent=2, ensure_ascii=False)


def examine(
    checkpoint: str | Path,
    *,
    dataset: str | Path | None = None,
    spec: ActionSpec | str | None = None,
    **options: Any,
) -> Diagnosis:
    """Run every check on a checkpoint.

    Args:
        checkpoint: Its folder.
        dataset: Folder of the LeRobot dataset that it was trained on, to recompute statistics from.
        spec: Layout that the actions must have; what the checkpoint says if None.
        **options: As in `policy.lerobot.checkpoint.LoadOptions`.

    Returns:
        All findings; nothing that is wrong with the checkpoint raises.
    """
    choices = LoadOptions(**options)
    parts, findings = open_checkpoint(checkpoint, spec, choices)
    if parts is not None:
        if dataset is not None:
            findings += _against_dataset(parts, dataset)
        if all(finding.level != "error" for finding in findings):
            findings += _dry_run(parts)
    elif dataset is not None:
        findings.append(Finding("dataset", "warning", "not compared: the checkpoint could not be loaded"))
    return Diagnosis(str(checkpoint), tuple(findings))


def dry_observation(policy: LeRobotPolicy) -> Observation:
    """The nominal stance, seen by grey cameras of the sizes in training."""
    anchor, task = Anchor.nominal(), policy.checkpoint.options.task or DRY_TASK
    return replace(anchor.observation(), images=grey_images(policy.cameras), task=task)


def _against_dataset(checkpoint: Checkpoint, dataset: str | Path) -> list[Finding]:
    from policy.lerobot.training_data import TrainingData, check_training_data

    try:
        return check_training_data(checkpoint, TrainingData.open(dataset))
    except CheckpointError as error:
        return list(error.findings)


def _dry_run(checkpoint: Checkpoint) -> list[Finding]:
    """One chunk from the nominal stance, twice: the first call is slower."""
    from policy.lerobot.policy import LeRobotPolicy

    policy = LeRobotPolicy(checkpoint)
    observation = dry_observation(policy)
    try:
        policy.infer(observation)
        policy.reset()
        start = perf_counter()
        chunk = policy.infer(observation)
        seconds = perf_counter() - start
    except ObservationError as error:
        cure = "the robot has to be brought there first"
        return [Finding("chunk", "warning", f"none from the nominal stance: {error}", cure)]
    # A network may raise anything when its inputs are of another kind than its code expects.
    except (PolicyError, RuntimeError, ValueError, KeyError, TypeError, IndexError, AttributeError) as error:
        cure = "the weights do not make usable actions: train on, or check the layout"
        return [Finding("chunk", "error", f"{type(error).__name__} in a dry run: {error}", cure)]
    return [*_judge_chunk(chunk, observation), _judge_latency(policy, chunk, seconds)]


def _judge_chunk(chunk: ActionChunk, observation: Observation) -> list[Finding]:
    anchor = Anchor.measured(observation)
    offsets, angles = [], []
    for hand in ("lhand", "rhand"):
        first, now = getattr(chunk, f"T_world_{hand}")[0], anchor.T_world_base @ anchor.poses[hand]
        offsets.append(float(np.linalg.norm(first[:3, 3] - now[:3, 3])))
        angles.append(float(angle_between(first[:3, :3], now[:3, :3])))
    notes = "; ".join(chunk.notes)
    text = (
        f"{len(chunk)} finite steps, the first {1e3 * max(offsets):.0f} mm and {np.degrees(max(angles)):.0f}° "
        f"from the nominal stance{f'; {notes}' if notes else ''}"
    )
    if max(offsets) > START_MAX[0] or max(angles) > START_MAX[1]:
        bound = f"{START_MAX[0]} m or {np.degrees(START_MAX[1]):.0f}°"
        cure = f"more than {bound} is not followed at once: begin where demonstrations began"
        return [Finding("chunk", "warning", text, cure)]
    if notes:
        return [Finding("chunk", "warning", text, "grey images and the nominal stance may be far from training")]
    return [Finding("chunk", "ok", text)]


def _judge_latency(policy: LeRobotPolicy, chunk: ActionChunk, seconds: float) -> Finding:
    length = len(chunk) / chunk.fps
    device = policy.checkpoint.network.config.device
    text = f"{1e3 * seconds:.0f} ms a chunk on {device}; it lasts {length:.2f} s"
    if seconds < 0.5 * length:
        return Finding("latency", "ok", text)
    return Finding("latency", "warning", text, "use a GPU, fewer denoising steps (num_steps), or a policy server")
