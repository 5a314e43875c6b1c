"""Executors on a simulated clock, polled as a control loop does, and a policy that takes prefixes."""

import numpy as np

from policy.executor.simulated import simulated_executor
from policy.scripted.library import scripted_policy
from tests.support.policy_cases import observation

TICK = 0.002
"""Control period [s]."""


def run(executor, seconds, *, start=0.0):
    """Poll as a control loop does; (time, chunk) of everything that was handed out."""
    got = []
    for time in start + TICK * np.arange(round(seconds / TICK)):
        executor.clock.set(max(time, executor.clock.now()))
        chunk = executor.poll(lambda: observation(executor.clock.now()))
        if chunk is not None:
            got.append((float(executor.clock.now()), chunk))
    return got


def started(policy, **settings):
    made = simulated_executor(policy, **settings)
    made.reset()
    return made


class Continuing:
    """A scripted policy that notes the prefixes that it is given."""

    sees_robot = False

    def __init__(self):
        self.policy = scripted_policy("wave")
        self.spec, self.prefixes = self.policy.spec, []

    def reset(self, task=""):
        self.policy.reset(task)

    def infer(self, observation):
        return self.policy.infer(observation)

    def infer_after(self, observation, prefix):
        self.prefixes.append((observation, prefix))
        return self.policy.infer(observation)
