"""Strategy: a policy that is late, wrong or gone beside the real controller in MuJoCo; short episodes in every run, the
long ones behind `make regression` with stored values. What an executor does by itself is tested in `test_executor.py`.
"""

import dataclasses
import logging
import subprocess
import sys

import numpy as np
import pytest

from models import g1
from policy.clock import MonotonicClock
from policy.executor.executor import Executor, ExecutorConfig
from policy.executor.simulated import simulated_executor, uniform_latency
from policy.remote.client import RemotePolicy
from policy.scripted.library import scripted_policy, wave
from tests.support.faulty_loops import not_a_number, pitched
from tests.support.faulty_policies import FaultyPolicy, executor
from tests.support.watching_policy import Reaching
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Reason
from wholebody.verdict.verdict import verdict_of

SPEC = g1()
SEAM, SEAM_VELOCITY = 1e-3, 0.05
"""How far the commanded palms may jump where chunks meet [m], [m/s]."""
LATE = 3e-3
"""Tracking that may be lost to latency [m RMS]."""
TILT = np.deg2rad(10.0)
"""Largest tilt of a pelvis that stands [rad]."""
HEADLINES = {
    "hangs 2 s": "policy_hung",
    "raises": "policy_raised",
    "returns NaN": "chunk_invalid",
    "changes its spec": "chunk_wrong_spec",
    "dies": "policy_dead",
}


@pytest.fixture(scope="module")
def robot():
    return Supervisor(SPEC), MujocoPlant(SPEC)


def at_50_hz(policy, *, horizon=50):
    policy.fps, policy.horizon = 50.0, horizon
    return policy


def worst(result, field):
    return max(getattr(seam, field) for seam in result.seams)


@pytest.mark.parametrize("asks", [True, False])
def test_where_things_are_is_told_to_those_who_ask(robot, asks):
    policy = Reaching()
    policy.sees_objects = asks
    run_episode(policy, *robot, duration=0.1, config=EpisodeConfig(settle=0.1, hold=0.0))
    assert (policy.asked[0].objects is not None) == asks


def run_faulty(robot, fault, *, horizon, at, after, settings):
    """A fault from some time on, and how the robot stands that long after it [s]."""
    policy = FaultyPolicy(at_50_hz(scripted_policy("wave"), horizon=horizon), fault, at)
    runner = executor(policy, config=settings)
    result = run_episode(runner, *robot, duration=at + after, config=EpisodeConfig(settle=0.1, hold=0.0))
    return result, runner.report


@pytest.mark.parametrize("fault", [pitched(1.2), not_a_number], ids=["pitched by 69 deg", "not a number"])
def test_a_policy_that_is_asked_at_a_glitch_sees_the_state_that_the_controller_trusts(robot, fault):
    class Glitch:
        """A measurement that is wrong for one tick, when the policy is asked."""

        def reset(self):
            """Nothing is remembered."""

        def measure(self, state):
            return fault(state, state) if abs(state.time - 0.1) < 1e-6 else state

    policy, (supervisor, plant) = Reaching(), robot
    run_episode(policy, supervisor, plant, duration=0.1, config=EpisodeConfig(settle=0.1, hold=0.0), sensors=Glitch())
    seen = policy.asked[0]
    assert seen.time == pytest.approx(0.1)
    assert np.allclose(seen.T_world_base[:3, :3], np.eye(3), atol=0.01)
    assert np.allclose(seen.q_body, SPEC.stance.joints[:29], atol=0.01)


@pytest.mark.parametrize(("fault", "code"), HEADLINES.items())
def test_a_policy_that_fails_leaves_the_robot_standing_with_the_reason_logged(robot, fault, code, caplog):
    settings = ExecutorConfig(replace_every=10, hang_after=0.4)
    with caplog.at_level(logging.WARNING, logger="policy.executor.executor"):
        result, report = run_faulty(robot, fault, horizon=20, at=0.25, after=0.85, settings=settings)
    assert result.fall is None
    assert result.tilt < TILT
    assert len(report.deliveries) == 1
    assert code in report.counts
    assert code in {refusal.reason for refusal in result.refusals}
    assert any(code in record.getMessage() for record in caplog.records)
    assert result.reasons["starved"] > 0.05
    assert robot[0].status.reason == "starved"


