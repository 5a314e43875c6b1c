"""Strategy: the observer on torques by hand; then robots whose motors leave torque out or add some, told to nobody."""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from policy.scripted.library import reach
from tests.support.wide import wide
from wholebody.control.torque_loss import COMPARE_EVERY, MOST, SHARE_MIN, TorqueLoss
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.state import Robot
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.robot_errors import RealisticPlant, RobotErrors
from wholebody.types import JointCommand, RobotState

SPEC, DT = g1(), 0.002
ROBOT = Robot(SPEC)
N = SPEC.n_joints


def made_up(share, asked=10.0, seconds=1.0):
    """What is asked for beside a torque of which motors deliver a share, after a while; the observer."""
    loss, zero = TorqueLoss(SPEC, ROBOT.pin_to_motor, DT), np.zeros(N)
    before = RobotState(0.0, np.zeros(7 + N), np.zeros(6 + N))
    for _ in range(round(seconds / DT / COMPARE_EVERY)):
        wanted = np.minimum(asked, 0.3 * SPEC.effort_max)
        tau = wanted if loss.added is None else wanted * loss.factor + loss.added
        command = JointCommand(0.0, zero, zero, tau, SPEC.kp, SPEC.kd)
        loss.look(before, replace(before, tau=(share * command.tau)[ROBOT.motor_to_pin]), command)
    return tau - wanted, loss


def test_motors_that_deliver_what_they_are_asked_for_get_nothing_more():
    assert made_up(1.0)[1].added is None
    assert made_up(0.97)[1].added is None


@pytest.mark.parametrize("share", [0.5, 0.7, 1.3])
def test_what_is_left_out_is_made_up_for_up_to_the_slack(share):
    knee = SPEC.index("left_knee_joint")
    assert share * (10.0 + made_up(share, seconds=3.0)[0][knee]) == pytest.approx(10.0, abs=1.1)


@pytest.mark.parametrize("share", [0.5, 1.3])
def test_what_all_motors_leave_out_is_made_up_for_at_once_where_torques_change(share):
    factor = made_up(share)[1].factor
    assert factor == pytest.approx(np.full(N, 1.0 / share), rel=0.02)


def test_what_is_added_has_a_bound():
    _, loss = made_up(0.0, asked=100.0, seconds=5.0)
    assert (np.abs(loss.added) <= MOST * SPEC.effort_max + 1e-9).all()
    assert (loss.factor <= 1.0 / SHARE_MIN).all()


def most(share, most=np.inf, asked=10.0, seconds=1.0):
    """Shares of the motors' torques that are believed after a while, of motors that deliver a share, and no more."""
    loss, zero = TorqueLoss(SPEC, ROBOT.pin_to_motor, DT), np.zeros(N)
    before = RobotState(0.0, np.zeros(7 + N), np.zeros(6 + N))
    command = JointCommand(0.0, zero, zero, np.minimum(asked, SPEC.effort_max), SPEC.kp, SPEC.kd)
    told = np.clip(share * command.tau, -most, most)[ROBOT.motor_to_pin]
    for _ in range(round(seconds / DT / COMPARE_EVERY)):
        loss.look(before, replace(before, tau=told), command)
    return loss.most / SPEC.effort_max


def test_a_motor_that_delivers_half_of_what_others_do_is_believed_to_have_half_of_its_torque():
    waist = SPEC.index("waist_pitch_joint")
    delivers = np.where(np.arange(N) == waist, 0.5, 1.0)
    believed = most(delivers)
    assert believed[waist] == pytest.approx(0.5, abs=0.02)
    assert (np.delete(believed, waist) == 1.0).all()


@pytest.mark.parametrize("share", [0.5, 0.8, 1.0, 1.3])
def test_motors_that_all_deliver_a_share_are_believed_to_have_all_of_their_torque(share):
    assert (most(share) == 1.0).all()


def test_motors_that_have_less_than_their_limit_are_found_out_once_they_are_asked_for_it():
    half = np.where(np.arange(N) < 20, 0.5, 1.0) * SPEC.effort_max
    believed = most(1.0, most=half, asked=1e3)
    assert believed[:20] == pytest.approx(0.5, abs=0.02)
    assert (believed[20:] == 1.0).all()


@pytest.fixture(scope="module")
def supervisor():
    return Supervisor(SPEC)


@pytest.mark.parametrize(
    "errors",
    [
        {"feed_forward": 0.5},
        *wide(
            {"feed_forward": 1.3},
            {"delivered": ((".*_ankle_pitch_joint", 0.5),)},
            {"delivered": (("waist_pitch_joint", 0.5),)},
        ),
    ],
    ids=["half the feed-forward", "too much of it", "weak ankles", "a weak waist"],
)
def test_a_robot_whose_motors_leave_torque_out_reaches(supervisor, errors):
    policy, plant = reach(0.45, 0.6), RealisticPlant(SPEC, RobotErrors(**errors))
    result = run_episode(policy, supervisor, plant, duration=policy.duration, config=EpisodeConfig(hold=0.5))
    assert result.fall is None
    assert result.errors[-1].max() < 0.003
    assert supervisor.controller.added is not None


def test_the_robot_of_the_model_is_left_as_it_is(supervisor):
    policy = reach(0.45, 0.6)
    run_episode(policy, supervisor, MujocoPlant(SPEC), duration=policy.duration, config=EpisodeConfig(hold=0.5))
    assert supervisor.controller.added is None
