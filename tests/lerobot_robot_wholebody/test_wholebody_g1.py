"""Strategy: the real robot of the plugin, in lockstep, so that nothing depends on how fast the computer is; it is
connected once, and every test goes on from wherever another one left it. What LeRobot itself does with it is in
`test_stock_commands.py`.
"""

import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from lerobot_robot_wholebody import WholebodyExpert, WholebodyExpertConfig, WholebodyG1, WholebodyG1Config
from lerobot_robot_wholebody.lerobot_loop import Executed
from lerobot_robot_wholebody.target import Accepted, Disturbance, Numbers
from policy.action_spec.anchor import Anchor
from wholebody.errors import WholebodyError

ROOT = Path(__file__).parents[2]
STEP = 1.0 / 30.0


def made(folder, **settings):
    settings = {"clock": "lockstep", "calibration_dir": folder} | settings
    return WholebodyG1(WholebodyG1Config(**settings))


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    robot = made(tmp_path_factory.mktemp("robot"), task="reach", id="one")
    robot.connect()
    yield robot
    if robot.is_connected:
        robot.disconnect()


def go(robot, action, seconds):
    """The observation after an action that was said every step for so long."""
    for _ in range(round(seconds / STEP)):
        robot.send_action(action)
        robot.let_pass(STEP)
    return robot.get_observation()


def wrist(observation, side):
    return np.array([observation[f"{side}_wrist_{axis}.pos"] for axis in "xyz"])


