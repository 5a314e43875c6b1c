"""Strategy: gains by how motors answer; then robots with slow motors and late commands, of which nobody told, reach.
Without the watch each of these falls (`benchmarks/motors.py`).
"""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from policy.scripted.library import reach
from tests.support.wide import wide
from wholebody.bench.torque_loop import EIGENVALUE_MAX, Motors, linearised
from wholebody.config import ControllerConfig
from wholebody.config.robot import RobotConfig
from wholebody.control.gains import GainSchedule, inertia_of_joints
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.estimation.motor_response import MotorResponse
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.state import Robot
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.robot_errors import RealisticPlant, RobotErrors
from wholebody.types import JointCommand

SPEC = g1()
POLICY = reach(0.45, 0.6)


def schedule(**robot):
    return GainSchedule(SPEC, Robot(SPEC), ControllerConfig(robot=RobotConfig(**robot)))


@pytest.fixture(scope="module")
def supervisor():
    return Supervisor(SPEC)


def run(supervisor, plant, hold=0.5):
    config = EpisodeConfig(settle=0.5, hold=hold)
    return run_episode(POLICY, supervisor, plant, duration=POLICY.duration, config=config)


def test_quick_motors_keep_the_gains_of_the_configuration():
    for response in (MotorResponse(), MotorResponse(lag=0.003, delay=0.004), MotorResponse(lag=0.006, delay=0.004)):
        gains, config = schedule().gains(response), ControllerConfig()
        assert gains.kp is SPEC.kp
        assert (gains.hand_kp, gains.hand_kd) == (config.hand.kp, config.hand.kd)
        assert (gains.finger_kp, gains.finger_kd) == (config.body.finger_kp, config.body.finger_kd)


def test_slower_motors_get_lower_gains_and_never_higher_ones():
    before = schedule().gains(MotorResponse())
    for hz in (60.0, 40.0, 25.0, 15.0):
        gains = schedule().gains(MotorResponse(bandwidth=hz))
        for name, value in vars(gains).items():
            assert np.all(value <= getattr(before, name))
        before = gains
    late = schedule().gains(MotorResponse(delay=0.03))
    assert late.kp is SPEC.kp
    assert late.hand_kd == pytest.approx(20.0)
    assert late.hand_kp == pytest.approx(100.0)


def test_motors_that_are_led_by_positions_keep_their_loops():
    assert schedule(torque=0.5).gains(MotorResponse(bandwidth=20.0)).kp is SPEC.kp


def test_inertias_are_those_of_the_robot_and_those_of_stood_on_joints_are_larger():
    robot = Robot(SPEC)
    inertia = inertia_of_joints(SPEC, robot.model)
    assert (inertia >= robot.model.armature[6:] * (1.0 - 1e-9)).all()
    joint = {name: inertia[i] for i, name in enumerate(robot.joint_names)}
    assert joint["left_wrist_roll_joint"] < 0.01 < joint["left_elbow_joint"] < 0.1 < joint["left_ankle_pitch_joint"]
    np.testing.assert_allclose(joint["left_elbow_joint"], joint["right_elbow_joint"], rtol=1e-2)


@pytest.mark.regression
@pytest.mark.parametrize("hz", [20.0, 40.0])
def test_the_linearised_loop_stands_with_the_gains_for_its_motors(supervisor, hz):
    plant = MujocoPlant(SPEC)
    run(supervisor, plant, hold=2.0)
    controller, row = supervisor.controller, supervisor._follower.row
    assert linearised(controller, plant, row).radius(Motors(bandwidth=hz)) > EIGENVALUE_MAX
    plant = MujocoPlant(SPEC)
    run(supervisor, plant, hold=2.0)
    controller.set_gains(schedule().gains(MotorResponse(bandwidth=hz)))
    slow = Motors(bandwidth=hz)
    loop = linearised(controller, plant, row)
    assert loop.radius(slow) <= EIGENVALUE_MAX
    assert loop.phase_margin(slow) > 5.0


@pytest.mark.parametrize(
    "errors",
    [
        *wide({"motor_bandwidth": 20.0}, {"command_delay": (0.03, 0.03)}),
        {"motor_bandwidth": 30.0, "command_delay": (0.01, 0.01)},
    ],
    ids=["20 Hz", "30 ms", "30 Hz and 10 ms"],
)
def test_a_robot_with_slow_motors_reaches_and_says_how_slow_they_are(supervisor, errors):
    result = run(supervisor, RealisticPlant(SPEC, RobotErrors(**errors)))
    assert result.fall is None
    assert result.errors[-1].max() < 0.003
    response = supervisor.motors.response
    assert response.bandwidth == errors.get("motor_bandwidth", 0.0)
    assert response.delay == pytest.approx(errors.get("command_delay", (0.0,))[0], abs=0.0021)


def test_a_reset_forgets_slow_motors(supervisor):
    run(supervisor, RealisticPlant(SPEC, RobotErrors(motor_bandwidth=25.0)))
    assert supervisor.controller.kd is not SPEC.kd
    plant = MujocoPlant(SPEC)
    supervisor.reset(plant.reset())
    assert supervisor.motors.response == MotorResponse()
    assert supervisor.controller.kd is SPEC.kd
    assert supervisor.motors.arrival(1.0) == 1.0


def test_commands_are_led_ahead_step_by_step(supervisor):
    supervisor.reset(MujocoPlant(SPEC).reset())
    watch = supervisor.motors
    watch.observer.response = MotorResponse(delay=0.01)
    arrivals = [watch.arrival(0.002 * k) - 0.002 * k for k in range(100)]
    assert np.diff(arrivals).max() <= 0.2 * 0.002 + 1e-12
    assert arrivals[-1] == pytest.approx(0.01)
    assert watch.sent(arrivals[-1]) == pytest.approx(0.0)
    supervisor.reset(MujocoPlant(SPEC).reset())


@pytest.mark.parametrize("age", [0, 10])
def test_torques_of_an_old_state_are_compared_with_the_command_of_its_time(supervisor, age):
    """They were with the newest one: what a motion asks for now seemed to have been left out before."""
    state = MujocoPlant(SPEC).reset()
    supervisor.reset(state)
    watch, controller, dt = supervisor.motors, supervisor.controller, supervisor.controller.config.dt
    order, zero = supervisor.robot.pin_to_motor, np.zeros(SPEC.n_joints)

    def torque(k):
        return 0.5 * SPEC.effort_max * np.sin(2.0 * np.pi * 2.0 * dt * k)

    for k in range(300):
        told = torque(k - age - 1)[supervisor.robot.motor_to_pin]
        watch.look(replace(state, time=dt * (k - age), tau=told), dt * k)
        assert controller.added is None
        controller.command = JointCommand(dt * (k - age), state.q[7:][order], zero, torque(k), SPEC.kp, SPEC.kd)
    supervisor.reset(state)
