"""Strategy: executors on a simulated clock, polled every 2 ms like a control loop, with scripts of known latency.

What a policy does wrong must come out as an event and never as a chunk; the one test with a real thread is
`test_worker.py`.
"""

import dataclasses
import logging
from itertools import pairwise

import numpy as np
import pytest

from policy.clock import SimulatedClock
from policy.errors import PolicyError
from policy.executor.executor import Executor, ExecutorConfig
from policy.executor.simulated import SimulatedWorker, simulated_executor, uniform_latency
from policy.scripted.library import scripted_policy
from tests.support.executor_cases import TICK, Continuing, run, started
from tests.support.faulty_policies import FAULTS, FaultyPolicy, executor
from tests.support.policy_cases import observation


def codes(executor):
    return set(executor.report.counts)


def test_without_latency_chunks_come_at_once_and_every_25_steps():
    runner = started(scripted_policy("wave"))
    got = run(runner, 3.0)
    assert [chunk.seq for _, chunk in got] == [0, 1, 2, 3]
    assert [time for time, _ in got] == pytest.approx(25 / 30 * np.arange(4), abs=2 * TICK * 3)
    assert [chunk.t_obs for _, chunk in got] == [time for time, _ in got]
    assert runner.report.waited == 0.0


def test_a_late_chunk_keeps_the_time_of_its_observation_and_its_latency_is_measured():
    runner = started(scripted_policy("wave"), latency=0.2)
    got = run(runner, 2.0)
    assert [time - chunk.t_obs for time, chunk in got] == pytest.approx([0.2] * len(got), abs=TICK)
    assert runner.report.latencies == pytest.approx([0.2] * len(got))
    assert [delivery.skipped for delivery in runner.report.deliveries] == [6] * len(got)
    assert runner.report.waited == pytest.approx(0.2, abs=TICK)
    assert "200 ms median" in runner.report.summary()


def test_a_hastened_chunk_is_asked_for_at_once_and_only_one_at_a_time():
    runner = started(scripted_policy("wave"), latency=0.2)
    run(runner, 0.3)
    runner.hasten()
    run(runner, 0.1, start=0.3)
    runner.hasten()
    got = run(runner, 0.5, start=0.4)
    assert [chunk.t_obs for _, chunk in got] == pytest.approx([0.3, 0.5], abs=3 * TICK)


def test_no_more_is_asked_for_than_is_needed():
    runner = started(scripted_policy("wave"))
    asked = [runner.poll(lambda: observation(0.0), until=until) for until in (1.0, 1.0)]
    runner.clock.set(1.2)
    later = [runner.poll(lambda: observation(1.2), until=until) for until in (49 / 30.0, 49 / 30.0 + 0.1)]
    assert [chunk is not None for chunk in (*asked, *later)] == [True, False, False, True]


def test_chunks_with_random_latency_below_half_their_length_never_starve():
    runner = started(scripted_policy("wave"), latency=uniform_latency(0.0, 0.4, seed=3))
    run(runner, 10.0)
    assert runner.report.starvations == 0
    assert 0.0 < runner.report.latencies.min() < runner.report.latencies.max() < 0.4
    assert not runner.report.events


def test_the_same_seed_gives_the_same_latencies_and_equal_bounds_a_constant():
    draws = [[latency() for _ in range(5)] for latency in (uniform_latency(0.0, 0.4, seed=1),) * 2]
    again = uniform_latency(0.0, 0.4, seed=1)
    assert draws[0] == [again() for _ in range(5)]
    assert uniform_latency(0.1, 0.1)() == 0.1
    for low, high in ((-0.1, 0.1), (0.2, 0.1), (float("nan"), 1.0)):
        with pytest.raises(ValueError, match="0 <= low <= high"):
            uniform_latency(low, high)


def test_a_policy_that_is_too_slow_starves_the_loop_and_the_starved_time_is_counted():
    runner = started(scripted_policy("wave"), latency=2.0, config=ExecutorConfig(hang_after=5.0))
    run(runner, 6.0)
    # Asked at 0, there at 2.0, over already; a chunk is 1.63 s long.
    assert runner.report.deliveries == []
    assert runner.report.counts["chunk_stale"] == 2
    slow = started(scripted_policy("wave"), latency=1.0, config=ExecutorConfig(hang_after=5.0))
    run(slow, 6.0)
    # Each is used from 1.0 to 1.633 s of its age, and the next is asked for as soon as it comes.
    assert slow.report.starvations >= 3
    assert slow.report.starved == pytest.approx(6.0 - 1.0 - 5 * 0.6333, abs=0.7)


def test_an_observation_that_is_too_old_makes_its_chunk_stale():
    runner = started(scripted_policy("wave"), latency=0.3, config=ExecutorConfig(age_max=0.25))
    assert run(runner, 2.0) == []
    assert runner.report.events[0].code == "chunk_stale"
    assert "0.300 s old" in runner.report.events[0].detail
    assert "age_max 0.25" in runner.report.events[0].detail


