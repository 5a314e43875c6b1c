"""Chunks by construction: the left hand is sent somewhere from the stance, the right one stays."""

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.chunk import ActionChunk
from policy.scripted.policy import minimum_jerk

FPS, STEPS = 30.0, 50
STANCE, SPEC = Anchor.nominal(), builtin("wbc32")


def sent(to=(0.1, 0.0, 0.0), time=1.0, jump=(0.0, 0.0, 0.0), steps=STEPS):
    """The left hand goes from the stance by ``to`` [m] within a time [s]; all is moved by ``jump`` [m]."""
    share = minimum_jerk(np.arange(steps) / FPS / time)[:, None]
    T = [np.tile(STANCE.T_world_base @ STANCE.poses[hand], (steps, 1, 1)) for hand in ("lhand", "rhand")]
    T[0][:, :3, 3] += share * np.asarray(to)
    for poses in T:
        poses[:, :3, 3] += jump
    fingers = [np.tile(q, (steps, 1)) for q in (STANCE.q_lhand, STANCE.q_rhand)]
    return ActionChunk(SPEC.id, 0, 0.0, FPS, *T, *fingers)
