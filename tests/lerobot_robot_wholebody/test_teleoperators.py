"""Strategy: the real robot of the plugin in lockstep, driven by each teleoperator as LeRobot's loops do it: an action
is got, sent, and a step of time passes. Of gamepad and keyboard, LeRobot's own class of what they say is filled by
hand, since no test has one; the page is told by a client of the real one what a browser would send.
"""

import json
import os
import re
import socket
import stat
from contextlib import suppress
from itertools import pairwise

import msgspec
import numpy as np
import pytest
import viser
from lerobot.teleoperators.gamepad.gamepad_utils import InputController
from websockets.sync.client import connect

from lerobot_robot_wholebody import (
    WholebodyG1,
    WholebodyG1Config,
    WholebodyGamepad,
    WholebodyGamepadConfig,
    WholebodyKeyboard,
    WholebodyKeyboardConfig,
    WholebodyMotion,
    WholebodyMotionConfig,
    WholebodyPage,
    WholebodyPageConfig,
    WholebodySocket,
    WholebodySocketConfig,
)
from lerobot_robot_wholebody.steering import AHEAD_MAX
from lerobot_robot_wholebody.wholebody_socket import LINE_MAX
from policy.action_spec.hands import closing_of
from policy.errors import PolicyError
from policy.scripted.library import scripted_policy

STEP = 1.0 / 30.0


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    robot = WholebodyG1(
        WholebodyG1Config(clock="lockstep", id="driven", calibration_dir=tmp_path_factory.mktemp("robot"))
    )
    robot.connect()
    yield robot
    robot.disconnect()


@pytest.fixture
def standing(robot):
    """The robot in its stance, whatever it did."""
    robot.seen = robot._robot.reset()
    robot._accepted.last = robot.numbers.executed(robot.seen.observation)
    robot.begin("run")
    robot.get_observation()
    return robot


@pytest.fixture
def made(tmp_path):
    """Makes a teleoperator that is there, and lets it leave at the end."""
    there = []

    def make(kind, config, **settings):
        one = kind(config(calibration_dir=tmp_path, robot_id="driven", **settings))
        one.connect()
        there.append(one)
        return one

    yield make
    for one in there:
        one.disconnect()


def driven(robot, teleoperator, seconds):
    """Actions of a while of LeRobot's loop."""
    actions = []
    for _ in range(round(seconds / STEP)):
        robot.get_observation()
        actions.append(teleoperator.get_action())
        robot.send_action(actions[-1])
        robot.let_pass(STEP)
    robot.get_observation()
    return actions


def wrist(action, side):
    return np.array([action[f"{side}_wrist_{axis}.pos"] for axis in "xyz"])


def largest_step(actions, side):
    return max(np.linalg.norm(wrist(b, side) - wrist(a, side)) for a, b in pairwise(actions))


def test_a_motion_is_played_from_where_the_hands_are_and_they_go_back_in_a_reset(standing, made):
    motion, rest = scripted_policy("reach", x=0.35, z=0.8), standing.palms
    teleoperator = made(WholebodyMotion, WholebodyMotionConfig, motion="reach")
    standing.begin("episode")
    actions = driven(standing, teleoperator, 1.0 + scripted_policy("reach").duration)
    assert actions[0].keys() == standing.action_features.keys()
    assert largest_step(actions, "left") < 0.03
    end = scripted_policy("reach").script(np.array([motion.duration]))
    np.testing.assert_allclose(standing.palms[0], np.ravel(end.p_world_lpalm), atol=0.01)

    standing.begin("reset")
    assert largest_step(driven(standing, teleoperator, 3.0), "left") < 0.03
    np.testing.assert_allclose(standing.palms, rest, atol=0.01)


def test_a_motion_that_there_is_not_is_said_before_anything_moves(made, tmp_path):
    with pytest.raises(PolicyError, match="reech"):
        made(WholebodyMotion, WholebodyMotionConfig, motion="reech")
    with pytest.raises(PolicyError, match=r"nothing\.csv"):
        made(WholebodyMotion, WholebodyMotionConfig, motion=str(tmp_path / "nothing.csv"))


