"""Strategy: one error of the sensors at a time, on states made by hand whose feet stay where they are."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import load_pinocchio, stance_q
from wholebody.errors import InputError
from wholebody.estimation.odometry import StanceOdometry
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.sensors import REALISTIC, SensorConfig, Sensors
from wholebody.types import JointCommand, RobotState

SPEC = g1()
MODEL = load_pinocchio(SPEC)
DT = 0.002


def standing(time=0.0, v=None):
    return RobotState(time, stance_q(SPEC, MODEL), np.zeros(MODEL.nv) if v is None else v)


def measured(config, state=None):
    return Sensors(SPEC, config, DT).measure(state or standing())


def test_without_errors_a_standing_robot_is_measured_as_it_is():
    state = standing()
    answer = measured(SensorConfig(), state)
    assert np.allclose(answer.q, state.q, atol=1e-12)
    assert np.allclose(answer.v, state.v, atol=1e-12)
    assert answer.time == state.time


def test_a_tilt_bias_turns_the_base_by_its_angle_and_moves_it_about_the_feet():
    state, bias = standing(), np.deg2rad(0.3)
    answer = measured(SensorConfig(imu_bias=bias), state)
    turn = pin.log3(pin.Quaternion(answer.q[3:7]).toRotationMatrix() @ pin.Quaternion(state.q[3:7]).matrix().T)
    assert np.linalg.norm(turn) == pytest.approx(bias, rel=1e-6)
    assert abs(turn[2]) < 1e-9
    # About 0.7 m above the feet.
    assert np.linalg.norm(answer.q[:3] - state.q[:3]) == pytest.approx(0.7 * bias, rel=0.15)


def test_encoder_offsets_stay_the_same_and_noise_does_not():
    sensors = Sensors(SPEC, SensorConfig(encoder_offset=0.002), DT)
    first, second = (sensors.measure(standing(t)).q[7:] for t in (0.0, DT))
    assert np.array_equal(first, second)
    spread = np.std(first - standing().q[7:])
    assert 0.001 < spread < 0.003
    noisy = Sensors(SPEC, SensorConfig(encoder_noise=0.002), DT)
    assert not np.array_equal(noisy.measure(standing()).q[7:], noisy.measure(standing(DT)).q[7:])


def test_the_same_seed_gives_the_same_errors_again_after_a_reset():
    sensors = Sensors(SPEC, REALISTIC, DT)
    first = sensors.measure(standing())
    sensors.reset()
    again = sensors.measure(standing())
    assert np.array_equal(first.q, again.q)
    assert np.array_equal(first.v, again.v)


def test_the_velocity_filter_has_its_cut_off():
    sensors = Sensors(SPEC, SensorConfig(velocity_cutoff=40.0), DT)
    sensors.measure(standing())
    step = np.zeros(MODEL.nv)
    step[20] = 1.0
    time_constant = 1.0 / (2.0 * np.pi * 40.0)
    steps = round(time_constant / DT)
    for k in range(steps):
        answer = sensors.measure(standing((k + 1) * DT, step))
    assert answer.v[20] == pytest.approx(1.0 - np.exp(-steps * DT / time_constant), abs=1e-9)


def test_the_base_velocity_is_that_of_feet_that_stand():
    rng = np.random.default_rng(0)
    v = 0.2 * rng.standard_normal(MODEL.nv)
    state = standing(v=v)
    answer = measured(SensorConfig(), state)
    data = MODEL.createData()
    pin.forwardKinematics(MODEL, data, answer.q, answer.v)
    feet = [
        pin.getFrameVelocity(MODEL, data, MODEL.getFrameId(foot.frame), pin.LOCAL_WORLD_ALIGNED).linear
        for foot in SPEC.feet
    ]
    assert np.allclose(np.mean(feet, axis=0), 0.0, atol=1e-12)


@pytest.mark.parametrize("misjudged", [0.0, 0.004, -0.004])
def test_a_delayed_state_is_an_old_one_and_says_so(misjudged):
    sensors = Sensors(SPEC, SensorConfig(delay=0.01, delay_misjudged=misjudged), DT)
    speeds = []
    for k in range(10):
        v = np.zeros(MODEL.nv)
        v[20] = float(k)
        answer = sensors.measure(standing(k * DT, v))
        assert answer.time == pytest.approx(k * DT - 0.01 + misjudged)
        speeds.append(answer.v[20])
    assert speeds == [0, 0, 0, 0, 0, 0, 1, 2, 3, 4]


def test_a_lost_sample_is_the_one_before_again():
    sensors = Sensors(SPEC, SensorConfig(lost=0.2), DT)
    told = [sensors.measure(standing(k * DT)) for k in range(1000)]
    assert 0.15 < np.mean([one is before for before, one in pairwise(told)]) < 0.25


def test_gyro_bias_and_yaw_drift_are_in_the_readings():
    sensors = Sensors(SPEC, SensorConfig(gyro_bias=0.01, yaw_drift=0.1), DT)
    first, second = sensors.read(standing()), sensors.read(standing(1.0))
    assert np.array_equal(first.gyro, second.gyro)
    assert 0.0 < np.abs(first.gyro).max() < 0.05
    turn = pin.log3((pin.Quaternion(second.quat_xyzw) * pin.Quaternion(first.quat_xyzw).inverse()).matrix())
    assert 0.001 < abs(turn[2]) < 0.5
    assert np.allclose(turn[:2], 0.0)


def test_the_accelerometer_feels_what_that_of_mujoco_feels():
    plant, sensors = MujocoPlant(SPEC), Sensors(SPEC, SensorConfig(), DT)
    sensors.read(plant.reset())
    shaken = []
    for k in range(100):
        tau = np.zeros(SPEC.n_joints)
        tau[[3, 9]] = 40.0 * np.sin(0.2 * k)
        command = JointCommand(k * DT, np.array(SPEC.stance.joints), 0.0 * tau, tau, SPEC.kp, SPEC.kd)
        seen = sensors.read(plant.step(command)).acc
        np.testing.assert_allclose(seen, plant.data.sensor("imu_accelerometer").data, rtol=0.01, atol=0.05)
        shaken.append(seen)
    assert np.ptp(shaken, axis=0).max() > 1.0


def test_an_accelerometer_is_mounted_as_crookedly_as_the_imu_and_has_its_own_offset():
    still = [Sensors(SPEC, config, DT).read(standing()) for config in (SensorConfig(imu_bias=0.01), SensorConfig())]
    tilted = pin.Quaternion(still[0].quat_xyzw).matrix().T @ [0.0, 0.0, 9.81]
    np.testing.assert_allclose(still[0].acc, tilted, atol=1e-9)
    np.testing.assert_allclose(still[1].acc, [0.0, 0.0, 9.81], atol=1e-6)
    off = Sensors(SPEC, SensorConfig(acc_bias=0.1, acc_noise=0.001), DT)
    told = np.array([off.read(standing(k * DT)).acc - still[1].acc for k in range(500)])
    assert 0.01 < np.abs(told.mean(axis=0)).max() < 0.4
    np.testing.assert_allclose(told.std(axis=0), 0.001, rtol=0.2)


def test_a_lost_sample_never_reaches_the_estimator():
    class Counting(StanceOdometry):
        times = ()

        def estimate(self, readings):
            self.times += (readings.time,)
            return super().estimate(readings)

    counting = Counting(SPEC)
    sensors = Sensors(SPEC, SensorConfig(lost=0.2), DT, counting)
    told = [sensors.measure(standing(k * DT)).time for k in range(300)]
    assert len(counting.times) == len(set(told)) < 270


@pytest.mark.parametrize("value", [-0.1, np.nan, np.inf])
def test_senseless_settings_are_refused(value):
    with pytest.raises(InputError, match="imu_bias"):
        SensorConfig(imu_bias=value)
