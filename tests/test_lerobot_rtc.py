"""Real-time chunking as LeRobot 0.6.1 times it, and as the executor does: a chunk belongs to its observation's time."""

import numpy as np
import torch
from lerobot.policies.rtc import ActionQueue, RTCConfig
from lerobot.policies.rtc.latency_tracker import LatencyTracker
from test_executor import Continuing, run, started

from policy.executor import ExecutorConfig

LATENCY, FPS = 0.2, 30.0


def test_lerobot_drops_as_many_steps_as_it_guesses_and_here_the_clock_says_which_are_over():
    """A loop that ran slowly has executed 2 steps in 0.2 s; LeRobot drops 6, and the robot jumps over 4."""
    steps = torch.arange(50.0)[:, None]
    queue = ActionQueue(RTCConfig(enabled=True))
    queue.merge(steps, steps, real_delay=0, action_index_before_inference=0)
    before = [float(queue.get()) for _ in range(2)]
    queue.merge(steps, steps, real_delay=round(LATENCY * FPS), action_index_before_inference=0)
    assert before == [0.0, 1.0]
    assert float(queue.get()) == 6.0

    policy = Continuing()
    runner = started(policy, latency=LATENCY, config=ExecutorConfig(real_time=True))
    chunks = run(runner, 1.5)
    assert len(chunks) >= 2
    observed = [0.0, *(seen.time for seen, _ in policy.prefixes)]
    for (arrival, chunk), t_obs in zip(chunks, observed, strict=False):
        assert chunk.times[0] == chunk.t_obs == t_obs
        # What a step is meant for does not depend on when its chunk came.
        np.testing.assert_allclose(np.interp(arrival, chunk.times, np.arange(50)), FPS * LATENCY, atol=0.2)


def test_lerobot_never_forgets_a_slow_first_call_and_the_executor_does():
    tracker = LatencyTracker(maxlen=3)
    for latency in (1.2, 0.1, 0.1, 0.1, 0.1):
        tracker.add(latency)
    assert tracker.max() == 1.2

    policy, durations = Continuing(), [1.2]
    config = ExecutorConfig(real_time=True, delay_window=3, execution_horizon=30, hang_after=5.0)
    runner = started(policy, latency=lambda: durations.pop() if durations else 0.1, config=config)
    run(runner, 8.0)
    assert policy.prefixes[-1][1].inference_delay == 3
