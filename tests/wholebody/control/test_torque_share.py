"""Strategy: a share of the torques is the same torque at the motor; then a robot led by positions alone, whose motors
are deaf to torques, reaches.
"""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from policy.scripted.library import reach
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.config.robot import LED_BY_POSITION, GainsConfig, RobotConfig
from wholebody.control.torque_share import TorqueShare
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.robot_errors import RealisticPlant, RobotErrors
from wholebody.types import JointCommand

SPEC = g1()


def command(**changed):
    rng = np.random.default_rng(0)
    q = 0.5 * (SPEC.position_min + SPEC.position_max)
    tau = 0.02 * SPEC.effort_max * rng.uniform(-1.0, 1.0, SPEC.n_joints)
    return replace(JointCommand(1.0, q, 0.1 * tau, tau, SPEC.kp, SPEC.kd), **changed)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_the_torque_at_the_motor_is_the_same_for_every_share(share):
    whole = command()
    sent = TorqueShare(SPEC, share).of(whole)
    np.testing.assert_allclose(sent.tau, share * whole.tau)
    np.testing.assert_allclose(sent.tau + SPEC.kp * sent.q, whole.tau + SPEC.kp * whole.q, atol=1e-12)
    assert (sent.time, sent.dq is whole.dq, sent.kd is whole.kd) == (whole.time, True, True)


def test_positions_stay_in_the_range_of_their_joints():
    sent = TorqueShare(SPEC, 0.0).of(command(q=SPEC.position_max.copy(), tau=np.full(SPEC.n_joints, 5.0)))
    assert np.array_equal(sent.q, SPEC.position_max)


def test_a_joint_without_stiffness_keeps_its_torque():
    name = "left_elbow_joint"
    limp = SPEC.with_joints({name: {"kp": 0.0}})
    sent = TorqueShare(limp, 0.0).of(command(kp=limp.kp))
    i = SPEC.index(name)
    assert sent.tau[i] == command().tau[i]
    assert np.count_nonzero(sent.tau) == 1


def test_gains_are_those_of_their_own_below_a_whole_torque():
    ankle = SPEC.index("left_ankle_pitch_joint")
    assert describe(RobotConfig()).kp[ankle] == GainsConfig().ankle.kp
    led = describe(RobotConfig(torque=0.5))
    assert led.kp[ankle] == LED_BY_POSITION.ankle.kp
    legs = [i for i, name in enumerate(SPEC.joint_names) if any(part in name for part in ("hip", "knee", "ankle"))]
    assert 150.0 <= led.kp[legs].min() <= led.kp[legs].max() <= 250.0


def test_a_robot_whose_motors_are_deaf_to_torques_reaches_led_by_positions():
    config = ControllerConfig(robot=RobotConfig(torque=0.0))
    spec, policy = describe(config.robot), reach(0.45, 0.6)
    plant = RealisticPlant(spec, RobotErrors(feed_forward=0.0))
    episode = EpisodeConfig(settle=0.3, hold=0.5)
    result = run_episode(policy, Supervisor(spec, config), plant, duration=policy.duration, config=episode)
    assert result.fall is None
    assert result.errors[-1].max() < 0.001
