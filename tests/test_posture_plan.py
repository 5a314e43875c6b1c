"""Strategy: the real planner on slow, fast and impossible paths; Pinocchio's inverse dynamics judges what it says."""

import numpy as np
import pinocchio as pin
import pytest

from models.g1 import g1
from policy.scripts import reach, two_hand_lift
from wholebody.posture_plan import GRAVITY, PosturePlanner

SPEC = g1()


@pytest.fixture(scope="module")
def planner():
    return PosturePlanner(SPEC)


def poses(policy, planner, start, end):
    t = np.arange(start, end, planner.config.dt)
    motion = policy.script(t)
    T = np.tile(np.eye(4), (len(t), 2, 1, 1))
    for i, side in enumerate("lr"):
        T[:, i, :3, :3], T[:, i, :3, 3] = getattr(motion, f"R_world_{side}hand"), getattr(motion, f"p_world_{side}palm")
    fingers = np.hstack([np.broadcast_to(q, (len(t), 7)) for q in (motion.q_lhand, motion.q_rhand)])
    return T, fingers


def plan(planner, T, fingers):
    return planner.plan(planner.q_stance, np.zeros(planner.model.nv), T, fingers)


def zero_moment_points(planner, motion):
    """From inverse dynamics of the planned motion, shape (K - 2, 2)."""
    model, data, dt = planner.model, planner.model.createData(), planner.config.dt
    points = []
    for k in range(1, len(motion.q) - 1):
        v, a = 0.5 * (motion.v[k] + motion.v[k + 1]), (motion.v[k + 1] - motion.v[k]) / dt
        wrench = pin.rnea(model, data, motion.q[k], v, a)[:6]
        R = pin.Quaternion(motion.q[k, 3:7]).toRotationMatrix()
        force = R @ wrench[:3]
        moment = R @ wrench[3:] + np.cross(motion.q[k, :3], force)
        points.append([-moment[1] / force[2], moment[0] / force[2]])
    return np.array(points)


@pytest.mark.parametrize(("x", "z"), [(0.40, 0.30), (0.45, 0.60), (0.50, 1.00)])
def test_reaches_are_planned_to_a_tenth_of_a_millimetre(planner, x, z):
    T, fingers = poses(reach(x, z), planner, 0.0, 4.0)
    motion = plan(planner, T, fingers)
    assert motion.failed == 0
    assert np.linalg.norm(motion.T_palms[-1, :, :3, 3] - T[-1, :, :3, 3], axis=1).max() < 1e-3


def test_the_plan_keeps_its_zero_moment_point_inside_as_inverse_dynamics_sees_it(planner):
    T, fingers = poses(two_hand_lift(), planner, 0.0, 6.0)
    motion = plan(planner, T, fingers)
    zmp = zero_moment_points(planner, motion)
    margin = np.min(planner.support.offsets - zmp @ planner.support.normals.T, axis=1)
    assert motion.failed == 0
    # The plan's rates are differences over a step, inverse dynamics takes them at its middle.
    assert np.percentile(margin, 1) > 0.0


def test_accelerations_speeds_and_joint_limits_hold_for_a_target_that_jumps(planner):
    T, fingers = poses(reach(), planner, 0.0, 2.0)
    T[20:, :, :3, 3] += [0.5, 0.5, -0.5]
    T[60:, :, :3, 3] -= [1.0, 1.0, -1.0]
    motion = plan(planner, T, fingers)
    c, names = planner.config, list(planner.model.names[2:])
    a = np.diff(motion.v[:, 6:], axis=0) / c.dt
    assert np.abs(a).max() < c.acceleration * 1.01
    for i, name in enumerate(names):
        joint = SPEC.joints[SPEC.index(name)]
        assert motion.q[:, 7 + i].min() > joint.position_min - 0.01, name
        assert motion.q[:, 7 + i].max() < joint.position_max + 0.01, name


def test_the_feet_stay_and_the_pelvis_keeps_its_tilt_and_height_for_targets_out_of_reach(planner):
    T, fingers = poses(reach(), planner, 0.0, 4.0)
    for target in ([1.5, 0.0, 0.9], [-0.8, 0.3, 0.5], [0.3, 0.2, -0.5], [0.2, 1.2, 2.0]):
        T[5:, :, :3, 3] = target
        motion = plan(planner, T, fingers)
        x, y = motion.q[:, 3], motion.q[:, 4]
        tilt = np.arccos(1.0 - 2.0 * (x * x + y * y))
        assert np.rad2deg(tilt.max()) < np.rad2deg(planner.config.pelvis_tilt) + 2.0
        assert motion.q[:, 2].min() > planner.config.height_min - 0.01
        data = planner.model.createData()
        for foot in SPEC.feet:
            frame = planner.model.getFrameId(foot.frame)
            start, end = (placed(planner.model, data, q, frame) for q in (motion.q[0], motion.q[-1]))
            assert np.linalg.norm(start - end) < 3e-3


def placed(model, data, q, frame):
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[frame].translation.copy()


def test_gravity_is_that_of_the_model(planner):
    assert -planner.model.gravity.linear[2] == pytest.approx(GRAVITY)