SERVE = """
from policy.scripted.library import scripted_policy
from policy.remote.server import PolicyServer

server = PolicyServer(scripted_policy("wave"), port=0)
print(server.uri, flush=True)
server.serve_forever()
"""


def test_a_policy_whose_process_is_killed_leaves_the_robot_standing(robot):
    with subprocess.Popen([sys.executable, "-c", SERVE], stdout=subprocess.PIPE, text=True) as server:
        try:
            remote = RemotePolicy.connect(server.stdout.readline().strip())
            answer = remote.infer

            def kill_at_quarter(observation):
                if observation.time > 0.25:
                    server.kill()
                    server.wait()
                return answer(observation)

            remote.infer = kill_at_quarter
            runner = simulated_executor(remote, config=ExecutorConfig(replace_every=10))
            result = run_episode(runner, *robot, duration=2.5, config=EpisodeConfig(settle=0.1, hold=0.0))
            remote.close()
        finally:
            server.kill()
    assert result.fall is None
    assert result.tilt < TILT
    assert len(runner.report.deliveries) == 1
    assert "policy_raised" in runner.report.counts
    assert robot[0].status.reason == "starved"


@pytest.mark.regression
@pytest.mark.timeout(0)
@pytest.mark.parametrize(("fault", "code"), HEADLINES.items())
def test_a_policy_that_failed_10_s_ago_leaves_the_robot_standing(robot, stored, fault, code):
    # In mid-motion: the hand is up and swings.
    result, report = run_faulty(robot, fault, horizon=50, at=3.0, after=10.8, settings=ExecutorConfig())
    assert result.fall is None
    assert result.tilt < TILT
    assert code in report.counts
    assert (len(report.deliveries) > 10) == (fault == "hangs 2 s"), "what has only hung goes on"
    assert fault == "hangs 2 s" or report.starved >= 10.0
    stored.check("chunks", len(report.deliveries), tolerance=0)
    stored.check("starved_s", report.starved, tolerance=0.1)
    stored.check("tilt_deg", np.rad2deg(result.tilt), tolerance=2.0)
    stored.check("creep_mm", 1e3 * result.creep, tolerance=0.5, at_most=5.0)
    stored.check("seam_mm", 1e3 * worst(result, "distance"), tolerance=0.05, at_most=1e3 * SEAM)
    stored.check("seam_m_s", worst(result, "velocity"), tolerance=0.01, at_most=SEAM_VELOCITY)


def test_late_chunks_are_joined_without_a_jump_and_lose_nothing(robot):
    runner = simulated_executor(at_50_hz(scripted_policy("wave")), latency=uniform_latency(0.1, 0.4, seed=1))
    result = run_episode(runner, *robot, duration=1.7, config=EpisodeConfig(settle=0.1, hold=0.0))
    assert result.fall is None
    assert len(result.seams) == 3
    assert worst(result, "distance") <= SEAM
    assert worst(result, "velocity") <= SEAM_VELOCITY
    assert worst(result, "angle") <= np.deg2rad(0.1)
    # The motion has begun when the first chunk arrives; from the second one on nothing of that is left.
    assert np.sqrt(np.mean(result.errors[result.times > 1.0] ** 2)) < LATE
    assert result.execution.starvations == 0
    assert result.time_factor == pytest.approx(1.0, abs=1e-3)


