"""Guidance of flow matching: chunks are led to where the robot gets with its hands while they are denoised."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from policy.lerobot.policy import LeRobotPolicy
from wholebody.errors import InputError
from wholebody.guide.guide import Guide

FROM = 0.5
"""Time of the flow, 1 at the noise and 0 at the actions, from which on chunks are led [no unit]; chosen: before that,
what is foreseen of a chunk is a mean of many."""
AFFINE = 1e-3
"""What a post-processor may differ from an affine function of each number by, in terms of its range [no unit]; chosen:
rounding of single precision."""


@contextmanager
def guided(policy: LeRobotPolicy, guide: Guide, *, strength: float = 1.0, since: float = FROM) -> Iterator[None]:
    """Lead what a policy of LeRobot samples by flow matching (π0, π0.5) to where the robot gets with its hands.

    At each step of denoising the chunk that the step foresees, ``x - t v``, is moved by `Guide.corrected`, and the
    velocity ``v`` such that this is what it foresees. Training is not needed, nor a gradient of the network.

    Args:
        policy: Its network denoises step by step; one thread at a time.
        guide: Of the policy's layout, and of the state that it is asked from.
        strength: Share of the correction, 0 to 1.
        since: Time of the flow from which on chunks are led, at most 1.

    Raises:
        InputError: If the policy does not denoise, its post-processor does more than to scale numbers, or the layout
            is not that of the guide.
    """
    model = getattr(policy.checkpoint.network, "model", None)
    denoise = getattr(model, "denoise_step", None)
    if model is None or denoise is None or not hasattr(policy.checkpoint.network.config, "max_action_dim"):
        raise InputError(f"'{policy.checkpoint.network.config.type}' does not denoise step by step; pi0 and pi05 do")
    if policy.spec.hash != guide.spec.hash:
        raise InputError(
            f"the guide is of '{guide.spec.name}', the policy of '{policy.spec.name}'; give it that layout"
        )
    low, width = _scales(policy)

    def led(*args: Any, **named: Any) -> Any:
        v = denoise(*args, **named)
        x, time = named["x_t"], float(named["timestep"].reshape(-1)[0])
        if time > since:
            return v
        foreseen = (x - time * v)[..., : len(low)].detach().cpu().double().numpy()
        moved = (guide.corrected(low + width * foreseen, strength) - low) / width - foreseen
        v = v.clone()
        v[..., : len(low)] -= v.new_tensor(moved / time)
        return v

    before = vars(model).get("denoise_step")
    model.denoise_step = led
    try:
        yield
    finally:
        if before is None:
            del model.denoise_step
        else:
            model.denoise_step = before


def _scales(policy: LeRobotPolicy) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (A,) that a post-processor makes of 0, and how they change with normalised ones."""
    import torch

    def of(value: float) -> np.ndarray:
        numbers = torch.full((1, 1, policy.spec.dim), value, dtype=torch.float32)
        return policy.checkpoint.postprocessor(numbers).detach().cpu().double().numpy().reshape(-1)

    zero, one, two = of(0.0), of(1.0), of(-1.0)
    width = one - zero
    off = np.abs(zero - width - two) if len(zero) == policy.spec.dim else np.inf
    if not (np.all(off <= AFFINE * np.abs(width)) and np.all(width != 0.0)):
        raise InputError("the policy's post-processor does more than to scale numbers: its chunks cannot be led")
    return zero, width
