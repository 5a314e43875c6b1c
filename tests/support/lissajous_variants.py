"""Twenty variants of the lissajous, so that nothing leans on one script.

``python tests/support/lissajous_variants.py FIRST LAST`` runs the seeds FIRST to LAST - 1 and prints one line each.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from models import g1
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
from policy.scripted.policy import ScriptedMotion, ScriptedPolicy, minimum_jerk, stance_pose
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


if __name__ == "__main__":
    spec = g1()
    robot = Supervisor(spec), MujocoPlant(spec)
    for seed in range(int(sys.argv[1]), int(sys.argv[2])):
        print(seed, errors_line(variant(seed), *robot), flush=True)
