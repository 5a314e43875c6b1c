"""Twenty variants of the lissajous, so that nothing leans on one script; a study of that name runs them."""

from itertools import product

import coal
import numpy as np
import pinocchio as pin

from models import g1
from models.pinocchio_model import load_collision, load_pinocchio, stance_q
from policy.action_spec.hands import grasp_posture
from policy.geometry.rotations import rotvec_to_matrix, rpy_to_matrix
from policy.scripted.library import (
    LISSAJOUS_AMPLITUDE,
    LISSAJOUS_CENTRE,
    LISSAJOUS_RATES,
    LISSAJOUS_START,
    LISSAJOUS_THUMB,
    LISSAJOUS_TURN,
    MIRROR_Y,
)
from policy.scripted.policy import ScriptedMotion, ScriptedPolicy, minimum_jerk, stance_pose, to_chunk

SPEED_MAX = 1.1
"""Peak speed of a palm on the curve [m/s]."""
TURN_MAX = np.deg2rad(15.0)
"""Largest turn of the hands away from the lissajous's own orientation [rad]."""
SCORED, END = 20.0, 2.0
"""Time on the curve, and coming to rest at its centre [s]."""
MIRROR_TURN = np.array([-1.0, 1.0, -1.0])


def variant(seed: int) -> ScriptedPolicy:
    """Phases uniform, rates slowed to 0.8 to 1, peak at most 1.1 m/s, hands turned and closed by a random share."""
    rng, stance = np.random.default_rng(seed), stance_pose()
    phases = rng.uniform(0.0, 2.0 * np.pi, 3)
    rates = LISSAJOUS_RATES * rng.uniform(0.8, 1.0, 3)
    axis, angle = rng.normal(size=3), rng.uniform(0.0, TURN_MAX)
    turn = angle * axis / np.linalg.norm(axis)
    closing = rng.uniform()
    t = np.linspace(0.0, SCORED, 4001)[:, None]
    peak = np.linalg.norm(LISSAJOUS_AMPLITUDE * rates * np.cos(rates * t + phases), axis=1).max()
    amplitude = LISSAJOUS_AMPLITUDE * min(1.0, SPEED_MAX / peak)
    open_hands, fists = (stance.q_lhand, stance.q_rhand), [grasp_posture(side, 1.0) for side in ("left", "right")]
    fists[0][:3], fists[1][:3] = LISSAJOUS_THUMB, LISSAJOUS_THUMB * [1.0, -1.0, -1.0]
    fingers = [q + closing * (fist - q) for q, fist in zip(open_hands, fists, strict=True)]
    end = LISSAJOUS_START + SCORED

    def script(t):
        fade = 1.0 - minimum_jerk((t - end) / END)
        curve = LISSAJOUS_CENTRE + amplitude * fade[:, None] * np.sin(rates * t[:, None] + phases)
        share = minimum_jerk(t / LISSAJOUS_START)[:, None]
        hands = []
        for mirror in (np.ones(3), MIRROR_TURN):
            hands.append(rpy_to_matrix(share * LISSAJOUS_TURN * mirror) @ rotvec_to_matrix(share * turn * mirror))
        return ScriptedMotion(
            stance.p_world_lpalm + share * (curve - stance.p_world_lpalm),
            stance.p_world_rpalm + share * (curve * MIRROR_Y - stance.p_world_rpalm),
            stance.R_world_lhand @ hands[0],
            stance.R_world_rhand @ hands[1],
            open_hands[0] + share * (fingers[0] - open_hands[0]),
            open_hands[1] + share * (fingers[1] - open_hands[1]),
        )

    return ScriptedPolicy(f"lissajous {seed}", script, end + END)


def hand_distances(policy, period=1.0 / 30.0, poses=None):
    """Distance between the hulls of both hands as asked for on the curve; negative where they overlap.

    Neither planner nor controller has a part in it: both hands are put where the script has them, whatever arms they
    are on.

    Args:
        policy: Of `variant`.
        period: Between the instants that are looked at [s].
        poses: Times (n,) [s] and poses of both wrists then (n, 2, 4, 4), if they are not to be the script's.

    Returns:
        Times on the script's clock [s] and distances [m], shape (n,) each.
    """
    spec = g1()
    model = load_pinocchio(spec)
    geometry, data, q = load_collision(spec, model), model.createData(), stance_q(spec, model)
    t = np.arange(LISSAJOUS_START, LISSAJOUS_START + SCORED, period) if poses is None else poses[0]
    chunk = to_chunk(policy.script(t), "wbc32", 0, 0.0, 1.0 / period, len(t))
    wrists = (chunk.T_world_lhand, chunk.T_world_rhand) if poses is None else np.swapaxes(poses[1], 0, 1)
    sides = list(zip(wrists, (chunk.q_lhand, chunk.q_rhand), strict=True))
    fingers = [[model.idx_qs[model.getJointId(name)] for name in tool.finger_joints] for tool in spec.tools]
    frames = [model.getFrameId(tool.wrist_frame) for tool in spec.tools]
    shapes = [[s for s in geometry.geometryObjects if s.name.startswith(f"{t.side}_hand")] for t in spec.tools]
    nearest = np.full(len(t), np.inf)
    for k in range(len(t)):
        for at, (_, joints) in zip(fingers, sides, strict=True):
            q[at] = joints[k]
        pin.framesForwardKinematics(model, data, q)
        hands = []
        for wrist, (poses, _), those in zip(frames, sides, shapes, strict=True):
            moved = pin.SE3(poses[k]) * data.oMf[wrist].inverse()
            hands.append([(s.geometry, moved * data.oMi[s.parentJoint] * s.placement) for s in those])
        for (a, T_a), (b, T_b) in product(*hands):
            placed = [coal.Transform3s(T.rotation, T.translation) for T in (T_a, T_b)]
            near = coal.distance(a, placed[0], b, placed[1], coal.DistanceRequest(), coal.DistanceResult())
            nearest[k] = min(nearest[k], near)
    return t, nearest


def least_displacement(distances, clearance):
    """How far at least the hand moves that moves more, for hulls so far apart (n,) to have a clearance [m], (n,) [m].

    It is a lower bound for hands that keep their orientation: overlapping convex hulls are parted by no shift shorter
    than their depth, whatever its direction, and the two hands share it at best.
    """
    return 0.5 * np.maximum(clearance - distances, 0.0)