def test_importing_the_plugin_loads_lerobots_own_modules_and_nothing_else():
    code = (
        "import sys, lerobot.robots, lerobot.teleoperators; before = set(sys.modules); import lerobot_robot_wholebody;"
        "print(*sorted({name.split('.')[0] for name in set(sys.modules) - before}))"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert set(done.stdout.split()) <= {"lerobot_robot_wholebody", "lerobot"}


def test_every_number_survives_the_filter_of_rollouts(robot):
    numbers = [name for name, kind in robot.observation_features.items() if kind is float]
    assert len(robot.action_features) == 32
    assert len(numbers) == 23 + 6
    assert all(name.endswith(".pos") for name in (*robot.action_features, *numbers))


def test_an_observation_has_the_features_that_were_announced(robot):
    observation = robot.get_observation()
    assert observation.keys() == robot.observation_features.keys()
    assert all(math.isfinite(value) for value in observation.values())
    assert 0.6 < observation["base_height.pos"] < 0.8


def test_thirty_steps_of_a_thirtieth_are_a_second_though_that_is_no_multiple_of_two_milliseconds(robot):
    begin, now = robot.seen.observation.time, robot.now()
    for _ in range(30):
        robot.let_pass(STEP)
    robot.get_observation()
    assert robot.now() - now == pytest.approx(1.0, abs=1e-9)
    assert robot.seen.observation.time - begin == pytest.approx(1.0, abs=1.1e-3)


def test_a_hand_that_nothing_is_said_of_stays(robot):
    before = robot.get_observation()
    after = go(robot, {"left_wrist_z.pos": before["left_wrist_z.pos"] + 0.1}, 1.5)
    assert wrist(after, "left") - wrist(before, "left") == pytest.approx([0.0, 0.0, 0.1], abs=5e-3)
    assert wrist(after, "right") == pytest.approx(wrist(before, "right"), abs=5e-3)


def test_a_target_that_is_repeated_does_not_drift(robot):
    before = robot.get_observation()
    after = go(robot, {}, 2.0)
    for side in ("left", "right"):
        assert wrist(after, side) == pytest.approx(wrist(before, side), abs=2e-3)


def test_a_disturbance_leads_hands_aside_by_its_spread_and_nothing_else(robot):
    spread, times = 0.02, np.linspace(0.0, 120.0, 3000)
    parts = {"rhand": np.eye(4), "q_rhand": np.ones(7)}
    led = [Disturbance(spread, 3).led(parts, time) for time in times]
    ways = np.array([one["rhand"][:3, 3] for one in led])
    assert ways.std(axis=0) == pytest.approx(spread, rel=0.1)
    assert np.abs(np.diff(ways, axis=0)).max() < 0.3 * (times[1] - times[0]), "hands can be where they are led"
    assert all((one["rhand"][:3, :3] == np.eye(3)).all() and (one["q_rhand"] == 1.0).all() for one in led)


def test_a_disturbed_robot_answers_and_records_what_was_asked_of_it(robot):
    robot._disturbance, before = Disturbance(0.02, 5), robot.get_observation()
    asked = {f"left_wrist_{axis}.pos": before[f"left_wrist_{axis}.pos"] for axis in "xyz"}
    off = []
    for _ in range(60):
        assert robot.send_action(asked) == pytest.approx(asked, abs=1e-9)
        robot.let_pass(STEP)
        off.append(np.linalg.norm(wrist(robot.get_observation(), "left") - [*asked.values()]))
    robot._disturbance = None
    assert 0.01 < max(off) < 0.1
    assert go(robot, asked, 1.0)["left_wrist_x.pos"] == pytest.approx(asked["left_wrist_x.pos"], abs=5e-3)


def test_a_disturbance_out_of_bounds_is_refused():
    with pytest.raises(ValueError, match=r"--robot\.disturb=0\.5"):
        WholebodyG1Config(disturb=0.5)


def test_a_closing_number_closes_a_hand(robot):
    assert robot.send_action({"right_grasp.pos": 1.4}) == {"right_grasp.pos": 1.0}
    after = go(robot, {}, 1.5)
    assert after["right_grasp.pos"] > 0.8
    assert after["left_grasp.pos"] < 0.2


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_an_action_with_a_number_that_is_none_is_refused_whole(robot, value):
    before = robot.get_observation()
    with pytest.raises(ValueError, match=r"right_wrist_y\.pos"):
        robot.send_action({"left_wrist_x.pos": before["left_wrist_x.pos"] + 0.2, "right_wrist_y.pos": value})
    after = go(robot, {}, 0.5)
    assert wrist(after, "left") == pytest.approx(wrist(before, "left"), abs=3e-3)


def test_a_name_that_there_is_not_is_refused_with_the_one_that_is_meant(robot):
    with pytest.raises(ValueError, match=r"did you mean left_wrist_x\.pos"):
        robot.send_action({"left_wrist_xx.pos": 0.3})


def test_what_is_accepted_is_said_and_accepted_again_as_it_is(robot):
    names = [name for name in robot.action_features if name.startswith(("left_wrist_r6", "left_hand"))]
    asked = {name: robot._accepted.last[name] * 1.3 for name in names} | {"left_hand_index_0.pos": 5.0}
    accepted = robot.send_action(asked)
    assert accepted.keys() == asked.keys()
    assert abs(accepted["left_hand_index_0.pos"]) < 2.0
    assert sum(accepted[f"left_wrist_r6_{i}.pos"] ** 2 for i in range(3)) == pytest.approx(1.0, abs=1e-6)
    assert robot.send_action(accepted) == pytest.approx(accepted, abs=1e-9)


def test_an_observation_that_is_sent_back_leads_there(robot):
    """`lerobot-rollout` goes back to its first observation so, number by number."""
    first = robot.get_observation()
    away = go(robot, {"left_wrist_x.pos": first["left_wrist_x.pos"] + 0.12}, 1.5)
    assert np.linalg.norm(wrist(away, "left") - wrist(first, "left")) > 0.1
    for share in np.linspace(0.0, 1.0, 60):
        robot.send_action({name: away[name] * (1.0 - share) + first[name] * share for name in first})
        robot.let_pass(STEP)
    back = go(robot, {}, 0.5)
    assert wrist(back, "left") == pytest.approx(wrist(first, "left"), abs=5e-3)


def test_halfway_between_opposite_rotations_a_hand_keeps_its_own():
    numbers, stance = Numbers(), Anchor.nominal().observation()
    state, accepted = numbers.state(stance), Accepted(numbers, stance)
    turned = {name: 0.0 if "_wrist_r6_" in name else value for name, value in state.items()}
    parts, _, taken = accepted.take(turned, stance)
    assert np.linalg.det(parts["lhand"][:3, :3]) == pytest.approx(1.0)
    assert not any("_r6_" in name for name in taken)
    with pytest.raises(ValueError, match="left_wrist_rotation"):
        accepted.take({name: value for name, value in turned.items() if name in numbers.action_names}, stance)


@pytest.fixture
def told():
    """Numbers of actions that tell forces, and what was accepted of a robot in its stance."""
    numbers, stance = Numbers(forces=True), Anchor.nominal().observation()
    return numbers, Accepted(numbers, stance), stance


def test_actions_that_tell_forces_have_six_numbers_more_and_states_none(told):
    numbers, plain = told[0], Numbers()
    assert numbers.action_names == (*plain.action_names, *numbers.forces)
    assert [name for name in numbers.forces if name.endswith(".pos")] == [
        f"{side}_force_{axis}.pos" for side in ("left", "right") for axis in "xyz"
    ]
    assert numbers.state_names == plain.state_names
    assert not plain.forces
    assert WholebodyG1Config(forces=True).tells_forces
    assert WholebodyG1Config(task="lift", clock="lockstep").tells_forces
    assert not WholebodyG1Config(task="reach").tells_forces


def test_a_force_is_told_in_the_stance_and_no_harder_than_a_hand_may_push(told):
    _, accepted, stance = told
    everything, said, taken = accepted.take({"left_force_y.pos": 30.0, "right_force_y.pos": -1e4}, stance)
    assert said == {"f_lpalm", "f_rpalm"}
    R = Anchor.nominal().T_world_stance[:3, :3]
    np.testing.assert_allclose([everything["f_lpalm"], everything["f_rpalm"]], [30.0 * R[:, 1], -60.0 * R[:, 1]])
    assert taken == pytest.approx({"left_force_y.pos": 30.0, "right_force_y.pos": -60.0})
    everything, said, _ = accepted.take({"left_grasp.pos": 1.0}, stance)
    assert said == {"q_lhand"}
    np.testing.assert_allclose(everything["f_lpalm"], 30.0 * R[:, 1])  # as it was told last


def test_on_the_way_back_that_a_rollout_ends_with_no_force_is_told(told):
    """A palm that is told a force pushes with it wherever it is led: it would never let go."""
    numbers, accepted, stance = told
    accepted.take({"left_force_y.pos": 30.0}, stance)
    everything, said, _ = accepted.take(numbers.state(stance), stance)
    assert not everything["f_lpalm"].any()
    assert "f_lpalm" in said


def test_an_executed_action_has_the_forces_that_were_felt(told):
    numbers, _, stance = told
    felt = np.array([[1.0, 20.0, -5.0], [0.0, -18.0, -5.0]])
    done = numbers.executed(stance, felt)
    R = Anchor.nominal().T_world_stance[:3, :3]
    np.testing.assert_allclose([done[name] for name in numbers.forces], (felt @ R).ravel())
    assert not any(numbers.executed(stance)[name] for name in numbers.forces)


def test_forces_that_nothing_gives_leave_the_robot_standing(tmp_path):
    """Told as hard as they may be in the air, back, then to and fro at every step, then at random."""
    robot, rng = made(tmp_path, forces=True, id="pushed"), np.random.default_rng(0)
    robot.connect()
    ways = [[-60.0, 0.0, 0.0] * 2] * 60 + [[60.0, -60.0, 0.0] * 2, [-60.0, 60.0, 0.0] * 2] * 30
    for forces in [*ways, *rng.uniform(-60.0, 60.0, (60, 6))]:
        robot.get_observation()
        assert robot.send_action(dict(zip(robot.numbers.forces, forces, strict=True))).keys() == {*robot.numbers.forces}
        robot.let_pass(STEP)
    assert not robot.seen.fallen
    robot.disconnect()
    assert not robot.report["fell"]
    assert robot.report["targets_refused"] == {}


class Rows:
    """What `lerobot-record` writes to."""

    def __init__(self, names):
        self.features, self.rows = {"action": {"names": list(names)}}, []

    def add_frame(self, frame):
        self.rows.append(frame)


def test_a_dataset_of_what_is_executed_gets_what_is_seen_a_step_later(robot):
    rows = Rows(robot.action_features)
    done, asked, seen = Executed(rows, robot), robot.get_observation()["left_wrist_z.pos"] + 0.05, []
    for step in range(45):
        seen.append(robot.get_observation()["left_wrist_z.pos"])
        action = robot._accepted.last | {"left_wrist_z.pos": asked}
        done.add_frame({"action": np.array([*action.values()], np.float32), "step": step})
        robot.send_action({"left_wrist_z.pos": asked})
        robot.let_pass(STEP)
    done.finish()
    assert [row["step"] for row in rows.rows] == list(range(45))
    written = [float(row["action"][2]) for row in rows.rows]
    assert written == pytest.approx([*seen[1:], robot.get_observation()["left_wrist_z.pos"]], abs=1e-6)
    assert abs(written[0] - asked) > 0.04  # a hand does not jump
    assert written[-1] == pytest.approx(asked, abs=5e-3)


@pytest.mark.parametrize(("name", "value"), [("link", "dds"), ("link", "twin"), ("clock", "moon"), ("task", "dance")])
def test_a_setting_that_cannot_be_is_refused_by_its_name(name, value):
    with pytest.raises(ValueError, match=f"{name}={value}"):
        WholebodyG1Config(**{name: value})


def test_a_connect_that_fails_leaves_nothing(tmp_path):
    robot = made(tmp_path, scene="moon", id="two")
    with pytest.raises((WholebodyError, ValueError), match="moon"):
        robot.connect()
    assert not robot.is_connected
    with pytest.raises(ConnectionError, match="not connected"):
        robot.get_observation()


def test_another_robot_of_the_same_id_is_refused(robot, tmp_path):
    with pytest.raises(ValueError, match="id=one"):
        made(tmp_path, id="one").connect()
    assert robot.is_connected


def test_the_end_is_a_robot_that_crouches_and_has_not_fallen(tmp_path):
    robot = made(tmp_path)
    robot.connect()
    robot.disconnect()
    assert not robot.report["fell"]
    assert robot.report["lowered"]
    assert robot.report["targets_refused"] == {}
    for call in (robot.get_observation, robot.disconnect, lambda: robot.send_action({})):
        with pytest.raises(ConnectionError, match="not connected"):
            call()


def test_a_robot_whose_processes_were_killed_says_so(tmp_path):
    robot = made(tmp_path)
    robot.connect()
    os.kill(robot._robot._process.pid, signal.SIGKILL)
    with pytest.raises(WholebodyError, match="processes ended"):
        robot.get_observation()
    robot.disconnect()
    assert robot.report == {}


def test_a_gate_holds_what_cannot_be_done_and_the_robot_stays_at_the_target_before(tmp_path):
    robot = made(tmp_path, gate=True)
    robot.connect()
    names = [f"left_wrist_{axis}.pos" for axis in "xyz"]
    first = robot.get_observation()
    good = {name: first[name] + (0.05 if name == names[0] else 0.0) for name in names}
    before = go(robot, good, 2.0)
    assert wrist(before, "left") == pytest.approx([*good.values()], abs=1e-2)
    assert robot.send_action(good) == pytest.approx(good, abs=1e-9)

    hostile = good | {names[0]: good[names[0]] + 2.0}
    held = go(robot, hostile, 2.0)
    assert robot.rejected
    assert robot.send_action(hostile) == pytest.approx(good, abs=1e-9)
    assert wrist(held, "left") == pytest.approx(wrist(before, "left"), abs=1e-2)

    after = go(robot, good | {names[2]: good[names[2]] + 0.05}, 2.0)
    assert not robot.rejected
    assert after[names[2]] - held[names[2]] == pytest.approx(0.05, abs=1e-2)
    robot.disconnect()
    assert robot.report["chunks"]["refused"]["not_cleared"] >= 1
    assert not robot.report["fell"]


@pytest.mark.regression
def test_an_expert_picks_up_the_cylinder_and_it_is_put_back_for_the_next_episode(tmp_path):
    robot = made(tmp_path, task="pick", seed=1, id="picker")
    expert = WholebodyExpert(WholebodyExpertConfig(calibration_dir=tmp_path, robot_id="picker"))
    expert.connect()
    robot.connect()
    robot.begin("episode")
    first, far = robot.seen.objects[0].copy(), []
    while len(far) < robot.task.steps and sum(one <= 0.0 for one in far) <= robot.task.held:
        robot.send_action(expert.get_action())
        robot.let_pass(STEP)
        robot.get_observation()
        far.append(robot.task.far(robot.seen, robot.palms))
    assert sum(one <= 0.0 for one in far) > robot.task.held
    assert robot.get_observation()["object_z.pos"] > first[2] + 0.06
    robot.begin("reset")
    for _ in range(75):
        robot.send_action(expert.get_action())
        robot.let_pass(STEP)
        robot.get_observation()
    robot.begin("episode")
    assert robot.seen.objects[0, 2] == pytest.approx(first[2], abs=5e-3)
    assert np.abs(robot.seen.objects[0, :2] - first[:2]).max() > 5e-3
    assert not robot.seen.fallen
    robot.disconnect()


def test_a_task_with_things_is_refused_on_the_wall_clock():
    with pytest.raises(ValueError, match=r"needs --robot\.clock=lockstep"):
        WholebodyG1Config(task="pick")


@pytest.mark.alone
def test_on_the_wall_clock_time_passes_by_itself(tmp_path):
    robot = made(tmp_path, clock="wall")
    robot.connect()
    first = robot.get_observation()
    end, later = time.monotonic() + 2.0, first
    while time.monotonic() < end:
        robot.send_action({"left_wrist_z.pos": first["left_wrist_z.pos"] + 0.1})
        time.sleep(STEP)
        later = robot.get_observation()
    with pytest.raises(ValueError, match="by itself"):
        robot.let_pass(STEP)
    robot.disconnect()
    assert later["left_wrist_z.pos"] - first["left_wrist_z.pos"] == pytest.approx(0.1, abs=0.02)
    assert not robot.report["fell"]
    assert robot.report["lowered"]
