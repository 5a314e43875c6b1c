"""Strategy: inputs to which the answer was wrong once, made here, through planner, controller and MuJoCo to the
verdict; what needs no simulation is in `test_verdict.py`. Numbers in names are those of the list of wrong answers.
"""

import numpy as np
import pytest

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.codec import encode
from policy.chunk import ActionChunk
from policy.executor.executor import ExecutorConfig
from policy.executor.simulated import simulated_executor
from policy.geometry.rotations import rotvec_to_matrix
from policy.recorded.chunk_file import ChunkFile
from policy.recorded.replay import ReplayPolicy
from policy.scripted.library import lissajous, reach, wave
from policy.scripted.policy import minimum_jerk
from tests.support.wide import wide
from wholebody.episode.run import EpisodeConfig
from wholebody.types import PalmCause, Reason
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.report import lines

FPS = 30.0
STANCE = Anchor.nominal()


@pytest.fixture(scope="module")
def checker():
    return Checker(episode=EpisodeConfig(settle=0.1, hold=0.3))


def chunk_file(steps, *, to=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0), jump=(0.0, 0.0, 0.0), time=1.0, free=False):
    """The left hand goes from the stance by ``to`` [m] and turns by ``turn`` [rad] within a time [s]; all is moved by
    ``jump`` [m]. The right hand stays.
    """
    share = minimum_jerk(np.arange(steps) / FPS / time)[:, None]
    T = [np.tile(STANCE.T_world_base @ STANCE.poses[hand], (steps, 1, 1)) for hand in ("lhand", "rhand")]
    T[0][:, :3, 3] += share * np.asarray(to) + jump
    T[0][:, :3, :3] = rotvec_to_matrix(share * np.asarray(turn)) @ T[0][:, :3, :3]
    fingers = [np.tile(q, (steps, 1)) for q in (STANCE.q_lhand, STANCE.q_rhand)]
    spec = builtin("wbc32").with_free_orientation() if free else builtin("wbc32")
    return ChunkFile(spec, encode(spec, ActionChunk(spec.id, 0, 0.0, FPS, *T, *fingers), STANCE), FPS)


def replay(file):
    return ReplayPolicy(file.chunk(), spec=file.spec)


def judged(checker, policy, duration=None):
    source = getattr(policy, "policy", policy)
    verdict, result = checker.check(policy, "input", source.duration if duration is None else duration)
    return verdict, {violation.kind: violation for violation in reversed(verdict.violations)}, result


def test_1_a_single_step_three_metres_away_is_infeasible(checker):
    """It was "done as given", with no chunk executed: an input of one step is over as soon as it begins."""
    verdict, found, result = judged(checker, replay(chunk_file(1, jump=(3.0, 0.0, 0.0))))
    assert verdict.verdict == "infeasible"
    assert found[PalmCause.POSITION].value > 2.9
    assert found[Reason.FAR_START].value == pytest.approx(3.0, abs=0.01)
    assert len(result.execution.deliveries) == 1


@pytest.mark.parametrize(("latency", "code"), [(1.0, Reason.NO_CHUNK), (0.4, Reason.REFUSED)])
def test_1_a_run_whose_every_chunk_came_too_late_is_infeasible(checker, latency, code):
    """An answer after the end of the run, and answers after the end of their own ten steps."""
    policy = wave()
    policy.horizon = 10
    verdict, found, _ = judged(checker, simulated_executor(policy, latency=latency), 0.9)
    assert (verdict.verdict, verdict.timing.chunks) == ("infeasible", 0)
    assert found[code].severity == found[Reason.NO_CHUNK].severity == "infeasible"


def test_2_a_hand_kept_out_of_the_floor_did_not_do_what_was_asked(checker):
    """17 cm into the floor was "feasible after repair", and only the JSON knew why the palm ended 210 mm off."""
    verdict, found, _ = judged(checker, replay(chunk_file(45, to=(0.05, 0.05, -0.95), time=1.4)))
    assert verdict.verdict == "infeasible"
    assert found[Reason.INTO_FLOOR].value > 0.15
    assert found[Reason.INTO_FLOOR].severity == "infeasible"
    assert verdict.moved_max_m == pytest.approx(verdict.max_m, abs=0.01)
    first = lines(verdict)[0]
    assert first.startswith("INFEASIBLE  input: left hand 2")
    assert "mm off at row " in first
    assert first.endswith("50 mm allowed: below the floor")


