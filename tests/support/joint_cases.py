"""Recorded joints that the tests of joint conversion share."""

import numpy as np

from models import g1
from policy.action_spec.slot import DEX1_OPEN
from policy.dataset.joint_layout import joint_layout
from policy.dataset.naming.meaning import UNITREE_DEX1, UNITREE_DEX3

DEX3 = joint_layout([list(UNITREE_DEX3)], 28)
DEX1 = joint_layout([list(UNITREE_DEX1)], 16)


def swinging(layout=DEX3, *, frames=40, seed=0, share=0.25, fps=30.0):
    """Joint vectors (frames, D), float32 as datasets have them: every column a sine around the middle of its range.

    Args:
        layout: Columns.
        frames: How many.
        seed: Of frequencies (0.05 to 0.3 Hz) and phases.
        share: Amplitude as a share of the range.
        fps: Frames per second [Hz].
    """
    rng, spec = np.random.default_rng(seed), g1()
    low, high = np.zeros(layout.dim), np.full(layout.dim, DEX1_OPEN)
    for column, name in enumerate(layout.names):
        if name in spec.joint_names:
            index = spec.index(name)
            low[column], high[column] = spec.position_min[index], spec.position_max[index]
    phase = 2.0 * np.pi * rng.uniform(0.05, 0.3, layout.dim) * np.arange(frames)[:, None] / fps
    phase += rng.uniform(0.0, 2.0 * np.pi, layout.dim)
    q = 0.5 * (low + high) + share * (high - low) * np.sin(phase)
    return (np.rad2deg(q) if layout.unit == "deg" else q).astype(np.float32)
