"""A chunk file to look at, run and change, in any layout."""

from __future__ import annotations

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.codec import encode
from policy.action_spec.mask import full_mask
from policy.action_spec.spec import ActionSpec
from policy.action_spec.state import state_numbers
from policy.chunk import ActionChunk
from policy.errors import ChunkError
from policy.recorded.chunk_file import ChunkFile
from policy.scripted.policy import minimum_jerk

RISE = 0.05
"""How far both hands go up [m]: within reach of the arms alone, whatever the layout."""


def example_file(spec: ActionSpec) -> ChunkFile:
    """One chunk in which both hands rise from the stance by `RISE`, as smoothly as a minimum of jerk is.

    A layout whose arms cannot do that, as those of a G1 with 23 joints, has the stance instead.
    """
    anchor, up = Anchor.nominal(robot=spec.robot), np.zeros((spec.horizon, 3))
    up[:, 2] = RISE * minimum_jerk(np.linspace(0.0, 1.0, spec.horizon))
    poses = {}
    for hand in ("lhand", "rhand"):
        poses[hand] = np.tile(anchor.T_world_base @ anchor.poses[hand], (spec.horizon, 1, 1))
        poses[hand][:, :3, 3] += up
    fingers = [np.tile(q, (spec.horizon, 1)) for q in (anchor.q_lhand, anchor.q_rhand)]
    chunk = ActionChunk(spec.id, 0, 0.0, spec.fps, poses["lhand"], poses["rhand"], *fingers)
    try:
        actions = encode(spec, chunk, anchor)
    except ChunkError:
        actions = np.tile(state_numbers(spec, anchor.observation(), anchor), (spec.horizon, 1))
    return ChunkFile(spec=spec, actions=actions, fps=spec.fps, mask=full_mask(spec))
