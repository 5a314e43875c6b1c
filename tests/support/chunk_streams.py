"""Streams of chunks: a target that stays, and a minute of hostile, calm, late, lost and doubled chunks.

``python -m tests.studies.streams`` prints the table of both.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from policy.scripted.policy import ScriptedMotion, stance_pose, to_chunk
from tests.support.hostile_chunks import FAMILIES, FPS, STEPS, hostile_chunk
from wholebody.sim.fall import detect_fall

SETTLE = 1.0
"""Standing before the first chunk [s]."""
THERE = 5e-3
"""Distance of a palm at which it is there [m]."""
FAR = {
    "forward": np.array([0.25, 0.0, 0.3375]),
    "up": np.array([0.1, 0.0, 0.408]),
    "down": np.array([0.15, 0.0, -0.392]),
    "aside": np.array([0.1, 0.2, 0.356]),
}
"""Ways of 0.42 m of the left palm from the stance; mirrored for the right one [m]."""
MIRROR = np.array([1.0, -1.0, 1.0])
CALM_LOW, CALM_HIGH = np.array([0.22, 0.14, 0.70]), np.array([0.38, 0.28, 1.10])
"""Box of the left palm's targets that stay; mirrored for the right one [m]."""
HOSTILE_SECONDS, CALM_SECONDS, JUDGED_AFTER = (2.0, 5.0), 4.0, 3.0
"""How long a stream is hostile, how long calm, and from when on it is to be at the calm target [s]."""
RATE, LATE_MAX = (2.0, 10.0), 0.3
"""Least and most chunks a second [Hz], and how late the latest comes [s]."""


def still_chunk(palm, seq, time):
    """Both palms at one place, the right one mirrored, turned as in the stance."""
    s = stance_pose()
    palms = [np.tile(p, (STEPS, 1)) for p in (palm, palm * MIRROR)]
    motion = ScriptedMotion(*palms, s.R_world_lhand, s.R_world_rhand, s.q_lhand, s.q_rhand)
    return to_chunk(motion, "wbc32", seq, time, FPS, STEPS)


class Stream:
    """A supervisor and a plant that stand, and take what comes."""

    def __init__(self, supervisor, plant):
        self.supervisor, self.plant, self.fall = supervisor, plant, None
        self.state = plant.reset()
        supervisor.reset(self.state)
        while self.state.time < SETTLE - 1e-9:
            self.tick()

    def tick(self):
        """One control period."""
        self.state = self.plant.step(self.supervisor.step(self.state))
        self.fall = self.fall or detect_fall(self.plant, self.state, self.supervisor.status.status)

    def off(self, palm):
        """How far the farther palm is from a target [m]."""
        palms = self.supervisor.controller.palm_positions()
        return float(np.linalg.norm(palms - np.stack([palm, palm * MIRROR]), axis=1).max())


def time_to_reach(supervisor, plant, way, every, *, until=6.0):
    """Time from the first chunk until both palms are there to stay [s]; infinite if they are not in time.

    Args:
        supervisor: Has the plans made beside the loop.
        plant: The robot.
        way: From the stance to the target (3,) [m].
        every: Time between two chunks [s].
        until: How long it is tried [s].
    """
    stream, seq, there = Stream(supervisor, plant), 0, np.inf
    target = stance_pose().p_world_lpalm + way
    while stream.state.time < SETTLE + until and stream.fall is None:
        if stream.state.time >= SETTLE + seq * every - 1e-9:
            supervisor.accept(still_chunk(target, seq, stream.state.time), stream.state.time)
            seq += 1
        stream.tick()
        there = min(there, stream.state.time - SETTLE) if stream.off(target) <= THERE else np.inf
    return np.inf if stream.fall else there


@dataclass
class MixedResult:
    """What became of a mixed stream.

    Attributes:
        rate: Chunks a second [Hz].
        fall: The fall, or None.
        calm: Largest distance of a palm from each calm target from `JUDGED_AFTER` on [m].
        kinds: What was sent before each of them.
        lost, late, doubled: Chunks that were.
    """

    rate: float
    fall: object = None
    calm: list = field(default_factory=list)
    kinds: list = field(default_factory=list)
    sent: int = 0
    lost: int = 0
    late: int = 0
    doubled: int = 0

    def __str__(self):
        worst = max(self.calm, default=np.inf)
        fell = f"FELL at {self.fall.time:.2f} s: {self.fall.cause}" if self.fall else "stands"
        missed = [f"{kind} {1e3 * x:.1f}" for kind, x in zip(self.kinds, self.calm, strict=False) if x > THERE]
        return (
            f"{self.rate:.1f} Hz, {self.sent} sent, lost {self.lost}, late {self.late}, twice {self.doubled}: {fell}, "
            f"{len(self.calm)} calm, worst {1e3 * worst:.2f} mm {' '.join(missed)}"
        )


class MixedStream(Stream):
    """Hostile and calm chunks in turns, of which some are late, lost or sent twice."""

    def __init__(self, supervisor, plant, seed):
        super().__init__(supervisor, plant)
        self.rng = np.random.default_rng(20_000 + seed)
        self.result = MixedResult(float(self.rng.uniform(*RATE)))
        self.seq, self.under_way = 0, []

    def run(self, seconds=60.0):
        """The result of so many seconds."""
        end = SETTLE + seconds
        while self.state.time < end and self.fall is None:
            kind = str(self.rng.choice(list(FAMILIES)))
            self.send(lambda kind=kind: hostile_chunk(kind, self.rng, self.seq, self.state.time), self.hostile_time())
            target, worst = self.rng.uniform(CALM_LOW, CALM_HIGH), []
            from_ = self.state.time + JUDGED_AFTER
            off = lambda target=target, worst=worst, from_=from_: (  # noqa: E731
                worst.append(self.off(target)) if self.state.time >= from_ else None
            )
            self.send(lambda target=target: still_chunk(target, self.seq, self.state.time), CALM_SECONDS, off)
            if worst and self.fall is None:
                self.result.calm.append(max(worst))
                self.result.kinds.append(kind)
        self.result.fall = self.fall
        return self.result

    def hostile_time(self):
        return self.rng.uniform(*HOSTILE_SECONDS)

    def send(self, make, seconds, look=None):
        """Chunks for so long; ``look`` is called every tick."""
        result, rng, end, due = self.result, self.rng, self.state.time + seconds, self.state.time
        while self.state.time < end and self.fall is None:
            if self.state.time >= due - 1e-9:
                due += 1.0 / result.rate
                chunk, fate = make(), rng.uniform()
                self.seq, result.sent = self.seq + 1, result.sent + 1
                result.lost += fate < 0.1
                result.late += 0.1 <= fate < 0.3
                result.doubled += fate >= 0.9
                wait = rng.uniform(0.0, LATE_MAX) if 0.1 <= fate < 0.3 else 0.0
                if fate >= 0.1:
                    self.under_way.append((self.state.time + wait, chunk))
                if fate >= 0.9:
                    self.under_way.append((self.state.time + wait + rng.uniform(0.0, 0.1), replace(chunk)))
            arrived = [one for one in self.under_way if one[0] <= self.state.time]
            self.under_way = [one for one in self.under_way if one[0] > self.state.time]
            for _, chunk in sorted(arrived, key=lambda one: one[0]):
                self.supervisor.accept(chunk, self.state.time)
            self.tick()
            self.supervisor.take_refusal()
            if look is not None:
                look()
