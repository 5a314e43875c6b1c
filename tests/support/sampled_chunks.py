"""Sets of chunks as a policy that samples answers them: one intention, scattered as samples of flow matching are.

Numbers are drawn before anything is tried on them; another thousand of numbers is another draw.
"""

import numpy as np

from policy.scripted.policy import minimum_jerk
from tests.support.stranger_chunks import sent

SAMPLES, STEPS, FPS = 16, 50, 30.0
SCATTER, TURN, TIME, WIGGLE = 0.05, 0.15, 0.15, 0.004
"""Standard deviations of where a hand is to go [m], how it is turned [rad], of the logarithm of the time that it takes,
and of a slow wave on the way [m]."""


def sampled_set(number, samples=SAMPLES):
    """So many chunks that begin in the stance, near one goal of both hands: many near the end of what can be done."""
    rng = np.random.default_rng((41, number))
    goals = np.array(
        [[rng.uniform(0.1, 0.5), sign * rng.uniform(0.0, 0.45), rng.uniform(0.4, 1.4)] for sign in (1, -1)]
    )
    turns = 0.3 * rng.normal(size=(2, 3))
    time, end = rng.uniform(0.7, 1.6), rng.choice([1.0, 1.0, 0.7])
    return [_sample(rng, goals, turns, time, end) for _ in range(samples)]


def _sample(rng, goals, turns, time, end):
    goals = goals + SCATTER * rng.normal(size=(2, 3))
    turns = turns + TURN * rng.normal(size=(2, 3))
    t = np.arange(STEPS) / FPS
    share = minimum_jerk(end * t / (time * np.exp(TIME * rng.normal())))
    chunk = sent(goals, list(turns), share, FPS)
    for T in (chunk.T_world_lhand, chunk.T_world_rhand):
        phase, waves = rng.uniform(0.0, 2.0 * np.pi, 3), rng.uniform(0.5, 1.5, 3)
        wave = np.sin(2.0 * np.pi * t[:, None] * waves + phase) - np.sin(phase)
        T[:, :3, 3] += WIGGLE * share[:, None] * wave
    return chunk
