"""Strategy: readings are made of true states, in MuJoCo while the robot moves; the state is to be the true one."""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import load_pinocchio, stance_q
from wholebody.errors import InputError
from wholebody.estimation.odometry import StandingOdometry
from wholebody.estimation.readings import Readings
from wholebody.execution.supervisor import Supervisor
from wholebody.planning.posture import path_to, solve
from wholebody.sim.plant import MujocoPlant
from wholebody.types import RobotState, check_state

SPEC = g1()
MODEL = load_pinocchio(SPEC)
NAMES = list(MODEL.names)[2:]


def readings(state, yaw=0.0):
    """What sensors would say of a state: an IMU whose yaw is off."""
    quat = pin.Quaternion(pin.exp3(np.array([0.0, 0.0, yaw]))) * pin.Quaternion(state.q[3:7])
    return {
        "time": state.time,
        "joints": dict(zip(NAMES, state.q[7:].tolist(), strict=True)),
        "speeds": dict(zip(NAMES, state.v[6:].tolist(), strict=True)),
        "quat_xyzw": quat.coeffs().tolist(),
        "gyro": state.v[3:6].tolist(),
    }


def standing():
    return RobotState(1.5, stance_q(SPEC, MODEL), np.zeros(MODEL.nv))


@pytest.mark.parametrize("yaw", [0.0, 1.0, -3.0])
def test_a_robot_in_the_stance_is_where_it_is_whatever_the_yaw_of_its_imu(yaw):
    state = StandingOdometry(SPEC).state(**readings(standing(), yaw))
    assert state.time == 1.5
    np.testing.assert_allclose(state.q, standing().q, atol=1e-6)
    np.testing.assert_allclose(state.v, 0.0, atol=1e-12)


def test_order_and_other_joints_do_not_matter():
    given = readings(standing())
    given["joints"] = {"head_joint": 9.0} | dict(reversed(given["joints"].items()))
    np.testing.assert_allclose(StandingOdometry(SPEC).state(**given).q, standing().q, atol=1e-6)


def test_torques_are_in_the_order_of_the_joints_and_unknown_if_they_are_not_told():
    odometry, told = StandingOdometry(SPEC), np.arange(float(len(NAMES)))
    assert odometry.state(**readings(standing())).tau is None
    state = odometry.state(**readings(standing()), torques=dict(reversed(dict(zip(NAMES, told, strict=True)).items())))
    np.testing.assert_array_equal(state.tau, told)


def test_a_gyro_bias_is_learned_from_the_legs_and_a_yaw_that_drifts_does_not_matter():
    odometry, bias = StandingOdometry(SPEC, 0.02), np.array([0.01, -0.02, 0.03])
    state = standing()
    for k in range(1500):
        turned = pin.Quaternion(pin.exp3(np.array([0.0, 0.0, 1e-3 * k]))) * pin.Quaternion(state.q[3:7])
        seen = odometry.estimate(Readings(0.02 * k, turned.coeffs(), state.v[3:6] + bias, state.q[7:], state.v[6:]))
    np.testing.assert_allclose(odometry.bias, bias, atol=1e-4)
    np.testing.assert_allclose(seen.q, state.q, atol=1e-5)
    np.testing.assert_allclose(seen.v, state.v, atol=1e-3)


def test_noise_of_the_imu_is_smoothed_by_the_gyro():
    odometry, rng, state = StandingOdometry(SPEC, 0.002), np.random.default_rng(0), standing()
    offs = []
    for k in range(1000):
        noisy = pin.Quaternion(pin.exp3(0.002 * rng.standard_normal(3))).coeffs()
        seen = odometry.estimate(Readings(0.002 * k, noisy, state.v[3:6], state.q[7:], state.v[6:]))
        offs.append(pin.log3(pin.Quaternion(seen.q[3:7]).matrix())[:2])
    assert np.sqrt(np.mean(np.square(offs[300:]))) < 0.0003


def test_a_moving_robot_is_known_to_a_millimetre_and_its_velocity_to_a_centimetre_a_second():
    supervisor, plant, odometry = Supervisor(SPEC), MujocoPlant(SPEC), StandingOdometry(SPEC)
    state = plant.reset()
    supervisor.reset(state)
    wrists = [supervisor.robot.pose(tool.wrist_frame).homogeneous.copy() for tool in SPEC.tools]
    for T in wrists:
        T[:3, 3] += (0.15, 0.0, -0.25)
    supervisor.accept(path_to(solve(*wrists), state, duration=1.5).chunk)
    far = 0.0
    while state.time < 2.0:
        state = plant.step(supervisor.step(state))
        told = odometry.state(**readings(state, yaw=0.7))
        far = max(far, np.linalg.norm(state.q[:3] - standing().q[:3]))
        assert np.linalg.norm(told.q[:3] - state.q[:3]) < 2e-3
        assert (
            np.linalg.norm(pin.log3((pin.Quaternion(told.q[3:7]).inverse() * pin.Quaternion(state.q[3:7])).matrix()))
            < 2e-3
        )
        assert np.linalg.norm(told.v[:3] - state.v[:3]) < 0.02
    assert far > 0.05


@pytest.mark.parametrize("spoil", ["joint", "gyro", "norm", "quaternion"])
def test_readings_that_are_no_numbers_give_a_state_that_the_supervisor_bridges(spoil):
    given = readings(standing())
    if spoil == "joint":
        given["joints"]["left_knee_joint"] = np.nan
    elif spoil == "gyro":
        given["gyro"] = [0.0, np.inf, 0.0]
    else:
        given["quat_xyzw"] = [0.0, 0.0, 0.0, 0.0 if spoil == "norm" else np.nan]
    with pytest.raises(InputError):
        check_state(StandingOdometry(SPEC).state(**given), SPEC.n_joints)


def test_a_joint_that_is_missing_is_named():
    given = readings(standing())
    del given["speeds"]["waist_yaw_joint"]
    with pytest.raises(InputError, match="speeds lack waist_yaw_joint: 1 of 43"):
        StandingOdometry(SPEC).state(**given)


@pytest.mark.parametrize("wrong", [{"quat_xyzw": [0.0, 0.0, 1.0]}, {"gyro": [0.0]}])
def test_a_quaternion_or_angular_velocity_of_another_length_is_refused(wrong):
    with pytest.raises(InputError, match="of the pelvis are expected"):
        StandingOdometry(SPEC).state(**(readings(standing()) | wrong))