@pytest.mark.regression
@pytest.mark.timeout(0)
@pytest.mark.parametrize(
    ("settings", "swings", "seconds"), [({}, 25, 30.0), ({"ensemble": 0.01}, 5, 10.0)], ids=["plain", "ensemble"]
)
def test_latency_of_up_to_400_ms_costs_less_than_3_mm(robot, stored, settings, swings, seconds):
    config = ExecutorConfig(**settings)
    prompt = run_episode(simulated_executor(at_50_hz(wave(swings=swings)), config=config), *robot, duration=seconds)
    latency = uniform_latency(0.0, 0.4)
    runner = simulated_executor(at_50_hz(wave(swings=swings)), latency=latency, config=config)
    late = run_episode(runner, *robot, duration=seconds)
    assert prompt.fall is None
    assert late.fall is None
    assert late.execution.starvations == 0
    assert worst(late, "distance") <= SEAM
    assert worst(late, "velocity") <= SEAM_VELOCITY
    stored.check("prompt_rms_mm", 1e3 * prompt.rms, tolerance=0.5)
    stored.check("late_rms_mm", 1e3 * late.rms, tolerance=0.5)
    stored.check("lost_rms_mm", 1e3 * (late.rms - prompt.rms), tolerance=0.5, at_most=1e3 * LATE)
    stored.check("seam_mm", 1e3 * worst(late, "distance"), tolerance=0.05, at_most=1e3 * SEAM)
    stored.check("seam_deg", np.rad2deg(worst(late, "angle")), tolerance=0.05)
    stored.check("seam_m_s", worst(late, "velocity"), tolerance=0.01, at_most=SEAM_VELOCITY)


class Shaking:
    """Another policy whose wrists scatter by so much a step [m]."""

    sees_robot = False

    def __init__(self, policy, scatter):
        self.policy, self.spec, self.scatter = policy, policy.spec, scatter

    def reset(self, task=""):
        self.policy.reset(task)
        self.rng = np.random.default_rng(0)

    def infer(self, observation):
        chunk = self.policy.infer(observation)
        shaken = {}
        for name in ("T_world_lhand", "T_world_rhand"):
            T = getattr(chunk, name).copy()
            T[:, :3, 3] += self.scatter * self.rng.normal(size=(len(T), 3))
            shaken[name] = T
        return dataclasses.replace(chunk, **shaken)


def test_a_policy_that_scatters_by_a_millimetre_a_step_is_followed_through_the_scatter(robot):
    policy = Shaking(at_50_hz(scripted_policy("wave")), 1e-3)
    result = run_episode(policy, *robot, duration=1.2, config=EpisodeConfig(settle=0.1, hold=0.0))
    assert result.fall is None
    assert result.rms < 2.5e-3  # the scatter itself is 1.7 mm
    assert result.tilt < np.deg2rad(2.0)
    assert set(result.seconds) == {"hold", "tracking"}  # nobody sees that
    assert Reason.NOISY_CHUNK in result.palms.reasons
    assert result.palms.moved.max() < 6e-3  # of 1 mm in each axis
    assert Reason.OUT_OF_REACH not in result.reasons


def test_a_policy_is_told_the_task_and_shown_the_images(robot):
    policy, seen = scripted_policy("wave"), []
    answer, policy.reset = policy.infer, seen.append
    policy.infer = lambda observation: seen.append(observation) or answer(observation)
    image = np.zeros((4, 6, 3), dtype=np.uint8)
    config = EpisodeConfig(settle=0.0, hold=0.0, task="wave hello", cameras=lambda: {"head": image})
    result = run_episode(policy, *robot, duration=0.02, config=config)
    task, observation = seen
    assert task == observation.task == "wave hello"
    assert observation.images["head"] is image
    observation.validate()
    assert result.refusals == []


def test_what_decoding_notes_of_a_chunk_reaches_the_verdict(robot):
    policy = scripted_policy("wave")
    answer = policy.infer
    policy.infer = lambda observation: dataclasses.replace(answer(observation), notes=("left_hand: 2 numbers clipped",))
    result = run_episode(policy, *robot, duration=0.3, config=EpisodeConfig(settle=0.1, hold=0.0))
    (violation,) = verdict_of("wave", result).violations
    assert (violation.code, violation.subject) == (Reason.CHUNK_NOTE, "left_hand: 2 numbers clipped")
    assert violation.time is None, "what is told of the first chunk is about the input"


def test_real_time_is_not_what_mujoco_is_stepped_in(robot):
    with pytest.raises(TypeError, match="MonotonicClock; MuJoCo is stepped on a SimulatedClock"):
        run_episode(Executor(scripted_policy("wave"), MonotonicClock()), *robot, duration=1.0)
