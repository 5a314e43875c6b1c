"""Hostile chunks that say a base velocity: families of hands, frames that they are in, and velocities, by the seed."""

from dataclasses import dataclass, replace
from math import prod

import numpy as np

from tests.support import hostile_chunks
from wholebody.execution.states import State
from wholebody.sim.fall import detect_fall

KINDS = tuple(kind for kind in hostile_chunks.FAMILIES if kind not in ("nan", "fingers"))
FRAMES = ("pelvis", "world", "stance")
VELOCITIES = ((0.4, 0.0, 0.0), (-0.25, 0.0, 0.0), (0.0, 0.15, 0.0), (0.0, 0.0, 0.5), (0.3, 0.0, 0.3))
CASES = prod(map(len, (KINDS, FRAMES, VELOCITIES)))
"""Seeds from which on the same kind, frame and velocity come again, with other numbers."""
FIRST, APART, CHUNKS = 0.2, 1.0, 4
"""Time of the first chunk, from one to the next [s], and how many come."""


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


def hostile_walk(supervisor, plant, seed, until=6.5):
    """Lead a robot by the chunks of a seed until a time [s], or a fall."""
    n, m = len(KINDS), len(FRAMES)
    kind, frame, velocity = (
        KINDS[seed % n],
        FRAMES[seed // n % m],
        VELOCITIES[(seed // (n * m) + seed) % len(VELOCITIES)],
    )
    rng, state, dt = np.random.default_rng(seed), plant.reset(), plant.control_dt
    supervisor.reset(state)
    fall, walked, reasons, off, sent = None, 0.0, {}, 0.0, 0
    while state.time < until and fall is None:
        if sent < CHUNKS and state.time >= FIRST + sent * APART - 1e-9:
            chunk = hostile_chunks.hostile_chunk(kind, rng, sent, state.time)
            speeds = np.tile(velocity, (len(chunk), 1))
            supervisor.accept(replace(chunk, base_velocity=speeds, hands_in=frame))
            sent += 1
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
