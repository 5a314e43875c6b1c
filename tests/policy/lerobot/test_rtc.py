"""Real-time chunking as LeRobot 0.6.1 times it, and as the executor does: a chunk belongs to its observation's time."""

import numpy as np
import pytest
import torch
from lerobot.policies.rtc import ActionQueue, RTCConfig
from lerobot.policies.rtc.latency_tracker import LatencyTracker

from policy.action_spec.anchor import Anchor
from policy.action_spec.codec import encode
from policy.executor.executor import ExecutorConfig
from policy.lerobot.policy import RealTimeLeRobotPolicy
from policy.prefix import Prefix, PrefixPolicy
from tests.support import tiny_policies as tiny
from tests.support.executor_cases import Continuing, run, started
from wholebody.cli.sources import open_source

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


def test_real_time_chunking_continues_what_is_executed(tmp_path_factory):
    folder = tiny.saved("pi05", tmp_path_factory)
    policy, plain = tiny.load(folder, rtc=True, seed=0, clamp=1.0), tiny.load(folder, seed=0, clamp=1.0)
    assert isinstance(policy, RealTimeLeRobotPolicy | PrefixPolicy)
    assert not isinstance(plain, PrefixPolicy)
    seen = tiny.observation()
    anchor = Anchor.measured(seen)
    executed = plain.infer(seen)
    policy.infer(seen)
    answer = policy.infer_after(tiny.observation(0.1), Prefix(executed, 50, 8, 20))
    free = plain.infer(tiny.observation(0.1))
    before, with_prefix, without = (encode(policy.spec, chunk, anchor)[:8] for chunk in (executed, answer, free))
    # Guidance pulls the first steps towards the prefix; a random network cannot be pulled all the way.
    assert np.abs(with_prefix - before).mean() < 0.5 * np.abs(without - before).mean()


def test_lerobots_select_action_does_not_work_with_real_time_chunking(tmp_path_factory):
    """Trap 16; the chunks of `predict_action_chunk` are what we use."""
    policy = tiny.load(tiny.saved("pi05", tmp_path_factory), rtc=True)
    with pytest.raises(AssertionError, match="RTC is not supported"):
        policy.checkpoint.network.select_action({})


@pytest.mark.parametrize("kind", ["pi0", "smolvla"])
def test_the_other_flow_policies_take_a_prefix_too(kind, tmp_path_factory):
    policy = tiny.load(tiny.saved(kind, tmp_path_factory), rtc=True, seed=0, clamp=1.0)
    executed = policy.infer(tiny.observation())
    assert len(policy.infer_after(tiny.observation(0.1), Prefix(executed, 50, 4, 10))) == 50


def test_the_command_line_can_ask_a_checkpoint_for_real_time_chunking(tmp_path_factory):
    with tiny.tiny_backbones():
        policy = open_source(str(tiny.saved("pi05", tmp_path_factory)), 60.0, None, "wave", rtc=True, num_steps=3)
    assert isinstance(policy, PrefixPolicy)
    assert policy.checkpoint.network.config.num_inference_steps == 3
