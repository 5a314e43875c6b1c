"""Strategy: the one test with a real thread and real time. Everything else about executors runs on simulated clocks."""

import threading
from time import perf_counter, sleep

import pytest

from policy.clock import MonotonicClock
from policy.executor.executor import Executor, ExecutorConfig
from policy.scripted.library import scripted_policy
from tests.support.faulty_policies import FaultyPolicy
from tests.support.policy_cases import observation

pytestmark = pytest.mark.alone

THINKS, HANGS = 0.3, 1.0
"""How long a call takes, and how long the one takes that hangs [s]."""


class Thinking(FaultyPolicy):
    """Sleeps in every call, long in the second one; dies in the fifth."""

    def reset(self, task=""):
        super().reset(task)
        self.calls, self.threads = 0, set()

    def infer(self, observation):
        self.calls += 1
        self.threads.add(threading.current_thread().name)
        sleep(HANGS if self.calls == 2 else THINKS)
        if self.calls == 5:
            raise SystemExit
        return self.policy.infer(observation)


def test_a_policy_thinks_in_a_thread_of_its_own_and_the_control_loop_never_waits():
    clock, policy = MonotonicClock(), Thinking(scripted_policy("wave"), "", float("inf"))
    executor = Executor(policy, clock, config=ExecutorConfig(replace_every=5, hang_after=0.6))
    observation()  # imports what the first one needs
    executor.reset()
    polls, got = [], []
    while clock.now() < 10.0 and not executor.report.counts["policy_dead"]:
        before = perf_counter()
        chunk = executor.poll(lambda: observation(clock.now()))
        polls.append(perf_counter() - before)
        if chunk is not None:
            got.append(chunk)
        sleep(0.002)
    executor.close()
    assert policy.threads == {"policy"}
    # Five polls that waited for an answer would have taken `THINKS`; one is let off for a busy machine.
    assert sum(duration > 0.5 * THINKS for duration in polls) <= 1
    assert len(polls) > 100
    assert [chunk.seq for chunk in got] == [0, 1, 2, 3]
    latencies = executor.report.latencies
    assert latencies.min() >= THINKS
    assert latencies[1] >= HANGS
    assert executor.report.counts["policy_hung"] == 1
    assert executor.report.events[-1].detail.startswith("SystemExit")
