"""Strategy: a real thread, which waits where the test says so, on a simulated clock: nothing depends on the machine."""

import threading

import pytest

from policy.clock import SimulatedClock
from policy.executor.executor import Executor, ExecutorConfig
from policy.scripted.library import scripted_policy
from tests.support.faulty_policies import FaultyPolicy
from tests.support.policy_cases import observation

THINKS, HANGS = 0.3, 1.0
"""How long a call takes, and how long the one takes that hangs [s]."""
PERIOD = 0.002
"""Between two polls [s]."""


class Thinking(FaultyPolicy):
    """Computes in every call until it is let go; dies in the fifth."""

    def reset(self, task=""):
        super().reset(task)
        self.calls, self.threads = 0, set()
        self.asked, self.go = threading.Semaphore(0), threading.Semaphore(0)

    def infer(self, observation):
        self.calls += 1
        self.threads.add(threading.current_thread().name)
        self.asked.release()
        self.go.acquire()
        if self.calls == 5:
            raise SystemExit
        return self.policy.infer(observation)


def test_a_policy_thinks_in_a_thread_of_its_own_and_the_control_loop_never_waits():
    clock, policy = SimulatedClock(), Thinking(scripted_policy("wave"), "", float("inf"))
    policy.reset()
    policy.reset = lambda task="": None
    executor = Executor(policy, clock, config=ExecutorConfig(replace_every=5, hang_after=0.6))
    executor.reset()
    got, observed = [], []

    def look():
        observed.append(clock.now())
        return observation(clock.now())

    def passed(seconds):
        """Poll for so long; a poll that waited for the policy would never come back: nobody lets it go."""
        for _ in range(round(seconds / PERIOD)):
            clock.set(clock.now() + PERIOD)
            assert executor.poll(look) is None

    for call in range(1, 6):
        while len(observed) < call:
            clock.set(clock.now() + PERIOD)
            assert executor.poll(look) is None
        policy.asked.acquire()
        passed(HANGS if call == 2 else THINKS)
        policy.go.release()
        chunk = None
        while chunk is None and not executor.report.counts["policy_dead"]:
            chunk = executor.poll(look)
        got.append(chunk)
    executor.close()
    assert policy.threads == {"policy"}
    assert [None if chunk is None else chunk.seq for chunk in got] == [0, 1, 2, 3, None]
    assert executor.report.latencies == pytest.approx([THINKS, HANGS, THINKS, THINKS], abs=PERIOD)
    assert executor.report.counts["policy_hung"] == 1
    assert executor.report.events[-1].detail.startswith("SystemExit")