@pytest.mark.parametrize(("fault", "code"), FAULTS.items())
def test_every_fault_is_reported_and_no_chunk_comes_of_it(fault, code):
    runner = executor(FaultyPolicy(scripted_policy("wave"), fault, 0.5, latency=0.1))
    runner.reset()
    got = run(runner, 6.0)
    assert code in codes(runner)
    good = [chunk for _, chunk in got if chunk.t_obs < 0.5]
    assert len(good) == 1
    for _, chunk in got:
        chunk.validate()
    late = [chunk for _, chunk in got if chunk.t_obs >= 0.5]
    assert bool(late) == (fault == "hangs 2 s"), "what has only hung goes on"
    assert runner.report.starvations == 1


def test_a_hang_is_reported_while_it_lasts_and_what_it_answers_then_is_stale():
    runner = executor(FaultyPolicy(scripted_policy("wave"), "hangs 2 s", 0.5))
    runner.reset()
    run(runner, 1.5)
    assert codes(runner) == set()
    run(runner, 0.4, start=1.5)
    assert codes(runner) == {"policy_hung", "starved"}
    hung = next(event for event in runner.report.events if event.code == "policy_hung")
    assert hung.time == pytest.approx(25 / 30 + 1.0, abs=2 * TICK)
    run(runner, 2.0, start=1.9)
    assert runner.report.counts["chunk_stale"] == 1
    assert runner.running.t_obs > 2.8


def test_a_dead_policy_is_not_asked_again_until_a_reset():
    policy = FaultyPolicy(scripted_policy("wave"), "dies", 0.5)
    runner = executor(policy)
    runner.reset()
    run(runner, 5.0)
    assert runner.report.counts["policy_dead"] == 1
    policy.at = np.inf
    runner.clock.restart(0.0)
    runner.reset()
    assert len(run(runner, 1.0)) == 2


def test_a_policy_that_raises_is_asked_again_after_a_pause_and_logged_once(caplog):
    runner = executor(FaultyPolicy(scripted_policy("wave"), "raises", 0.0), config=ExecutorConfig(retry_after=0.5))
    runner.reset()
    with caplog.at_level(logging.WARNING, logger="policy.executor.executor"):
        run(runner, 2.0)
    assert runner.report.counts["policy_raised"] == 4
    assert [record.getMessage() for record in caplog.records] == ["0.000 s: policy_raised: RuntimeError: out of memory"]


def test_after_a_recovery_the_next_failure_is_logged_again(caplog):
    policy = FaultyPolicy(scripted_policy("wave"), "raises", 0.5)
    runner = executor(policy)
    runner.reset()
    with caplog.at_level(logging.WARNING, logger="policy.executor.executor"):
        run(runner, 1.0)
        policy.at = np.inf
        run(runner, 1.0, start=1.0)
        policy.at = 0.0
        run(runner, 1.5, start=2.0)
    assert sum("policy_raised" in record.getMessage() for record in caplog.records) == 2


def test_a_chunk_that_was_asked_for_before_a_reset_is_refused_after_it():
    runner = started(scripted_policy("wave"), latency=0.3)
    run(runner, 0.1)
    runner.reset()
    got = run(runner, 1.0, start=0.1)
    assert runner.report.counts["chunk_from_before_reset"] == 1
    assert got[0][1].seq == 0
    assert got[0][1].t_obs == pytest.approx(0.1)


def test_a_chunk_that_the_controller_refuses_leaves_the_one_before_running():
    runner = started(scripted_policy("wave"))
    first, second = (chunk for _, chunk in run(runner, 1.0))
    assert runner.running is second
    runner.refused("planning_failed", "no plan")
    assert runner.running is first
    assert runner.report.counts["planning_failed"] == 1
    assert len(runner.report.deliveries) == 1
    third = run(runner, 1.0, start=1.0)[0]
    assert third[0] == pytest.approx(1.0 + ExecutorConfig().retry_after, abs=2 * TICK)
    assert third[1].seq == 2


def test_the_task_reaches_the_policy_with_the_reset():
    policy = scripted_policy("wave")
    tasks = []
    policy.reset = tasks.append
    simulated_executor(policy).reset("wave hello")
    assert tasks == ["wave hello"]


def test_a_simulated_worker_without_latency_takes_as_long_as_the_computation():
    clock = SimulatedClock()
    policy = scripted_policy("wave")
    policy.reset()
    worker = SimulatedWorker(policy, clock)
    runner = Executor(policy, clock, worker=worker)
    runner.reset()
    assert runner.poll(lambda: observation(0.0)) is None
    clock.set(5.0)
    runner.poll(lambda: observation(5.0))
    assert codes(runner) == {"chunk_stale", "policy_hung"}
    runner.close()
    assert worker.poll() is None


