"""Rows that were recorded step by step, each in the frames of its own step, to a chunk in world and back.

A pelvis that moved between the rows of a chunk takes what is given in it along: such rows have an anchor each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.codec import decode, encode_valid
from policy.action_spec.spec import ActionSpec
from policy.chunk import ActionChunk
from policy.errors import ChunkError


def in_own_pelvis(spec: ActionSpec) -> bool:
    """Whether wrists are given in a frame that moves with the pelvis, absolute: each row belongs to its own."""
    return any(
        slot.kind == "position" and slot.mode == "absolute" and slot.frame not in ("stance", "world")
        for slot in spec.slots
    )


def decode_rows(spec: ActionSpec, rows: np.ndarray, anchors: Sequence[Anchor], **when: Any) -> ActionChunk:
    """Chunk of rows (n, A) that were recorded step by step, each decoded with its own anchor.

    Args:
        spec: What the numbers mean; relative ones refer to the row's own anchor.
        rows: Raw actions, shape (n, A).
        anchors: One a row.
        **when: ``seq``, ``t_obs`` and ``fps`` as of `policy.action_spec.codec.decode`.

    Raises:
        ChunkError: If a row is malformed, or there are more or fewer anchors than rows.
    """
    if len(anchors) != len(rows) or not len(rows):
        raise ChunkError(f"there are {len(anchors)} anchors for {len(rows)} rows; one a row is expected")
    chunks = []
    for k, (row, anchor) in enumerate(zip(rows, anchors, strict=True)):
        try:
            chunks.append(decode(spec, row[None], anchor, **when))
        except ChunkError as error:
            raise ChunkError(f"row {k}: {error}", step=k, slot=error.slot) from error
    names = [field.name for field in fields(ActionChunk) if isinstance(getattr(chunks[0], field.name), np.ndarray)]
    joined = {name: np.concatenate([getattr(chunk, name) for chunk in chunks]) for name in names}
    return replace(chunks[0], **joined, notes=tuple(dict.fromkeys(note for chunk in chunks for note in chunk.notes)))


def encode_rows(spec: ActionSpec, chunk: ActionChunk, anchors: Sequence[Anchor]) -> np.ndarray:
    """Rows (n, A), each in the frames of its own anchor: inverse of `decode_rows`.

    Raises:
        ChunkError: If a joint layout cannot reach a pose.
    """
    chunk.validate()
    steps = (
        {name: x[k : k + 1] for name, x in vars(chunk).items() if isinstance(x, np.ndarray)} for k in range(len(chunk))
    )
    return np.concatenate(
        [encode_valid(spec, replace(chunk, **step), anchor) for step, anchor in zip(steps, anchors, strict=True)]
    )