def test_forces_of_a_motion_that_are_not_told_are_said_with_the_setting_that_tells_them(standing, made, caplog):
    teleoperator = made(WholebodyMotion, WholebodyMotionConfig, motion="press")
    standing.begin("episode")
    driven(standing, teleoperator, STEP)
    assert "with --robot.forces=true they are" in caplog.text


class Held(InputController):
    """LeRobot's class, as it is while a stick is held."""

    deltas = (0.0, 0.0, 0.0)

    def get_deltas(self):
        return self.deltas


class Stick(WholebodyGamepad):
    def _open(self):
        return Held()


def test_a_palm_that_is_steered_moves_at_its_speed_and_stays_where_it_is_let_go(standing, made):
    stick, begin = made(Stick, WholebodyGamepadConfig, hand="right", speed=0.1), standing.palms
    driven(standing, stick, 0.2)
    stick._controller.deltas = (1.0, 0.0, 0.5)
    driven(standing, stick, 1.0)
    stick._controller.deltas = (0.0, 0.0, 0.0)
    driven(standing, stick, 1.0)
    moved = standing.palms - begin
    np.testing.assert_allclose(moved[1], [0.1, 0.0, 0.05], atol=0.01)
    np.testing.assert_allclose(moved[0], 0.0, atol=0.01)


def test_a_target_that_is_steered_out_of_reach_does_not_run_away(standing, made):
    stick = made(Stick, WholebodyGamepadConfig, hand="both", speed=1.0)
    stick._controller.deltas = (0.0, 0.0, 5.0)
    driven(standing, stick, 4.0)
    assert np.linalg.norm(stick.last.palms - standing.palms, axis=1).max() < AHEAD_MAX + 0.05


def test_buttons_close_and_open_the_fingers_of_the_hand_that_is_steered(standing, made):
    stick = made(Stick, WholebodyGamepadConfig, hand="left")
    stick._controller.close_gripper_command = True
    driven(standing, stick, 1.2)
    assert closing_of("left", stick.last.fingers[0]) == 1.0
    np.testing.assert_array_equal(stick.last.fingers[1], stick._rest.fingers[1])
    stick._controller.close_gripper_command, stick._controller.open_gripper_command = False, True
    driven(standing, stick, 0.5)
    assert 0.4 < closing_of("left", stick.last.fingers[0]) < 0.6


def test_where_no_keyboard_can_be_read_that_is_said_with_what_needs_none(made, monkeypatch):
    monkeypatch.setattr("lerobot.teleoperators.gamepad.gamepad_utils.pynput_can_capture", lambda: False)
    with pytest.raises(ConnectionError, match="wholebody_page"):
        made(WholebodyKeyboard, WholebodyKeyboardConfig)


@pytest.mark.parametrize(("setting", "value"), [("hand", "middle"), ("speed", 0.0), ("speed", float("nan"))])
def test_settings_that_cannot_be_are_refused_by_name(setting, value):
    with pytest.raises(ValueError, match=f"--teleop.{setting}"):
        WholebodyGamepadConfig(**{setting: value})


@pytest.fixture
def talk(standing, made, tmp_path):
    """What drives by a socket, and a program that has connected to it."""
    teleoperator = made(WholebodySocket, WholebodySocketConfig, path=str(tmp_path / "hands"))
    with socket.socket(socket.AF_UNIX) as program:
        program.connect(str(tmp_path / "hands"))
        program.settimeout(60.0)
        yield teleoperator, program, program.makefile("rb")