def test_a_negative_latency_is_refused():
    with pytest.raises(ValueError, match=r"latency from -0.1 s"):
        simulated_executor(scripted_policy("wave"), latency=-0.1)


@pytest.mark.parametrize(
    "settings", [{"replace_every": 0}, {"hang_after": float("nan")}, {"age_max": -1.0}, {"execution_horizon": 0}]
)
def test_settings_that_make_no_sense_are_refused(settings):
    with pytest.raises(ValueError, match=next(iter(settings))):
        ExecutorConfig(**settings)


def test_real_time_chunking_is_refused_for_a_policy_that_cannot_continue_a_prefix():
    with pytest.raises(PolicyError, match=r"infer_after.*ScriptedPolicy has none.*ensemble"):
        simulated_executor(scripted_policy("wave"), config=ExecutorConfig(real_time=True))


def test_real_time_chunking_passes_what_is_executed_from_the_observation_on_and_the_expected_delay():
    policy = Continuing()
    runner = started(policy, latency=0.2, config=ExecutorConfig(real_time=True))
    run(runner, 1.5)
    (seen, prefix), *_ = policy.prefixes
    assert prefix.executed.t_obs == seen.time
    assert prefix.inference_delay == 6  # 0.2 s at 30 Hz
    assert prefix.execution_horizon == 11
    assert prefix.steps == 24  # from 0.834 s to the last step at 1.633 s
    wanted = scripted_policy("wave").script(prefix.executed.times)
    left = prefix.executed.T_world_lhand[: prefix.steps, :3, :3]
    np.testing.assert_allclose(left, wanted.R_world_lhand[: prefix.steps], atol=1e-3)


def test_real_time_chunking_asks_the_controller_what_it_really_executes():
    policy, asked = Continuing(), []
    runner = started(policy, config=ExecutorConfig(real_time=True))
    for time in TICK * np.arange(600):
        runner.clock.set(time)

        def executing(t_obs, steps, fps):
            asked.append((t_obs, steps, fps))
            return dataclasses.replace(runner.running, t_obs=t_obs)

        runner.poll(lambda: observation(runner.clock.now()), executing)
    assert len(asked) == len(policy.prefixes) == 1
    assert asked[0][1:] == (50, 30.0)


def test_a_slow_first_call_is_forgotten_by_the_expected_delay():
    policy, durations = Continuing(), [1.2]
    config = ExecutorConfig(real_time=True, delay_window=3, execution_horizon=30, hang_after=5.0)
    runner = started(policy, latency=lambda: durations.pop() if durations else 0.1, config=config)
    run(runner, 8.0)
    delays = [prefix.inference_delay for _, prefix in policy.prefixes]
    # At first the expected delay is cut to the steps that are left of the running chunk.
    assert delays[0] > 10
    assert delays[-1] == 3


def test_the_prefix_of_a_slow_policy_lasts_until_its_chunk_arrives_and_beyond():
    policy = Continuing()
    runner = started(policy, latency=0.4, config=ExecutorConfig(real_time=True))
    run(runner, 1.5)
    (_, prefix), *_ = policy.prefixes
    assert (prefix.inference_delay, prefix.execution_horizon) == (12, 17)


@pytest.mark.parametrize("horizon", [3, 10, 20])
def test_5_a_policy_with_short_chunks_is_asked_before_they_are_over(horizon):
    """With 25 steps between questions, openpi servers of 10 or 20 steps starved the robot half of the time."""
    policy = scripted_policy("wave")
    policy.horizon = horizon
    runner = started(policy)
    got = run(runner, 3.0)
    assert runner.report.starved == 0.0
    assert np.diff([time for time, _ in got]) == pytest.approx((horizon // 2) / 30.0, abs=2 * TICK)


def test_5_what_the_policy_and_the_planner_take_is_counted_in():
    """Asked at half of 30 steps, an answer after 400 ms that is then planned for 120 ms would be 53 ms too late."""
    policy = scripted_policy("wave")
    policy.horizon = 30
    runner = started(policy, latency=0.4, config=ExecutorConfig(lead=0.12))
    got = run(runner, 5.0)
    assert runner.report.starved == 0.0
    spare = [before.times[-1] - time for (_, before), (time, _) in pairwise(got)]
    assert min(spare) >= 0.12 - 2 * TICK


def test_5_what_cannot_be_covered_is_counted_as_starved():
    policy = scripted_policy("wave")
    policy.horizon = 10
    runner = started(policy, latency=0.25)
    run(runner, 3.0)
    # A chunk is asked for when one comes; its 0.3 s begin then, and 0.25 s of them are over when it is there.
    assert runner.report.starvations >= 8
    assert runner.report.starved == pytest.approx(3.0 * 0.2 / 0.25, abs=0.3)