def test_2_a_jump_that_no_hand_does_is_another_motion(checker):
    file = chunk_file(40)
    file.actions[20:, 0] += 0.2
    verdict, found, _ = judged(checker, replay(file))
    assert verdict.verdict == "infeasible"
    assert found[Reason.STEPS_JUMP].value > 0.05


def test_2_a_jump_before_the_first_plan_is_no_start_elsewhere(checker):
    """The hand began where it was, and 280 mm away counted as an approach that was done as given."""
    file = chunk_file(40)
    file.actions[1:, 11] += 0.28
    verdict, found, _ = judged(checker, replay(file))
    fast = FastChecker().check(replay(file), "input", 40 / FPS, start="stance")
    assert (verdict.verdict, fast.verdict) == ("infeasible", "infeasible")
    assert verdict.start_m < 1e-3 > fast.start_m
    assert not {Reason.START_OFFSET, Reason.FAR_START} & found.keys()


@pytest.mark.parametrize(("size", "answer"), [(1e-3, "feasible"), (0.06, "infeasible")])
def test_2_what_the_noise_filter_takes_out_is_moved(checker, size, answer):
    file = chunk_file(40)
    file.actions[1:, :3] += size * np.random.default_rng(0).normal(size=(39, 3))
    verdict, found, _ = judged(checker, replay(file))
    assert verdict.verdict == answer
    assert found[Reason.NOISY_CHUNK].severity == ("note" if answer == "feasible" else "infeasible")


def test_6_a_chunk_at_its_own_speed_whose_scatter_nobody_sees_is_not_called_slowed(checker):
    """A millimetre that the noise filter took out made a motion at time factor 1.000 "slowed" from end to end."""
    file = chunk_file(40, to=(0.1, 0.0, 0.0))
    file.actions[1:, :3] += 1e-3 * np.random.default_rng(0).normal(size=(39, 3))
    verdict, found, result = judged(checker, replay(file))
    assert verdict.seconds.keys() == {"hold", "tracking"}
    assert (found[Reason.NOISY_CHUNK].severity, verdict.time_factor) == ("note", pytest.approx(1.0, abs=1e-3))
    assert Reason.NOISY_CHUNK in result.palms.reasons


def test_6_a_jump_is_called_slowed_around_the_jump_alone(checker):
    file = chunk_file(50)
    file.actions[25:, 0] += 0.05
    verdict, found, _ = judged(checker, replay(file))
    assert 0.03 < verdict.seconds["slowed"] < 0.4
    assert found[Reason.STEPS_JUMP].time == pytest.approx(25 / FPS, abs=0.1)


@pytest.mark.parametrize(("free", "answer"), [(False, "infeasible"), (True, "feasible")])
def test_3_a_hand_that_cannot_turn_as_asked_is_infeasible_unless_that_is_free(checker, free, answer):
    """74 degrees off was "done as given": the palm is where it was asked to be."""
    file = chunk_file(50, to=(0.1, 0.1, 0.65), turn=(0.0, 2.6, 0.0), time=1.3, free=free)
    verdict, found, _ = judged(checker, replay(file))
    assert verdict.verdict == answer
    assert verdict.max_m < 0.02
    assert verdict.moved_turn_max_rad > 1.0
    assert (PalmCause.ORIENTATION in found) != free


@pytest.mark.parametrize("angle", [5.0, 1e4])
def test_4_fingers_out_of_range_are_told(checker, angle):
    file = chunk_file(20)
    file.actions[:, 18] = angle
    verdict, found, _ = judged(checker, replay(file))
    assert verdict.verdict != "feasible"
    limit = found[Reason.FINGER_LIMIT]
    assert (limit.subject, limit.value) == ("left_hand_thumb_0_joint", angle)
    assert found[Reason.CHANGED_NUMBERS].subject.startswith(
        "left_hand: 20 numbers out of the fingers' range, by up to "
    )


def test_4_palms_go_where_they_go_with_the_fingers_at_their_limit(checker):
    commanded = []
    for angle in (1.04719755, 1e4):  # the limit of left_hand_thumb_0_joint
        file, recorder = chunk_file(20, to=(0.1, 0.0, 0.0)), checker.recorder()
        file.actions[:, 18] = angle
        checker.check(replay(file), "input", 0.6, recorder=recorder)
        commanded.append(recorder.arrays()["T_world_palms_commanded"][:, :, :3, 3])
    assert np.linalg.norm(commanded[0] - commanded[1], axis=2).max() < 1e-3


