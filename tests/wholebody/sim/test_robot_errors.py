"""Strategy: one error of the model at a time on a plant; then the realistic robot as a whole, in the loop."""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from policy.scripted.library import reach
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.errors import InputError
from wholebody.estimation.state_estimator import StateEstimator
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.second_order import second_order_step
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.robot_errors import REALISTIC_ROBOT, RealisticPlant, RobotErrors
from wholebody.sim.sensors import REALISTIC_READINGS, SensorConfig, Sensors
from wholebody.types import JointCommand

SPEC = g1()
ZERO = np.zeros(SPEC.n_joints)


def push(plant, tau):
    """The torque of the left elbow after each of five periods in which it is asked for that much [N m]."""
    elbow, given = SPEC.index("left_elbow_joint"), []
    for _ in range(5):
        asked = ZERO.copy()
        asked[elbow] = tau
        plant.step(JointCommand(plant.data.time, ZERO, ZERO, asked, ZERO, ZERO))
        given.append(plant.torque[elbow])
    return given


def test_without_errors_it_is_the_plant_of_the_model():
    plant, model = RealisticPlant(SPEC, RobotErrors()), MujocoPlant(SPEC)
    assert push(plant, 2.0) == push(model, 2.0) == [2.0] * 5
    assert np.array_equal(plant.state().q, model.state().q)


def test_torques_lag_and_commands_are_late():
    share = 1.0 - np.exp(-0.002 / 0.003)
    lagging = push(RealisticPlant(SPEC, RobotErrors(torque_lag=0.003)), 2.0)
    np.testing.assert_allclose(lagging, 2.0 * (1.0 - (1.0 - share) ** np.arange(1, 6)))
    late = RealisticPlant(SPEC, RobotErrors(command_delay=(0.004, 0.004)))
    late.step(JointCommand(0.0, ZERO, ZERO, ZERO, ZERO, ZERO))
    assert push(late, 2.0) == [0.0, 0.0, 2.0, 2.0, 2.0]


def test_second_order_motors_overshoot_by_what_their_damping_says_and_settle():
    plant, peak = RealisticPlant(SPEC, RobotErrors(motor_bandwidth=25.0, motor_damping=0.5)), []
    for _ in range(30):
        peak += push(plant, 1.0)
    assert peak[0] < 0.1
    # exp(-pi zeta / sqrt(1 - zeta^2)) after half a damped period.
    assert max(peak) == pytest.approx(1.0 + np.exp(-np.pi * 0.5 / np.sqrt(0.75)), abs=0.005)
    assert 0.002 * (1 + int(np.argmax(peak))) == pytest.approx(np.pi / (2 * np.pi * 25.0 * np.sqrt(0.75)), abs=0.002)
    assert peak[-1] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("damping", [0.3, 1.0, 3.0])
def test_a_step_of_second_order_is_that_of_its_differential_equation(damping):
    A, b = second_order_step(100.0, damping, 0.002)
    x, fine = np.zeros(2), 1e-6
    for _ in range(2000):
        x = x + fine * np.array([x[1], 100.0**2 * (1.0 - x[0]) - 2.0 * damping * 100.0 * x[1]])
    np.testing.assert_allclose(b, x, rtol=1e-3)
    np.testing.assert_allclose(A @ [1.0, 0.0] + b, [1.0, 0.0], atol=1e-12)


def test_motors_deliver_a_share_and_tell_it_or_not():
    weak = {"delivered": ((".*_elbow_joint", 0.5),)}
    plant = RealisticPlant(SPEC, RobotErrors(**weak))
    assert push(plant, 2.0) == [1.0] * 5
    assert plant.state().tau[plant._conversion.pin_to_motor[SPEC.index("left_elbow_joint")]] == 1.0
    plant = RealisticPlant(SPEC, RobotErrors(**weak, loss_told=False))
    assert push(plant, 2.0) == [1.0] * 5
    assert plant.state().tau[plant._conversion.pin_to_motor[SPEC.index("left_elbow_joint")]] == 2.0
    with pytest.raises(InputError, match="no joint is called 'elbow'"):
        RealisticPlant(SPEC, RobotErrors(delivered=(("elbow", 0.5),)))


def test_deaf_motors_leave_torques_out_and_keep_their_position_loops():
    plant = RealisticPlant(SPEC, RobotErrors(feed_forward=0.0))
    assert push(plant, 2.0) == [0.0] * 5
    plant.step(JointCommand(0.0, plant.joint_positions() + 0.01, ZERO, ZERO, SPEC.kp, ZERO))
    np.testing.assert_allclose(plant.torque, 0.01 * SPEC.kp, atol=1e-9)


def test_masses_friction_and_loads_are_those_drawn_and_the_same_for_the_same_seed():
    plant, again = (RealisticPlant(SPEC, REALISTIC_ROBOT) for _ in range(2))
    model = MujocoPlant(SPEC).model
    other = RealisticPlant(SPEC, replace(REALISTIC_ROBOT, seed=1))
    assert np.array_equal(plant.model.body_mass, again.model.body_mass)
    assert plant.payload_kg == again.payload_kg != other.payload_kg
    names = [model.body(b).name for b in range(1, model.nbody) if model.body_mass[b] > 0.0]
    factors = np.array([plant.model.body(name).mass[0] / model.body(name).mass[0] for name in names])
    assert 0.95 <= factors.min() < 0.97 < 1.03 < factors.max() <= 1.05
    assert np.abs(plant.model.body("torso_link").ipos - model.body("torso_link").ipos).max() <= 0.01
    for joint, friction in (("left_knee_joint", 0.2), ("left_wrist_yaw_joint", 0.1), ("left_hand_index_0_joint", 0.1)):
        assert plant.model.joint(joint).frictionloss[0] == friction
    assert plant.model.geom_friction[plant.model.geom_priority == 1, 0] == pytest.approx(0.6)


def test_motors_close_their_loops_on_what_the_encoders_read():
    sensors = Sensors(SPEC, SensorConfig(encoder_offset=0.01), 0.002)
    plant = RealisticPlant(SPEC, RobotErrors(), encoders=sensors)
    sensors.measure(plant.reset())
    plant.step(JointCommand(0.0, plant.joint_positions().copy(), ZERO, ZERO, SPEC.kp, ZERO))
    wanted = -SPEC.kp * sensors.encoder_error[plant._conversion.pin_to_motor]
    np.testing.assert_allclose(plant.torque, np.clip(wanted, -SPEC.effort_max, SPEC.effort_max), atol=1e-9)


@pytest.mark.parametrize(
    "changed",
    [{"mass_error": -0.1}, {"torque_lag": np.nan}, {"command_delay": (0.0, 1.0)}, {"delivered": (("x", -1.0),)}],
)
def test_senseless_errors_are_refused(changed):
    with pytest.raises(InputError, match=next(iter(changed))):
        RobotErrors(**changed)


def test_the_realistic_robot_without_a_load_reaches():
    sensors = Sensors(SPEC, REALISTIC_READINGS, 0.002, StateEstimator(SPEC))
    plant = RealisticPlant(SPEC, replace(REALISTIC_ROBOT, payload_max=0.0), encoders=sensors)
    config = EpisodeConfig(settle=0.3, hold=0.5)
    result = run_episode(reach(0.45, 0.9), Supervisor(SPEC), plant, duration=3.2, config=config, sensors=sensors)
    assert result.fall is None
    assert result.errors[-1].max() < 0.015
    assert "state_stale" not in result.reasons
