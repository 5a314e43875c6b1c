"""Masks: which numbers of a chunk are there, where the layout has places that not every robot fills."""

from __future__ import annotations

import dataclasses

import numpy as np

from policy.action_spec.spec import ActionSpec
from policy.errors import ChunkError, SpecError

MASKED = "its mask says that the chunk does not have it"


def full_mask(spec: ActionSpec) -> np.ndarray | None:
    """Mask (A,) of a chunk that has all that a masked spec uses; None for a spec without masks."""
    if not spec.masked:
        return None
    return np.array([slot.kind != "ignored" for slot in spec.slots for _ in range(slot.size)])


def unmasked(spec: ActionSpec, actions: np.ndarray, mask: np.ndarray | None) -> tuple[ActionSpec, np.ndarray]:
    """Layout and actions of a chunk without what its mask leaves out.

    Args:
        spec: Layout of all numbers.
        actions: Finite raw actions, shape (H, A).
        mask: Numbers that are there, shape (A,), the same in every step; or steps that are there, shape (H,), which end
            before the padding begins; or both, shape (H, A).

    Raises:
        ChunkError: If a masked spec has no mask, or the mask is none, or leaves a hand without a place to go.
    """
    if mask is None:
        if spec.masked:
            raise ChunkError(
                f"'{spec.name}' says with a mask of {spec.dim} which of its numbers are there, and none is given; put "
                "it beside the actions as 'mask'"
            )
        return spec, actions
    columns, steps = _parts(np.asarray(mask), *actions.shape)
    if not steps.any() or (np.diff(steps.astype(int)) > 0).any():
        raise ChunkError("the mask leaves out steps in the midst of the chunk, or all; padding comes at the end")
    absent = []
    for slot in spec.slots:
        there = columns[slot.indices]
        if there.any() != there.all():
            raise ChunkError(f"the mask has {int(there.sum())} of the {slot.size} numbers of {slot.name}; all or none")
        if not there.all() and slot.kind != "ignored":
            absent.append(slot.name)
    try:
        return dataclasses.replace(spec.without(absent, MASKED), masked=False), actions[steps]
    except SpecError as error:
        raise ChunkError(f"with its mask, {error}") from error


def _parts(mask: np.ndarray, steps: int, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Which columns (A,) and which steps (H,) are there."""
    if mask.dtype.kind in "iuf" and np.isin(mask, (0, 1)).all():
        mask = mask.astype(bool)
    if mask.dtype.kind != "b" or mask.shape not in ((dim,), (steps,), (steps, dim)):
        raise ChunkError(
            f"the mask is of type {mask.dtype} and shape {mask.shape}; true or false of ({dim},) numbers, ({steps},) "
            f"steps or ({steps}, {dim}) both is expected"
        )
    if mask.shape == (dim,):
        return mask, np.ones(steps, dtype=bool)
    if mask.shape == (steps,):
        return np.ones(dim, dtype=bool), mask
    columns, there = mask.any(axis=0), mask.any(axis=1)
    if (mask != columns & there[:, None]).any():
        raise ChunkError("the mask has other numbers in one step than in another; the same are expected in all")
    return columns, there
