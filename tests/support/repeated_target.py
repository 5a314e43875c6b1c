"""A policy that leads the hands to a place, and from then on repeats the numbers of that place."""

import numpy as np

from policy import Anchor, decode, encode, scripted_policy
from policy.scripted.policy import to_chunk
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.recorder import Recorder

ARRIVED = 3.5
"""When the numbers are taken, after a reach of 3 s [s]."""


class RepeatedTarget:
    """Reaches low ahead in world; then says the same numbers of a layout, decoded at each observation.

    Attributes:
        spec: The layout.
        numbers: What is repeated, shape (A,), once it is there.
    """

    name, sees_robot, duration = "repeated", True, 1e6

    def __init__(self, spec, *, x=0.40, z=0.30, horizon=50):
        self.spec, self.horizon = spec.with_free_orientation(), horizon
        self.script = scripted_policy("reach", x=x, z=z).script
        self.reset()

    def reset(self, task=""):
        self.numbers, self.begin, self.seq = None, None, -1

    def infer(self, observation):
        self.begin = observation.time if self.begin is None else self.begin
        self.seq += 1
        anchor, elapsed = Anchor.measured(observation), observation.time - self.begin
        motion = self.script(elapsed + np.arange(self.horizon) / 30.0)
        chunk = to_chunk(motion, self.spec.id, self.seq, observation.time, 30.0, self.horizon)
        if elapsed < ARRIVED:
            return chunk
        if self.numbers is None:
            self.numbers = encode(self.spec, chunk, anchor)[0]
        rows = np.tile(self.numbers, (self.horizon, 1))
        return decode(self.spec, rows, anchor, seq=self.seq, t_obs=observation.time)


def drift(spec, supervisor: Supervisor, plant, *, held, every=12, x=0.40, z=0.30):
    """Result of an episode, and how far the true palms are from where the numbers were taken.

    Args:
        spec: Layout of the numbers.
        supervisor, plant: Of the robot.
        held: How long the target is repeated [s].
        every: Steps of a chunk after which the next one is asked for.
        x, z: Place of the palms [m].

    Returns:
        The result; times after the numbers were taken, shape (n,), [s]; largest distance of a palm, shape (n,), [m].
    """
    recorder = Recorder(plant.spec)
    config = EpisodeConfig(settle=1.0, hold=0.0, replace_every=every)
    policy = RepeatedTarget(spec, x=x, z=z)
    result = run_episode(policy, supervisor, plant, duration=ARRIVED + held, config=config, recorder=recorder)
    rows = recorder.arrays()
    times = rows["time"] - config.settle - ARRIVED
    palms = rows["T_world_palms_measured"][:, :, :3, 3]
    at = int(np.searchsorted(times, 0.0))
    return result, times[at:], np.linalg.norm(palms[at:] - palms[at], axis=-1).max(axis=-1)
