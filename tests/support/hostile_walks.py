"""Hostile chunks that say a base velocity: families of hands, frames that they are in, and velocities, by the seed.

The velocity is the chunks' own, or somebody else tells it. Beside those: hands that are just such as a robot that steps
is led with, at the edge of what `wholebody.execution.feet.hands_of_walks` allows.
"""

from dataclasses import dataclass, replace
from math import prod

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.rotations import quaternion_to_matrix
from policy.scripted.policy import stance_pose
from tests.support import hostile_chunks
from wholebody.execution.feet.hands_of_walks import ASIDE, BEHIND, BESIDE, STRETCHED
from wholebody.execution.states import State
from wholebody.sim.fall import detect_fall

KINDS = tuple(kind for kind in hostile_chunks.FAMILIES if kind not in ("nan", "fingers"))
FRAMES = ("pelvis", "world", "stance")
VELOCITIES = ((0.4, 0.0, 0.0), (-0.25, 0.0, 0.0), (0.0, 0.15, 0.0), (0.0, 0.0, 0.5), (0.3, 0.0, 0.3))
CASES = prod(map(len, (KINDS, FRAMES, VELOCITIES)))
"""Seeds from which on the same kind, frame and velocity come again, with other numbers."""
EDGES = ("far", "near", "behind", "low", "high")
"""Which bound hands are just inside of: far from the shoulder, near the middle, behind it; and far down and far up."""
JUST, TURNED = 0.1, 0.8
"""Share of a bound by which hands are inside it at most [no unit], and how far they are turned at most [rad]."""
SHOULDER, ARM = np.array([0.0, 0.1, 0.29]), 0.41
"""Of a G1 about its pelvis, and what `hands_of_walks` takes for the length of an arm [m]."""
FIRST, APART, CHUNKS = 0.2, 1.0, 4
"""Time of the first chunk, from one to the next [s], and how many come."""
AGAIN = 0.5
"""Time after which somebody else tells the velocity again [s]."""


@dataclass
class HostileWalk:
    """What became of a robot that was led by hostile chunks.

    Attributes:
        fall: When and why it fell, or None.
        walked: How long it walked [s].
        reasons: Seconds of each reason of its status while it walked.
        off: Distance of the farther palm from where it was led, at the worst tick [m].
        end: State of the supervisor at the end.
    """

    kind: str
    frame: str
    velocity: tuple
    fall: object
    walked: float
    reasons: dict
    off: float
    end: State

    def __str__(self):
        said = ", ".join(f"{reason} {seconds:.1f} s" for reason, seconds in self.reasons.items())
        became = f"FELL at {self.fall.time:.2f} s: {self.fall.cause}" if self.fall else "stands"
        return (
            f"{self.kind:8s} {self.frame:6s} {self.velocity} {became}; walked {self.walked:.1f} s ({said}), palms up "
            f"to {1e3 * self.off:.0f} mm from where they were led, {self.end.value}"
        )


def wrist_at_edge(rng, edge):
    """Where a left wrist of a robot that stands upright is just inside a bound, about its pelvis (3,) [m]."""
    far = STRETCHED * ARM
    while True:
        way = rng.normal(size=3)
        if edge in ("low", "high"):
            way[2] = 3.0 * abs(way[2]) * (1.0 if edge == "high" else -1.0)
        p = SHOULDER + far * (1.0 - JUST * rng.uniform(0.05, 1.0)) * way / np.linalg.norm(way)
        if edge == "near":
            p[1] = ASIDE + rng.uniform(0.0, 0.07)
        if edge == "behind":
            p[0] = -BEHIND * (1.0 - JUST * rng.uniform(0.05, 1.0))
        apart = np.linalg.norm(p[:2]) > 1.05 * BESIDE and p[1] > ASIDE + 0.001 and p[0] > -0.995 * BEHIND
        if apart and np.linalg.norm(p - SHOULDER) < 0.995 * far:
            return p


def edge_walk(supervisor, plant, seed, until=6.5, *, rides=False):
    """Lead a robot by hands just inside the bounds until a time [s], or a fall; there are new ones each second."""
    edge, velocity = EDGES[seed % len(EDGES)], VELOCITIES[seed // len(EDGES) % len(VELOCITIES)]
    stance = stance_pose()

    def chunk(rng, seq, time):
        q, T = plant.state().q, np.tile(np.eye(4), (2, hostile_chunks.STEPS, 1, 1))
        axes = quaternion_to_matrix(q[3:7], "xyzw")
        for i, R in enumerate((stance.R_world_lhand, stance.R_world_rhand)):
            T[i, :, :3, 3] = q[:3] + axes @ (wrist_at_edge(rng, edge) * (1.0, 1.0 - 2.0 * i, 1.0))
            T[i, :, :3, :3] = axes @ R @ hostile_chunks.random_rotations(rng, 1, TURNED)[0]
        fingers = [np.tile(q, (hostile_chunks.STEPS, 1)) for q in (stance.q_lhand, stance.q_rhand)]
        return ActionChunk("wbc32", seq, time, hostile_chunks.FPS, T[0], T[1], *fingers)

    return walked(supervisor, plant, np.random.default_rng((7, seed)), chunk, (edge, "pelvis", velocity), until, rides)


def hostile_walk(supervisor, plant, seed, until=6.5, *, rides=False):
    """Lead a robot by the chunks of a seed until a time [s], or a fall."""
    n, m = len(KINDS), len(FRAMES)
    kind, frame, velocity = (
        KINDS[seed % n],
        FRAMES[seed // n % m],
        VELOCITIES[(seed // (n * m) + seed) % len(VELOCITIES)],
    )

    def chunk(rng, seq, time):
        return hostile_chunks.hostile_chunk(kind, rng, seq, time)

    return walked(supervisor, plant, np.random.default_rng(seed), chunk, (kind, frame, velocity), until, rides)


def walked(supervisor, plant, rng, made, case, until, rides):
    """Lead a robot by chunks of a kind, a frame and a velocity until a time [s], or a fall.

    Args:
        made: Makes a chunk of a generator, its number and the time of its observation.
        case: Kind, frame and velocity.
        rides: Whether somebody else tells the velocity, as long as chunks come.
    """
    kind, frame, velocity = case
    state, dt = plant.reset(), plant.control_dt
    supervisor.reset(state)
    fall, walked, reasons, off, sent, due = None, 0.0, {}, 0.0, 0, FIRST + AGAIN
    while state.time < until and fall is None:
        if sent < CHUNKS and state.time >= FIRST + sent * APART - 1e-9:
            chunk = made(rng, sent, state.time)
            speeds = None if rides else np.tile(velocity, (len(chunk), 1))
            supervisor.accept(replace(chunk, base_velocity=speeds, hands_in=frame))
            sent += 1
        if rides and due <= state.time < FIRST + CHUNKS * APART:
            supervisor.walk(velocity)
            due += AGAIN
        state = plant.step(supervisor.step(state))
        if supervisor.state is State.WALKING:
            walked += dt
            reason = supervisor.status.reason or "none"
            reasons[reason] = reasons.get(reason, 0.0) + dt
            led = [supervisor.palm_reference()[side][:3, 3] for side in ("left", "right")]
            there = supervisor.controller.palm_positions()
            off = max(off, float(np.linalg.norm(led - there, axis=1).max()))
        fall = detect_fall(plant, state, supervisor.status.status)
    return HostileWalk(kind, frame, velocity, fall, walked, reasons, off, supervisor.state)
