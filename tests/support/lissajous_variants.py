"""Twenty variants of the lissajous, so that nothing leans on one script.

``python tests/support/lissajous_variants.py FIRST LAST`` runs the seeds FIRST to LAST - 1 and prints one line each;
``hands`` after that prints how near the hands come that each asks for instead, whatever robot they are on.
"""

import sys
from itertools import product
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

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
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant

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


def errors_line(policy, supervisor, plant, *, start=3.0, scored=SCORED, seconds=None):
    """One line: the errors over the scored time, the time factor and a fall."""
    seconds = policy.duration if seconds is None else seconds
    result = run_episode(policy, supervisor, plant, duration=seconds, config=EpisodeConfig(hold=1.0))
    inside = (result.times >= start) & (result.times < start + scored)
    errors, turns = 1e3 * result.errors[inside], np.rad2deg(result.turns[inside])
    fell = f" FELL {result.fall.time:.2f} s: {result.fall.cause}" if result.fall else ""
    refused = f" refused {[(round(r.time, 2), str(r.reason)) for r in result.refusals]}" if result.refusals else ""
    return (
        f"rms {np.sqrt((errors**2).mean()):.2f} mm, max {errors.max():.2f} mm at "
        f"{result.times[inside][errors.max(axis=1).argmax()]:.2f} s, {np.sqrt((turns**2).mean()):.3f} deg, "
        f"time factor {result.time_factor:.4f}{fell}{refused}"
    )


def hand_distances(policy, period=0.04):
    """Distance between the hulls of both hands as asked for on the curve, (n,) [m]; negative where they overlap."""
    spec = g1()
    model = load_pinocchio(spec)
    geometry, data, q = load_collision(spec, model), model.createData(), stance_q(spec, model)
    t = np.arange(LISSAJOUS_START, LISSAJOUS_START + SCORED, period)
    chunk = to_chunk(policy.script(t), "wbc32", 0, 0.0, 1.0 / period, len(t))
    sides = [(chunk.T_world_lhand, chunk.q_lhand), (chunk.T_world_rhand, chunk.q_rhand)]
    fingers = [[model.idx_qs[model.getJointId(name)] for name in tool.finger_joints] for tool in spec.tools]
    wrists = [model.getFrameId(tool.wrist_frame) for tool in spec.tools]
    shapes = [[s for s in geometry.geometryObjects if s.name.startswith(f"{t.side}_hand")] for t in spec.tools]
    nearest = np.full(len(t), np.inf)
    for k in range(len(t)):
        for at, (_, joints) in zip(fingers, sides, strict=True):
            q[at] = joints[k]
        pin.framesForwardKinematics(model, data, q)
        hands = []
        for wrist, (poses, _), those in zip(wrists, sides, shapes, strict=True):
            moved = pin.SE3(poses[k]) * data.oMf[wrist].inverse()
            hands.append([(s.geometry, moved * data.oMi[s.parentJoint] * s.placement) for s in those])
        for (a, T_a), (b, T_b) in product(*hands):
            placed = [coal.Transform3s(T.rotation, T.translation) for T in (T_a, T_b)]
            near = coal.distance(a, placed[0], b, placed[1], coal.DistanceRequest(), coal.DistanceResult())
            nearest[k] = min(nearest[k], near)
    return nearest


if __name__ == "__main__":
    if "hands" in sys.argv:
        for seed in range(int(sys.argv[1]), int(sys.argv[2])):
            near = hand_distances(variant(seed))
            print(
                f"{seed} hands {1e3 * near.min():.1f} mm apart at least, overlap {(near < 0.0).mean():.0%} of the time"
            )
        sys.exit()
    spec = g1()
    robot = Supervisor(spec), MujocoPlant(spec)
    for seed in range(int(sys.argv[1]), int(sys.argv[2])):
        print(seed, errors_line(variant(seed), *robot), flush=True)
