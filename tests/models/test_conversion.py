"""Conversions between MuJoCo, Pinocchio and motor order: round trips on any state, and the rotations by themselves."""

import time

import hypothesis.extra.numpy as arrays
import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models import RobotSpecError, g1
from models.conversion import Conversion, motor_to_pin, rotate, rotate_inverse, rotation_matrix
from models.mujoco_model import load_mujoco
from models.pinocchio_model import load_pinocchio

SPEC = g1()
MODEL = load_pinocchio(SPEC)
MJ_MODEL = load_mujoco(SPEC, scene="table_can")
CONVERT = Conversion(SPEC, MODEL, MJ_MODEL)

finite = st.floats(-50, 50, allow_nan=False, width=64)


def unit(values):
    norm = np.linalg.norm(values)
    return np.array([0.0, 0.0, 0.0, 1.0]) if norm < 1e-3 else values / norm


quaternions = arrays.arrays(float, 4, elements=st.floats(-1, 1)).map(unit)
near_identity = arrays.arrays(float, 3, elements=st.floats(-1e-8, 1e-8)).map(lambda u: unit(np.append(u, 1.0)))
near_pi = arrays.arrays(float, 3, elements=st.floats(-1, 1)).map(lambda u: unit(np.append(u, 1e-9)))
any_quaternion = st.one_of(quaternions, near_identity, near_pi)
vectors = arrays.arrays(float, 3, elements=finite)


@st.composite
def states(draw):
    joints = arrays.arrays(float, SPEC.n_joints, elements=finite)
    q = np.concatenate([draw(vectors), draw(any_quaternion), draw(joints)])
    return q, np.concatenate([draw(vectors), draw(vectors), draw(joints)])


@settings(max_examples=200, deadline=None)
@given(states())
def test_a_state_survives_the_round_trip(state):
    q, v = state
    qpos, qvel = np.zeros(MJ_MODEL.nq), np.zeros(MJ_MODEL.nv)
    CONVERT.to_mujoco(q, v, qpos, qvel)
    q_back, v_back = CONVERT.to_pinocchio(qpos, qvel)
    np.testing.assert_array_equal(q_back, q)
    np.testing.assert_allclose(v_back, v, rtol=0, atol=1e-12 * 100)


@settings(max_examples=100, deadline=None)
@given(states(), arrays.arrays(float, MODEL.nv, elements=finite))
def test_accelerations_and_forces_survive_the_round_trip(state, values):
    q, v = state
    target = np.zeros(MJ_MODEL.nv)
    CONVERT.acceleration_to_mujoco(q, v, values, target)
    np.testing.assert_allclose(CONVERT.acceleration_to_pinocchio(q, v, target), values, rtol=0, atol=1e-9)
    CONVERT.force_to_mujoco(q, values, target)
    np.testing.assert_allclose(CONVERT.force_to_pinocchio(q, target), values, rtol=0, atol=1e-10)


@settings(max_examples=100, deadline=None)
@given(any_quaternion, vectors, vectors)
def test_power_is_the_same_in_both_conventions(quat, velocity, force):
    q = pin.neutral(MODEL)
    q[3:7] = quat
    v, f = np.zeros(MODEL.nv), np.zeros(MODEL.nv)
    v[:3], f[:3] = velocity, force
    qpos, qvel, mj_force = np.zeros(MJ_MODEL.nq), np.zeros(MJ_MODEL.nv), np.zeros(MJ_MODEL.nv)
    CONVERT.to_mujoco(q, v, qpos, qvel)
    CONVERT.force_to_mujoco(q, f, mj_force)
    assert abs(mj_force @ qvel - f @ v) < 1e-9


@settings(max_examples=200, deadline=None)
@given(any_quaternion, vectors)
def test_rotations_are_those_of_pinocchio(quat, vector):
    R = pin.Quaternion(quat).toRotationMatrix()
    np.testing.assert_allclose(rotate(quat.tolist(), vector.tolist()), R @ vector, atol=1e-12)
    np.testing.assert_allclose(rotate_inverse(quat.tolist(), vector.tolist()), R.T @ vector, atol=1e-12)
    np.testing.assert_allclose(rotation_matrix(quat.tolist()), R, atol=1e-14)


def test_nan_is_not_hidden():
    qpos, qvel = np.zeros(MJ_MODEL.nq), np.zeros(MJ_MODEL.nv)
    qpos[4] = np.nan
    qvel[0] = 1.0
    q, v = CONVERT.to_pinocchio(qpos, qvel)
    assert np.isnan(q).any()
    assert np.isnan(v[:3]).any()


def test_motor_order_is_mapped_by_name():
    names = list(MODEL.names)[2:]
    motor = np.arange(SPEC.n_joints)
    by_pin = motor[motor_to_pin(SPEC, MODEL)]
    assert [SPEC.joint_names[i] for i in by_pin] == names
    np.testing.assert_array_equal(by_pin[CONVERT.pin_to_motor], motor)
    for i, name in enumerate(SPEC.joint_names):
        assert CONVERT.motor_qpos_index[i] == MJ_MODEL.joint(name).qposadr[0]
        assert CONVERT.motor_qvel_index[i] == MJ_MODEL.joint(name).dofadr[0]
        assert MJ_MODEL.actuator(int(CONVERT.actuator_index[i])).name == name


def test_actuators_are_in_motor_order():
    np.testing.assert_array_equal(CONVERT.actuator_index, np.arange(SPEC.n_joints))


def test_other_bodies_of_the_scene_are_left_alone():
    qpos, qvel = np.full(MJ_MODEL.nq, 7.0), np.full(MJ_MODEL.nv, 7.0)
    CONVERT.to_mujoco(pin.neutral(MODEL), np.zeros(MODEL.nv), qpos, qvel)
    np.testing.assert_array_equal(qpos[-7:], 7.0)
    np.testing.assert_array_equal(qvel[-6:], 7.0)


def test_a_model_without_the_robot_is_refused_by_name():
    empty = mujoco.MjSpec().compile()
    with pytest.raises(RobotSpecError, match="no joint 'base'"):
        Conversion(SPEC, MODEL, empty)


def test_reading_a_state_costs_little_beside_a_step_of_physics():
    """In processor time of the thread, by turns; measured 0.01."""
    data, shares = mujoco.MjData(MJ_MODEL), []
    for _ in range(5):
        seconds = []
        for work in (lambda: CONVERT.to_pinocchio(data.qpos, data.qvel), lambda: mujoco.mj_step(MJ_MODEL, data)):
            start = time.thread_time()
            for _ in range(500):
                work()
            seconds.append(time.thread_time() - start)
        shares.append(seconds[0] / seconds[1])
    assert min(shares) < 0.2