def test_a_program_drives_and_sees_by_lines_of_a_socket(standing, talk):
    teleoperator, program, answers = talk
    begin = driven(standing, teleoperator, 0.1)[-1]
    told = {"right_wrist_x.pos": begin["right_wrist_x.pos"] + 0.05, "left_grasp.pos": 1.0}
    program.sendall(json.dumps(told).encode() + b"\n")
    (action,) = driven(standing, teleoperator, STEP)
    said = json.loads(answers.readline())
    assert said["error"] == ""
    assert said["observation"].keys() == {k for k, kind in standing.observation_features.items() if kind is float}
    assert action["right_wrist_x.pos"] == pytest.approx(told["right_wrist_x.pos"])
    assert wrist(action, "left") == pytest.approx(wrist(begin, "left"))
    fingers = [action[name] for name in teleoperator._robot.numbers.spec.slot("left_hand").feature_names]
    assert closing_of("left", np.array(fingers)) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("line", "wrong"),
    [
        (b"{", "Expecting"),
        (b"[1]", "JSON object"),
        (b'{"right_wrist_x.pos": NaN}', "not a finite|is nan"),
        (b'{"right_wrist_x.pos": null}', "float"),
        (b'{"rigth_wrist_x.pos": 0.3}', "did you mean right_wrist_x.pos"),
        (b'{"right_wrist_x.pos": 1' + 400 * b"0" + b"}", "too large"),
        (b"\xff\x00", ".+"),
        (3000 * b"[" + 3000 * b"]", ".+"),
        (b'{"right_wrist_r6_0.pos": 0, "right_wrist_r6_1.pos": 0, "right_wrist_r6_2.pos": 0}', ".+"),
    ],
)
def test_a_line_that_is_wrong_is_answered_so_and_takes_nothing(standing, talk, line, wrong):
    teleoperator, program, answers = talk
    (before,) = driven(standing, teleoperator, STEP)
    program.sendall(line + b"\n")
    (action,) = driven(standing, teleoperator, STEP)
    assert re.search(wrong, json.loads(answers.readline())["error"])
    assert action == before


def test_the_socket_is_its_owners_alone_and_a_program_that_says_too_much_is_sent_away(standing, talk, tmp_path):
    teleoperator, program, _ = talk
    assert stat.S_IMODE(os.stat(tmp_path / "hands").st_mode) == 0o600
    driven(standing, teleoperator, STEP)
    program.setblocking(False)
    with suppress(BlockingIOError):
        for _ in range(100):
            program.send(LINE_MAX * b"x")
    driven(standing, teleoperator, 3 * STEP)
    with socket.socket(socket.AF_UNIX) as other:
        other.connect(str(tmp_path / "hands"))
        other.sendall(b"{}\n")
        driven(standing, teleoperator, 2 * STEP)
        assert json.loads(other.makefile("rb").readline())["error"] == ""


def test_a_file_in_the_way_stays_and_a_socket_that_nobody_listens_to_does_not(standing, made, tmp_path):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(ConnectionError, match="no socket can be made there"):
        made(WholebodySocket, WholebodySocketConfig, path=str(tmp_path / "file"))
    assert (tmp_path / "file").read_text() == "mine"
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(tmp_path / "dead"))
    made(WholebodySocket, WholebodySocketConfig, path=str(tmp_path / "dead"))


def sent(client, **message):
    client.send(msgspec.msgpack.encode(message))


def test_hands_follow_the_handles_of_a_page_and_fingers_its_sliders(standing, made):
    teleoperator, begin = made(WholebodyPage, WholebodyPageConfig, port=0), standing.palms
    driven(standing, teleoperator, STEP)
    host, token = re.match(r"http://(.+)/(.+)", teleoperator.address).groups()
    uri, protocols = f"ws://{host}/{token}", [f"viser-v{viser.__version__}"]
    with connect(uri, max_size=None, subprotocols=protocols, proxy=None) as client:
        points = {"position": [1.0, 0.0, 1.0], "look_at": [0.0, 0.0, 1.0], "up_direction": [0.0, 0.0, 1.0]}
        numbers = {"fov": 1.0, "near": 0.01, "far": 100.0, "image_height": 400, "image_width": 600}
        turned = {"wxyz": [1.0, 0.0, 0.0, 0.0]}
        sent(client, type="ViewerCameraMessage", **points, **numbers, **turned)
        handle = {"name": "/handle/right"}
        sent(client, type="TransformControlsDragStartMessage", **handle)
        target = (begin[1] + [0.08, 0.0, 0.1]).tolist()
        for _ in range(60):
            sent(client, type="TransformControlsUpdateMessage", position=target, **handle, **turned)
            actions = driven(standing, teleoperator, 4 * STEP)
            if np.linalg.norm(standing.palms[1] - target) < 0.01:
                break
    assert largest_step(actions, "right") < 0.03
    np.testing.assert_allclose(standing.palms[1], target, atol=0.01)
    np.testing.assert_allclose(standing.palms[0], begin[0], atol=0.01)