@pytest.mark.parametrize("jump", [(0.1, 0.0, 0.0), (0.2, 0.0, 0.15)])
def test_4_a_start_100_or_250_mm_away_is_a_note(checker, jump):
    verdict, found, _ = judged(checker, replay(chunk_file(45, jump=jump)))
    assert (verdict.verdict, list(found)) == ("feasible", [Reason.START_OFFSET])
    assert verdict.start_m == pytest.approx(np.linalg.norm(jump), abs=1e-3)
    assert 0.1 < verdict.approach_s < 1.0


def test_7_hands_to_which_a_chunk_comes_back_never_joined_it(checker):
    """0.28 m away for 0.3 s and then where the hands had stayed was an approach, and "done as given"."""
    file = chunk_file(40)
    file.actions[:10, 2] += 0.28
    verdict, _, _ = judged(checker, replay(file))
    assert (verdict.verdict, verdict.approach_s) == ("infeasible", 0.0)
    assert verdict.moved_max_m > 0.25


def test_5_a_policy_with_ten_steps_a_chunk_is_done_as_given(checker):
    """Asked every 25 steps, it stood still for more than half of the time."""
    policy = wave()
    policy.horizon = 10
    verdict, _, _ = judged(checker, simulated_executor(policy, latency=0.05), 1.2)
    assert (verdict.verdict, verdict.timing.starved_s) == ("feasible", 0.0)


def test_5_a_policy_is_asked_so_early_that_its_chunk_is_planned_before_the_last_step(checker):
    """Asked at half of 30 steps, an answer after 420 ms that is planned for 100 ms would be 20 ms too late."""
    policy = wave()
    policy.horizon = 30
    verdict, _, result = judged(checker, simulated_executor(policy, latency=0.42), 2.0)
    assert result.palms.uncovered == (0.0, 0.0)
    assert (verdict.verdict, verdict.timing.chunks) == ("feasible", 4)


def test_5_what_a_policy_does_not_cover_is_told(checker):
    policy = wave()
    policy.horizon = 10
    settings = ExecutorConfig(hang_after=5.0)
    verdict, found, result = judged(checker, simulated_executor(policy, latency=0.15, config=settings), 1.2)
    assert verdict.verdict == "feasible_after_repair"
    # The policy was never late for its own chunks: what is told is the time in which their plans were being computed.
    assert (found[Reason.STARVED].value, verdict.timing.starved_s) == (result.palms.uncovered[1], 0.0)
    assert result.palms.uncovered[1] == pytest.approx(0.388, abs=0.01)


def test_6_steps_that_a_short_run_never_reaches_do_not_count(checker):
    """The plan of the first chunk ends half a metre short of a target that this run is far from."""
    verdict, found, _ = judged(checker, reach(0.9, 0.6), 0.4)
    assert (verdict.verdict, found) == ("feasible", {})
    assert verdict.moved_max_m < 0.01


def test_6_a_lissajous_that_is_followed_as_given_is_not_called_slowed(checker):
    """A target moved by 3 mm, half a second later in the chunk, made it `out_of_reach` for 3 of 7 seconds."""
    verdict, found, _ = judged(checker, lissajous(), 7.0)
    assert verdict.seconds.keys() == {"hold", "tracking"}
    assert (verdict.verdict, found, verdict.time_factor) == ("feasible", {}, pytest.approx(1.0, abs=1e-3))


@pytest.mark.parametrize("down", [*wide(0.068), 0.07])
def test_hands_that_press_on_a_table_stand_and_the_check_without_simulation_says_so(down):
    """1.7 and 3.7 mm: the robot fell of the second, which was foretold. It pushes no harder than it may now."""
    time = np.linspace(0.0, 1.0, 90)[:, None]
    T = [np.tile(STANCE.T_world_base @ STANCE.poses[hand], (90, 1, 1)) for hand in ("lhand", "rhand")]
    for poses in T:
        poses[:, :3, 3] += np.sin(0.5 * np.pi * time) ** 2 * (0.2, 0.0, -down)
    spec, fingers = builtin("wbc32"), [np.tile(q, (90, 1)) for q in (STANCE.q_lhand, STANCE.q_rhand)]
    policy = ReplayPolicy(ActionChunk(spec.id, 0, 0.0, FPS, *T, *fingers), spec=spec)
    fast = FastChecker(scene="table")
    checker = Checker("table", episode=EpisodeConfig(begin=fast.first_state(policy)))
    foretold, (verdict, _, result) = fast.check(policy, "input", policy.duration), judged(checker, policy)
    assert (foretold.verdict, verdict.verdict, result.fall) == ("feasible", "feasible", None)
