"""Hostile chunks by the hundred: seeded families, each episode with one feasible chunk in the middle.

``python -m tests.studies.off_plan`` runs them in ranges, with the latency of plans that one wants.
"""

from dataclasses import dataclass, replace

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.rotations import rotvec_to_matrix
from policy.scripted.library import reach
from policy.scripted.policy import minimum_jerk, stance_pose, to_chunk
from wholebody.episode.run import observe
from wholebody.sim.fall import detect_fall
from wholebody.types import Reason, Status

STEPS, FPS = 50, 30.0
HOLD, RECOVER = 4.0, 3.0
STARTS = {"stand": None, "squat": (0.35, 0.45), "reach": (0.48, 0.95)}


def random_rotations(rng, n, most=np.pi):
    axis = rng.normal(size=(n, 3))
    return rotvec_to_matrix(axis / np.linalg.norm(axis, axis=1, keepdims=True) * rng.uniform(0.0, most, (n, 1)))


def box(rng, p):
    return p + rng.uniform(-1.0, 1.0, (STEPS, 3)), random_rotations(rng, STEPS)


def walk(rng, p):
    return p + np.cumsum(rng.normal(0.0, 0.04, (STEPS, 3)), axis=0), np.eye(3)


def jump(rng, p):
    return p + np.repeat(rng.uniform(-0.5, 0.5, (5, 3)), STEPS // 5, axis=0), np.eye(3)


def offset(rng, p):
    return np.tile(p + rng.choice([-1.0, -0.5, 0.0, 0.5, 1.0], 3), (STEPS, 1)), np.eye(3)


def behind(rng, p):
    return np.tile([rng.uniform(-0.9, -0.2), p[1], rng.uniform(0.5, 1.2)], (STEPS, 1)), random_rotations(rng, 1)[0]


def inside(rng, p):
    return np.tile(rng.uniform([-0.1, -0.1, 0.6], [0.05, 0.1, 1.2]), (STEPS, 1)), np.eye(3)


def floor(rng, p):
    return np.tile([rng.uniform(0.0, 0.5), p[1], rng.uniform(-0.8, 0.1)], (STEPS, 1)), np.eye(3)


def fast(rng, p):
    t = np.arange(STEPS)[:, None] / FPS
    rates = 3.0 * rng.uniform(2.0, 6.0, 3)
    return p + 0.15 * np.sin(rates * t + rng.uniform(0.0, 6.0, 3)), np.eye(3)


def straight(rng, p):
    direction = rng.normal(size=3) * [1.0, 1.0, 0.7]
    shoulder = np.array([-0.03, 0.15 * np.sign(p[1]), 1.15])
    return np.tile(shoulder + 0.9 * direction / np.linalg.norm(direction), (STEPS, 1)), np.eye(3)


def smooth(rng, p):
    return np.tile(p, (STEPS, 1)), np.eye(3)


FAMILIES = {
    "box": box,
    "walk": walk,
    "jump": jump,
    "offset": offset,
    "behind": behind,
    "inside": inside,
    "floor": floor,
    "fast": fast,
    "straight": straight,
    "nan": smooth,
    "fingers": smooth,
}


def hostile_chunk(kind, rng, seq, time):
    stance = stance_pose()
    T = np.tile(np.eye(4), (2, STEPS, 1, 1))
    fingers = [np.tile(q, (STEPS, 1)) for q in (stance.q_lhand, stance.q_rhand)]
    for i, p in enumerate((stance.p_world_lpalm, stance.p_world_rpalm)):
        T[i, :, :3, 3], T[i, :, :3, :3] = FAMILIES[kind](rng, p)
    if kind == "nan":
        T[rng.integers(2), rng.integers(STEPS), rng.integers(3), rng.integers(4)] = rng.choice(
            [np.nan, np.inf, -np.inf]
        )
    if kind == "fingers":
        fingers = [rng.uniform(-5.0, 5.0, (STEPS, 7)) for _ in range(2)]
    return ActionChunk("wbc32", seq, time, FPS, T[0], T[1], *fingers)


@dataclass
class FuzzResult:
    kind: str
    start: str
    fall: object
    tilt: float
    feasible_error: float
    progress: float
    refused: int
    off_plan: float
    """Longest time that it stood off its plan without a break [s]."""

    def __str__(self):
        fell = f"FELL at {self.fall.time:.2f} s: {self.fall.cause}" if self.fall else "stands"
        return (
            f"{self.kind:9s} from {self.start:6s} {fell}; tilt {np.rad2deg(self.tilt):.0f} deg, feasible chunk "
            f"{1e3 * self.feasible_error:.1f} mm, path progress {self.progress:.2f}, refused {self.refused}, "
            f"off its plan {self.off_plan:.1f} s"
        )


class Episode:
    """One fuzz case: start, hostile chunks, a feasible one, hostile chunks again, hold."""

    chunks = 4
    """Hostile chunks, half of them before the feasible one [no unit]."""

    def __init__(self, supervisor, plant, seed):
        self.supervisor, self.plant, self.rng = supervisor, plant, np.random.default_rng(seed)
        self.kind = list(FAMILIES)[seed % len(FAMILIES)]
        self.start = list(STARTS)[(seed // len(FAMILIES)) % len(STARTS)]
        self.state = plant.reset()
        supervisor.reset(self.state)
        self.fall, self.tilt, self.seq, self.refused = None, 0.0, 0, 0
        self.off_plan, self.left = 0.0, 0.0

    def run(self):
        self.step(0.2)
        goal = STARTS[self.start]
        if goal is not None:
            policy = reach(*goal)
            policy.reset()
            for _ in range(4):
                self.offer(replace(policy.infer(observe(self.plant.spec, self.supervisor, self.state)), seq=self.seq))
                self.step(0.8)
        half = self.chunks // 2
        for k in range(half):
            self.hostile(self.kind_of(k))
        error = self.feasible()
        for k in range(half, self.chunks):
            self.hostile(self.kind_of(k))
        self.step(HOLD)
        return self.result(error)

    def result(self, error):
        progress = 1.0 / self.supervisor.time_factor
        return FuzzResult(self.kind, self.start, self.fall, self.tilt, error, progress, self.refused, self.off_plan)

    def kind_of(self, k):
        """Family of a hostile chunk, by its number."""
        return self.kind

    def hostile(self, kind):
        self.offer(hostile_chunk(kind, self.rng, self.seq, self.state.time))
        self.step(self.rng.uniform(0.3, 1.2))

    def feasible(self):
        """Back to the stance; palm error after the time to get there [m]."""
        motion = reach(0.30, 0.90).script(np.full(STEPS, 100.0))
        self.offer(to_chunk(motion, "wbc32", self.seq, self.state.time, FPS, STEPS))
        self.step(RECOVER)
        goal = motion.p_world_lpalm[-1]
        robot = self.supervisor.robot
        return float(np.linalg.norm(robot.pose(self.plant.spec.tools[0].palm_frame).translation - goal))

    def offer(self, chunk):
        self.seq += 1
        status = self.supervisor.accept(chunk)
        self.refused += status.status is Status.HOLD and status.reason == "chunk_invalid"

    def step(self, seconds):
        for _ in range(round(seconds / self.plant.control_dt)):
            if self.fall is not None:
                return
            self.state = self.plant.step(self.supervisor.step(self.state))
            x, y = self.state.q[3], self.state.q[4]
            self.tilt = max(self.tilt, float(np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0))))
            status = self.supervisor.status
            self.left = self.left + self.plant.control_dt if status.reason is Reason.OFF_PLAN else 0.0
            self.off_plan = max(self.off_plan, self.left)
            self.fall = detect_fall(self.plant, self.state, status.status)


class MixedEpisode(Episode):
    """One case of many families: as many as there are starts have each family twice, at least."""

    chunks = 8

    def __init__(self, supervisor, plant, seed):
        super().__init__(supervisor, plant, seed)
        self.kind, self.start = "mixed", list(STARTS)[seed % len(STARTS)]
        self.kinds = [list(FAMILIES)[(self.chunks * seed + k) % len(FAMILIES)] for k in range(self.chunks)]

    def kind_of(self, k):
        return self.kinds[k]


EDGE_MIDDLE = np.array([0.30, 0.20, 0.95])
"""Middle of the left wrist's workspace; the right one is mirrored in y [m]."""
EDGE_SWING, EDGE_RATE, EDGE_TURN = (0.20, 0.35), (0.4, 1.2), 0.2
"""Amplitude [m] and rate [rad/s] of each axis, and amplitude of the turn about each [rad]: at most 0.42 m/s an axis."""
EDGE_SECONDS = 8.0


class EdgeEpisode(Episode):
    """Slow, smooth wrist paths that pass the limit of reach while turning; chunks are pieces of them, then the end."""

    def __init__(self, supervisor, plant, seed):
        super().__init__(supervisor, plant, seed)
        rng, self.kind, self.start = np.random.default_rng(10_000 + seed), "edge", "stand"
        self.swing = rng.uniform(*EDGE_SWING, (2, 3)) * rng.choice([-1.0, 1.0], (2, 3))
        self.turn = rng.uniform(-EDGE_TURN, EDGE_TURN, (2, 3))
        self.rates, self.phases = rng.uniform(*EDGE_RATE, (2, 2, 3)), rng.uniform(0.0, 2.0 * np.pi, (2, 2, 3))
        self.replace = rng.uniform(0.3, 1.2, 40)

    def chunk(self, time):
        """The path from a time on [s]; it begins at the stance and is blended in over two seconds."""
        stance, t = stance_pose(), time + np.arange(STEPS) / FPS
        share = minimum_jerk((t - 0.2) / 2.0)[:, None]
        T = np.tile(np.eye(4), (2, STEPS, 1, 1))
        starts = (stance.p_world_lpalm, stance.R_world_lhand), (stance.p_world_rpalm, stance.R_world_rhand)
        for i, (p, R) in enumerate(starts):
            waves = [np.sin(self.rates[k, i] * t[:, None] + self.phases[k, i]) for k in (0, 1)]
            middle = EDGE_MIDDLE * [1.0, 1.0 - 2.0 * i, 1.0]
            T[i, :, :3, 3] = p + share * (middle + self.swing[i] * waves[0] - p)
            T[i, :, :3, :3] = R @ rotvec_to_matrix(share * self.turn[i] * waves[1])
        fingers = [np.tile(q, (STEPS, 1)) for q in (stance.q_lhand, stance.q_rhand)]
        return ActionChunk("wbc32", self.seq, time, FPS, T[0], T[1], *fingers)

    def run(self):
        self.step(0.2)
        for pause in self.replace:
            if self.state.time < EDGE_SECONDS:
                self.offer(self.chunk(self.state.time))
                self.step(pause)
        self.step(HOLD)
        return self.result(0.0)
