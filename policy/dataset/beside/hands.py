"""Poses of hands that a dataset has beside joints, held against each other."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.action_spec.codec import decode
from policy.action_spec.spec import ActionSpec
from policy.dataset.checks import column_layout
from policy.dataset.format import ACTION, STATE, Dataset, Episode, vectors
from policy.dataset.naming.sources import find_source
from policy.errors import ChunkError, DatasetError, SpecError
from policy.findings import Finding
from policy.kinematics.forward import kinematics
from policy.suspicion.tool import tool_findings

HANDS = {"left": "lhand", "right": "rhand"}
_BOTH = {14: 7, 12: 6}
"""Index at which the right hand begins in a feature of both, by the feature's width: position and quaternion, or
three angles."""
_OF_HANDS = re.compile(r"^(action|actions|observation|state)\.(?:.*\.)?(?:(left|right)_)?(eef|ee|eef_pose|ee_pose)$")
"""Features of the poses of one hand, or of both."""


def hand_findings(dataset: Dataset, episode: Episode, spec: ActionSpec, actions: np.ndarray) -> list[Finding]:
    """Hypotheses about the point of a hand that positions are of; none where no joints are beside them.

    Args:
        dataset: What is looked at.
        episode: Of it.
        spec: Layout of the actions.
        actions: Its raw actions, shape (n, A).
    """
    found: list[Finding] = []
    try:
        for key, side, given in _positions(dataset, episode, spec, actions):
            if (T := _wrists(dataset, episode, key, spec.robot, side)) is not None:
                found += tool_findings(side, T, given)
    except (DatasetError, ChunkError, SpecError):
        return found  # what is wrong with them is told where they are used
    return found


def _positions(
    dataset: Dataset, episode: Episode, spec: ActionSpec, actions: np.ndarray
) -> Iterator[tuple[str, str, np.ndarray]]:
    """Positions (n, 3) in the pelvis by side, and whether commanded or measured joints go with them."""
    slots = [spec.slot(f"{side}_wrist_position") for side in HANDS]
    if all(slot is not None and slot.mode == "absolute" for slot in slots):
        anchor = Anchor.nominal(robot=spec.robot)
        chunk = decode(spec, actions, anchor)
        for side, hand in HANDS.items():
            T = anchor.T_base_world @ getattr(chunk, f"T_world_{hand}")
            yield STATE, side, T[:, :3, 3]
        return
    for feature, about in dataset.features.items():
        match = _OF_HANDS.match(feature)
        if match is None or about["dtype"] not in ("float32", "float64") or len(about["shape"]) != 1:
            continue
        width = int(about["shape"][0])
        values = vectors(dataset.table(episode, [feature]).column(feature), width, feature, episode).astype(float)
        key = ACTION if match[1].startswith("action") else STATE
        if match[2] and width >= 6:
            yield key, match[2], values[:, :3]
        elif width in _BOTH and not match[2]:
            yield key, "left", values[:, :3]
            yield key, "right", values[:, _BOTH[width] : _BOTH[width] + 3]


def _wrists(dataset: Dataset, episode: Episode, key: str, robot: RobotSpec, side: str) -> np.ndarray | None:
    """Wrist poses (n, 4, 4) in the pelvis by the joints of a row; None where there are no joints."""
    try:
        source = find_source(dataset, key)
        layout = column_layout(dataset, source, robot=robot)
    except DatasetError:
        return None
    values = source.of(dataset.table(episode, list(dict.fromkeys(source.features))), episode).astype(float)
    q = np.tile(Anchor.nominal(robot=robot).q_body, (len(values), 1))
    for column, name in enumerate(layout.names):
        if name in robot.body_joints:
            q[:, robot.body_joints.index(name)] = values[:, column]
    return kinematics(robot).poses(q)[HANDS[side]] if np.isfinite(q).all() else None
