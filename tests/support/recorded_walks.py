"""Recorded motions that walk, replayed in MuJoCo with `steps: reach`: how near to their way, and to their hands."""

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.geometry.rotations import quaternion_to_matrix, rotvec_to_matrix
from policy.geometry.se3 import interpolate, inverse, make_transform, translated
from policy.kinematics.forward import kinematics
from policy.recorded.motion_csv import HANDS
from policy.recorded.replay import WalkedReplay
from policy.recorded.walked_motion import BEFORE, WalkedWay, base_way, hands_of, walked_chunk
from tests.support.walks import worlds
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.feet.recorded_walks import walk_limits
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.palms import palm_offsets
from wholebody.sim.plant import MujocoPlant
from wholebody.verdict.verdict import verdict_of

CONFIG = ControllerConfig(steps="reach")
LIMITS = walk_limits(CONFIG)
NEAR = 0.03
"""Distance of a palm from where it was recorded about the base that counts as there [m]."""

STRIDE = 0.5
"""Width of the Gaussian that takes the robot's steps out of the way of its pelvis [s]: 8 % of their sway are left."""


class Seen:
    """Where the robot is, a row each 20 ms: what `run_episode` takes for a recorder."""

    def __init__(self, supervisor):
        self.supervisor, self.rows = supervisor, []

    def begin(self, free):
        self.rows = []

    def add(self, state, command, followed, plant):
        if round(state.time / 0.002) % 10 == 0:
            seen = self.supervisor._last_state  # as the controller has it, estimated in a realistic world
            self.rows.append((state.time, state.q.copy(), seen.q[:7].copy(), self.supervisor.base))


def replayed(motion, *, config=CONFIG, seed=None, until=None, hold=3.0):
    """Numbers of a motion that is walked with, of the true robot or in the realistic world of a seed; the verdict."""
    spec = describe(config.robot)
    plant, sensors = worlds(seed, spec) if seed is not None else (MujocoPlant(spec), None)
    supervisor = Supervisor(spec, config)
    policy = WalkedReplay(walked_chunk(motion, LIMITS), LIMITS, name="walk", spec=builtin("wbc32"))
    seen, settings = Seen(supervisor), EpisodeConfig(settle=0.5, hold=hold)
    duration = policy.duration if until is None else until
    result = run_episode(policy, supervisor, plant, duration=duration, config=settings, sensors=sensors, recorder=seen)
    numbers = _numbers(motion, supervisor, settings.settle + BEFORE, seen.rows, result.fall)
    return numbers | {"steps": len(result.steps)}, verdict_of("walk", result), result


def _numbers(motion, supervisor, begin, rows, fall):
    """What rows of a robot are, compared with the motion that they begin at a time [s]."""
    walked, recorded = WalkedWay.of(motion, LIMITS), base_way(motion)
    times, q, seen, base = (np.array(part) for part in zip(*rows, strict=True))
    first = int(np.searchsorted(times, begin))
    due = times - begin
    on = (due >= 0.0) & (due <= walked.times[-1])
    # The way of the recording in world: from where the base was as it began.
    x, y, turned = base[first]
    way = np.column_stack([np.interp(due[on], walked.times, recorded[:, i]) for i in range(3)])
    there = _moved(way, recorded[0], (x, y, turned))
    path = motion.T_world_base[:, :2, 3]
    path = _moved(np.column_stack([path, recorded[:, 2]]), recorded[0], (x, y, turned))
    pelvis = q[:, 0] + 1j * q[:, 1] - Anchor.nominal().T_world_base[0, 3] * np.exp(1j * base[:, 2])
    found = {}
    for name, points in (("pelvis", pelvis), ("mean", _mean(pelvis)), ("base", base[:, 0] + 1j * base[:, 1])):
        found[f"{name}_off"] = float(np.abs(points[on] - there).max())
        found[f"{name}_aside"] = float(max(np.abs(path - one).min() for one in points[on]))
    joints = q[on, 7:][:, supervisor.robot.pin_to_motor]
    palms = _palm_errors(supervisor.spec, hands_of(motion), walked, due[on], joints, seen[on], base[on])
    return {
        "fell": float(fall is not None),
        "factor": float(walked.times[-1] / motion.duration),
        "palms_near": float((palms.max(axis=1) <= NEAR).mean()),
        "palms_median": float(np.median(palms)),
        "palms_most": float(palms.max()),
    } | found


def _mean(points):
    """Points a row each 20 ms without the sway of the robot's steps, two in 1.4 s."""
    weights = np.exp(-0.5 * (np.arange(-75, 76) * 0.02 / STRIDE) ** 2)
    return np.convolve(np.pad(points, 75, mode="edge"), weights / weights.sum(), mode="valid")


def _moved(places, begin, to):
    """Places (n, 3) as a way that begins elsewhere, as complex points (n,)."""
    seen = (places[:, 0] - begin[0] + 1j * (places[:, 1] - begin[1])) * np.exp(1j * (to[2] - begin[2]))
    return to[0] + 1j * to[1] + seen


def _palm_errors(spec, hands, walked, due, joints, seen, base):
    """Distances (n, 2) of palms about the base from where they were recorded about the pelvis."""
    poses, anchor = kinematics(spec).poses(joints[:, : len(spec.body_joints)]), Anchor.nominal()
    level = make_transform(
        rotvec_to_matrix(base[:, [2]] * np.array([0.0, 0.0, 1.0])), np.column_stack([base[:, :2], np.zeros(len(base))])
    )
    pelvis, errors = make_transform(quaternion_to_matrix(seen[:, 3:7], "xyzw"), seen[:, :3]), []
    for hand, offset in zip(HANDS, palm_offsets(spec), strict=True):
        there = inverse(level) @ pelvis @ poses[hand]
        asked = anchor.T_world_base @ interpolate(hands[hand], walked.times, due)
        errors.append(np.linalg.norm(translated(there, offset)[:, :3, 3] - translated(asked, offset)[:, :3, 3], axis=1))
    return np.stack(errors, axis=1)
