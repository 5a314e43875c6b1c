"""Strategy: MuJoCo's own sensors are read while the robot moves, and the state is to be MuJoCo's; weights on the feet
are MuJoCo's contact forces, or Pinocchio's statics of a robot on one leg. The filter's motion of its error is held
against differences of its nonlinear motion, its rows against the Kalman filter as textbooks have it."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import load_pinocchio, stance_q
from wholebody.errors import InputError
from wholebody.estimation.kernels import invariant_filter as kernel
from wholebody.estimation.kernels.estimate import STEP_DRIFT
from wholebody.estimation.kernels.invariant_filter import PLACE
from wholebody.estimation.readings import Readings
from wholebody.estimation.state_estimator import StateEstimator
from wholebody.execution.supervisor import Supervisor
from wholebody.planning.posture import path_to, solve
from wholebody.robot.contact_schedule import Contacts, ContactSchedule
from wholebody.robot.feet import Feet
from wholebody.sim.plant import MujocoPlant
from wholebody.types import RobotState, check_state

SPEC = g1()
MODEL = load_pinocchio(SPEC)
NAMES = list(MODEL.names)[2:]
UP = np.array([0.0, 0.0, 9.81])


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


def standing(time=1.5):
    return RobotState(time, stance_q(SPEC, MODEL), np.zeros(MODEL.nv))


def still(time, *, quat=(0.0, 0.0, 0.0, 1.0), gyro=(0.0, 0.0, 0.0), acc=UP, q=None, tau=None):
    """Readings of a robot that stands still."""
    joints = standing().q[7:] if q is None else q
    return Readings(time, np.array(quat), np.array(gyro), joints, np.zeros(len(joints)), tau, np.array(acc))


def on_one_leg(side, q):
    """Torques of a robot in a configuration that stands still on one foot [N m], and its weight [N]."""
    data, foot = MODEL.createData(), next(foot for foot in SPEC.feet if foot.side == side)
    tau, frame = pin.rnea(MODEL, data, q, np.zeros(MODEL.nv), np.zeros(MODEL.nv)), MODEL.getFrameId(foot.frame)
    J = pin.computeFrameJacobian(MODEL, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
    wrench = np.linalg.solve(J[:, :6].T, tau[:6])
    return (tau - J.T @ wrench)[6:], wrench[2]


@pytest.mark.parametrize("yaw", [0.0, 1.0, -3.0])
def test_a_robot_in_the_stance_is_where_it_is_whatever_the_yaw_of_its_imu(yaw):
    state = StateEstimator(SPEC).state(**readings(standing(), yaw))
    assert state.time == 1.5
    np.testing.assert_allclose(state.q, standing().q, atol=1e-6)
    np.testing.assert_allclose(state.v, 0.0, atol=1e-12)


def test_order_and_other_joints_do_not_matter():
    given = readings(standing())
    given["joints"] = {"head_joint": 9.0} | dict(reversed(given["joints"].items()))
    np.testing.assert_allclose(StateEstimator(SPEC).state(**given).q, standing().q, atol=1e-6)


def test_torques_are_in_the_order_of_the_joints_and_unknown_if_they_are_not_told():
    estimator, told = StateEstimator(SPEC), np.arange(float(len(NAMES)))
    assert estimator.state(**readings(standing())).tau is None
    state = estimator.state(**readings(standing()), torques=dict(reversed(dict(zip(NAMES, told, strict=True)).items())))
    np.testing.assert_array_equal(state.tau, told)


def test_the_first_velocity_is_that_of_a_base_over_soles_that_stay():
    rng = np.random.default_rng(0)
    v = 0.3 * rng.standard_normal(MODEL.nv)
    told = StateEstimator(SPEC).state(**readings(RobotState(0.0, standing().q, v)))
    data, soles = MODEL.createData(), []
    pin.forwardKinematics(MODEL, data, told.q, told.v)
    for foot in SPEC.feet:
        frame = MODEL.frames[MODEL.getFrameId(foot.frame)]
        place = pin.SE3(np.eye(3), frame.placement.act(foot.sole_center))
        soles.append(place.actInv(data.v[frame.parentJoint]))
        soles[-1] = data.oMi[frame.parentJoint].rotation @ soles[-1].linear
    np.testing.assert_allclose(np.mean(soles, axis=0), 0.0, atol=1e-9)


def test_a_robot_that_moves_in_mujoco_is_known_from_mujocos_own_sensors():
    supervisor, plant = Supervisor(SPEC), MujocoPlant(SPEC)
    estimator, default = StateEstimator(SPEC, level_floor=False), StateEstimator(SPEC)
    state = plant.reset()
    supervisor.reset(state)
    wrists = [supervisor.robot.pose(tool.wrist_frame).homogeneous.copy() for tool in SPEC.tools]
    for T in wrists:
        T[:3, 3] += (0.15, 0.0, -0.25)
    supervisor.accept(path_to(solve(*wrists), state, duration=1.5).chunk)
    far, worst, without = 0.0, np.zeros(5), StateEstimator(SPEC)
    while state.time < 2.0:
        state = plant.step(supervisor.step(state))
        mujoco.mj_forward(plant.model, plant.data)
        quat, gyro, acc = (plant.data.sensor(f"imu_{name}").data.copy() for name in ("quat", "gyro", "accelerometer"))
        read = Readings(state.time, quat[[1, 2, 3, 0]], gyro, state.q[7:], state.v[6:], state.tau, acc)
        told, levelled = estimator.estimate(read), default.estimate(read)
        bare = without.estimate(Readings(state.time, quat[[1, 2, 3, 0]], gyro, state.q[7:], state.v[6:]))
        turn, other = (pin.Quaternion(one.q[3:7]).inverse() * pin.Quaternion(state.q[3:7]) for one in (told, levelled))
        off = (
            told.q[:3] - state.q[:3],
            pin.log3(turn.matrix()),
            told.v[:3] - state.v[:3],
            0.1 * (bare.v[:3] - state.v[:3]),
        )
        off += (pin.log3(other.matrix()),)
        worst = np.maximum(worst, [np.linalg.norm(one) for one in off])
        far = max(far, np.linalg.norm(state.q[:3] - standing().q[:3]))
        if state.time > 0.5:
            assert estimator.pressed.sum() == pytest.approx(plant.foot_load()[0], rel=0.1)
            assert list(estimator.stands) == [1, 1]
    assert far > 0.05
    assert np.all(worst < [1e-3, 1e-4, 0.02, 0.01, 3e-4])  # the last: soles that give under the robot


def test_a_gyro_bias_is_learned_and_a_yaw_that_drifts_does_not_matter():
    estimator, bias = StateEstimator(SPEC), np.array([0.01, -0.02, 0.03])
    for k in range(5000):
        turned = pin.Quaternion(pin.exp3(np.array([0.0, 0.0, 1e-3 * k]))).coeffs()
        seen = estimator.estimate(still(0.002 * k, quat=turned, gyro=bias))
    np.testing.assert_allclose(estimator.gyro_bias, bias, atol=2e-4)
    np.testing.assert_allclose(seen.q[:7], standing().q[:7], atol=2e-3)
    np.testing.assert_allclose(seen.v, 0.0, atol=1e-3)


def test_noise_is_smoothed_and_the_covariance_says_by_how_much():
    rng, offs, expected = np.random.default_rng(0), [], []
    estimator = StateEstimator(SPEC)
    for k in range(2000):
        noisy = pin.Quaternion(pin.exp3(0.002 * rng.standard_normal(3))).coeffs()
        gyro, acc = 0.01 * rng.standard_normal(3), UP + 0.4 * rng.standard_normal(3)
        seen = estimator.estimate(still(0.002 * k, quat=noisy, gyro=gyro, acc=acc))
        offs.append([*pin.log3(pin.Quaternion(seen.q[3:7]).matrix())[:2], *seen.v[:3]])
        expected.append(np.sqrt(seen.covariance.diagonal()[[0, 1, 3, 4, 5]]))
    # Otherwise rounding would grow, slowly at first, until nothing is left of the filter after some minutes.
    assert np.array_equal(estimator._memory.P, estimator._memory.P.T)
    found = np.sqrt(np.mean(np.square(offs[1000:]), axis=0))
    assert np.all(found[:2] < 3e-4)
    assert np.all(found / expected[-1] < 1.5)
    assert np.all(found / expected[-1] > 0.1)


@pytest.mark.parametrize(
    ("slope", "wrong", "level_floor", "tilt"),
    [(0.0, 0.01, True, 0.003), (0.0, 0.01, False, 0.01), (0.05, 0.0, True, 0.0), (0.002, 0.0, True, -0.0014)],
)
def test_a_floor_that_looks_nearly_level_says_what_is_vertical_and_a_slope_does_not(slope, wrong, level_floor, tilt):
    estimator, q, rng = StateEstimator(SPEC, level_floor=level_floor), standing().q[7:], np.random.default_rng(0)
    q[[NAMES.index(f"{side}_ankle_pitch_joint") for side in ("left", "right")]] += slope
    for k in range(round(estimator.settling / 0.002)):
        turn = np.array([0.0, wrong, 0.0]) + 0.002 * rng.standard_normal(3)
        told = estimator.estimate(still(0.002 * k, quat=pin.Quaternion(pin.exp3(turn)).coeffs(), q=q))
    assert pin.log3(pin.Quaternion(told.q[3:7]).matrix())[1] == pytest.approx(tilt, abs=5e-4)


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_foot_that_carries_nothing_is_not_stood_on_and_moves_nothing_when_it_moves(side):
    estimator, foot = StateEstimator(SPEC), ("left", "right").index(side)
    tau, weight = on_one_leg(side, standing().q)
    for k in range(100):
        seen = estimator.estimate(still(0.002 * k, tau=tau))
    assert estimator.stands[foot]
    assert not estimator.stands[1 - foot]
    assert seen.stands == tuple(bool(stands) for stands in estimator.stands)
    assert estimator.pressed[foot] == pytest.approx(weight, rel=0.01)
    assert abs(estimator.pressed[1 - foot]) < 1.0
    q, hip = standing().q[7:], NAMES.index(f"{('right', 'left')[foot]}_hip_pitch_joint")
    for k in range(100, 200):
        q[hip] -= 0.003
        moved = estimator.estimate(still(0.002 * k, q=q, tau=tau))
    np.testing.assert_allclose(moved.q[:7], seen.q[:7], atol=1e-3)


def test_a_foot_that_is_set_down_adds_what_encoders_that_are_off_make_of_a_step():
    """What stays wrong adds up from step to step, where noise would by its square root."""
    estimator, sure = StateEstimator(SPEC), []
    both, left = (Contacts(Feet.of([pin.SE3.Identity()] * 2), load) for load in ((1.0, 1.0), (1.0, 0.0)))
    for k in range(1001):
        estimator.expect(ContactSchedule((left if k % 50 >= 25 else both,)))
        seen = estimator.estimate(still(0.002 * k))
        if k % 250 == 0:
            sure.append(np.sqrt(seen.covariance[PLACE, PLACE]))
    for landings, one in zip((10, 15, 20), sure[2:], strict=True):
        assert one == pytest.approx(landings * STEP_DRIFT, rel=0.1)
    np.testing.assert_allclose(seen.q, standing().q, atol=1e-6)
    anew = estimator.estimate(still(3.0)).covariance
    assert np.sqrt(anew[PLACE, PLACE]) == pytest.approx(sure[0])


def test_readings_that_are_not_newer_change_nothing_and_after_a_gap_it_begins_anew():
    estimator, bias = StateEstimator(SPEC), np.array([0.0, 0.0, 0.02])
    for k in range(500):
        seen = estimator.estimate(still(0.002 * k, gyro=bias))
    again = estimator.estimate(still(0.002 * 490, gyro=bias))
    assert again.time == 0.98
    np.testing.assert_allclose(again.q, seen.q, atol=1e-9)
    anew = estimator.estimate(still(2.0, gyro=bias))
    np.testing.assert_allclose(anew.q, standing().q, atol=1e-6)
    assert np.abs(estimator.gyro_bias[2] - 0.02) < 0.005


@pytest.mark.parametrize("spoil", ["joint", "gyro", "norm", "quaternion"])
def test_readings_that_are_no_numbers_give_a_state_that_the_supervisor_bridges(spoil):
    estimator, given = StateEstimator(SPEC), readings(standing())
    if spoil == "joint":
        given["joints"]["left_knee_joint"] = np.nan
    elif spoil == "gyro":
        given["gyro"] = [0.0, np.inf, 0.0]
    else:
        given["quat_xyzw"] = [0.0, 0.0, 0.0, 0.0 if spoil == "norm" else np.nan]
    with pytest.raises(InputError):
        check_state(estimator.state(**given), SPEC.n_joints)
    np.testing.assert_allclose(estimator.state(**readings(standing(1.502))).q, standing().q, atol=1e-6)


def test_a_joint_that_is_missing_is_named():
    given = readings(standing())
    del given["speeds"]["waist_yaw_joint"]
    with pytest.raises(InputError, match="speeds lack waist_yaw_joint: 1 of 43"):
        StateEstimator(SPEC).state(**given)


@pytest.mark.parametrize("wrong", [{"quat_xyzw": [0.0, 0.0, 1.0]}, {"gyro": [0.0]}, {"acc": [9.81]}])
def test_a_quaternion_or_a_vector_of_another_length_is_refused(wrong):
    with pytest.raises(InputError, match="of the pelvis are expected"):
        StateEstimator(SPEC).state(**(readings(standing()) | wrong))


def element(rng):
    """A state of the filter as it is inside, its covariance any positive definite one, and what IMU and biases say."""
    A, x, n = rng.standard_normal((kernel.SIZE, kernel.SIZE)), rng.standard_normal(7), kernel.SIZE
    x[3:] /= np.linalg.norm(x[3:])
    parts = {"x": x, "v": rng.standard_normal(3), "d": rng.standard_normal((2, 3)), "P": A @ A.T}
    parts |= {"gyro_bias": np.zeros(3), "acc_bias": np.zeros(3), "gravity": np.array([0.0, 0.0, -9.81])}
    parts |= {"gyro": rng.standard_normal(3), "felt": 10.0 * rng.standard_normal(3), "stands": np.array([1, 0])}
    parts |= {"noise": rng.uniform(0.1, 1.0, 7), "B": np.zeros((15, 3)), "K": np.zeros(n), "xi": np.zeros(n)}
    parts |= {"Rw": pin.Quaternion(x[3:]).matrix(), "Re": np.zeros((3, 3)), "E": np.zeros(7)}
    return SimpleNamespace(**parts)


def copied(memory):
    return SimpleNamespace(**{name: value.copy() for name, value in vars(memory).items()})


def error(true, seen):
    """The error that leads from one state to another one near it, as the filter has it."""
    R = pin.Quaternion(true.x[3:]).matrix() @ pin.Quaternion(seen.x[3:]).matrix().T
    places = [(true.v, seen.v), (true.x[:3], seen.x[:3]), (true.d[0], seen.d[0]), (true.d[1], seen.d[1])]
    shifts = [a - R @ b for a, b in places]
    return np.concatenate([pin.log3(R), *shifts, true.gyro_bias - seen.gyro_bias, true.acc_bias - seen.acc_bias])


def test_the_error_moves_as_two_states_near_each_other_move_apart():
    rng, dt, eps = np.random.default_rng(1), 1e-4, 1e-6
    for _ in range(5):
        seen = element(rng)
        for column in range(kernel.SIZE):
            true, other = copied(seen), copied(seen)
            true.xi[column] = eps
            kernel.correct(true)
            np.testing.assert_allclose(error(true, seen), eps * np.eye(kernel.SIZE)[column], atol=1e-9)
            true.gyro -= true.gyro_bias
            true.felt -= true.acc_bias
            kernel.move(true, dt, True)
            kernel.move(other, dt, True)
            # One column of F, by the filter's own way: F P F' of the error alone.
            row = copied(seen)
            row.P[:], row.noise[:] = 0.0, 0.0
            row.P[column, column] = 1.0
            kernel.spread(row, dt, True)
            found, expected = error(true, other) / eps, row.P[:, column] / max(row.P[column, column], 1e-12)
            np.testing.assert_allclose(found, expected, atol=30.0 * dt**2 + 1e-4 * dt + 1e-7)


def test_noise_of_the_gyro_moves_what_lies_off_the_origin_and_rows_are_taken_in_as_in_a_kalman_filter():
    rng, dt = np.random.default_rng(2), 1e-3
    one = element(rng)
    before = one.P.copy()
    one.noise[1:] = 0.0
    share, moved = one.noise[0], copied(one)
    kernel.spread(one, dt, True)
    moved.noise[:] = 0.0
    kernel.spread(moved, dt, True)
    levers = [np.eye(3), *(pin.skew(place) for place in (one.v, one.x[:3], one.d[0], one.d[1]))]
    G = np.vstack([*(lever @ one.Rw for lever in levers), np.zeros((6, 3))])
    np.testing.assert_allclose(one.P - moved.P, dt * share * G @ G.T, atol=1e-12)
    one.P[:] = before
    H, xi = np.zeros(kernel.SIZE), rng.standard_normal(kernel.SIZE)
    H[9], H[6], one.xi[:] = 1.0, -1.0, xi
    kernel.look(one, 9, 6, 0.7, 0.3)
    K = before @ H / (H @ before @ H + 0.3)
    np.testing.assert_allclose(one.xi, xi + K * (0.7 - H @ xi), atol=1e-10)
    np.testing.assert_allclose(one.P, before - np.outer(K, H @ before), atol=1e-10)
