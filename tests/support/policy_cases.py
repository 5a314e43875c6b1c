"""Observations, motions, rotations and chunks that the policy tests share."""

import numpy as np
from hypothesis import strategies as st

from policy import ActionChunk, Anchor, Motion, Observation, builtin
from policy.geometry.rotations import rotvec_to_matrix, rpy_to_matrix
from policy.geometry.se3 import make_transform


def observation(time=0.0, *, lean=0.0, anchor=None):
    """The stance, pitched forward about the pelvis by some angle [rad]."""
    anchor = anchor or Anchor.nominal()
    tilt = make_transform(rotvec_to_matrix(np.array([0.0, lean, 0.0])), np.array([0.1 * lean, 0.0, -0.05 * lean]))
    return Observation(time, anchor.q_body, anchor.q_lhand, anchor.q_rhand, anchor.T_world_base @ tilt)


def anchor_somewhere(seed=0):
    """A pelvis and joints with nothing aligned to anything."""
    rng = np.random.default_rng(seed)
    nominal = Anchor.nominal()
    T = make_transform(rotvec_to_matrix(rng.uniform(-0.8, 0.8, 3)), rng.uniform(-1.0, 1.0, 3))
    q_body = nominal.q_body + rng.uniform(-0.1, 0.1, 29)
    return Anchor(T, q_body, nominal.q_lhand * 1.2, nominal.q_rhand * 0.8)


def wandering_chunk(anchor, *, steps=6, seed=1, reach=0.04, turn=0.15):
    """A chunk near the anchor's own wrists, within reach of the arms."""
    rng = np.random.default_rng(seed)
    poses = {
        hand: anchor.T_world_base
        @ anchor.poses[hand]
        @ make_transform(rotvec_to_matrix(rng.uniform(-turn, turn, (steps, 3))), rng.uniform(-reach, reach, (steps, 3)))
        for hand in ("lhand", "rhand")
    }
    fingers = [q + rng.uniform(-0.05, 0.05, (steps, 7)) for q in (anchor.q_lhand, anchor.q_rhand)]
    return ActionChunk(builtin("wbc32").id, 3, 1.5, 30.0, poses["lhand"], poses["rhand"], *fingers)


def made_up_motion(frames=121, fps=60.0):
    """Arms and waist swing while the pelvis walks, turns and tilts."""
    t = np.arange(frames) / fps
    rng = np.random.default_rng(2)
    q = Anchor.nominal().q_body + 0.3 * np.sin(np.outer(t, rng.uniform(0.5, 3.0, 29)))
    tilt = rpy_to_matrix(np.stack([0.1 * np.sin(t), 0.2 * np.sin(2 * t), 1.0 + t], axis=1))
    return Motion(fps, make_transform(tilt, np.stack([t, -0.5 * t, 0.8 + 0.02 * np.sin(t)], axis=1)), q)


def rotation_vectors():
    """Rotation vectors: anywhere, near the identity, near and at pi."""
    directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array).filter(lambda d: np.linalg.norm(d) > 1e-3)
    angles = st.one_of(
        st.floats(0.0, np.pi),
        st.sampled_from([0.0, 1e-12, 1e-8, 1e-4, np.pi / 2, np.pi - 1e-4, np.pi - 1e-8, np.pi]),
    )
    return st.tuples(directions, angles).map(lambda pair: pair[1] * pair[0] / np.linalg.norm(pair[0]))
