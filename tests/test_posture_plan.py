"""Strategy: the real planner on slow, fast and impossible paths; Pinocchio's inverse dynamics judges what it says, and
differences of the program's rows judge its derivatives."""

import numpy as np
import pinocchio as pin
import pytest

from models.g1 import g1
from policy.scripts import lissajous, reach, two_hand_lift
from wholebody.config import PosturePlanConfig
from wholebody.posture import knots as at
from wholebody.posture.knots import N_BODY, N_FREE, Knots
from wholebody.posture.program import Program
from wholebody.posture_plan import PosturePlanner

SPEC = g1()


@pytest.fixture(scope="module")
def planner():
    return PosturePlanner(SPEC)


@pytest.fixture(scope="module")
def knots():
    return Knots(SPEC, PosturePlanConfig())


def poses(policy, dt, start, end):
    t = np.arange(start, end, dt)
    motion = policy.script(t)
    T = np.tile(np.eye(4), (len(t), 2, 1, 1))
    for i, side in enumerate("lr"):
        T[:, i, :3, :3], T[:, i, :3, 3] = getattr(motion, f"R_world_{side}hand"), getattr(motion, f"p_world_{side}palm")
    fingers = np.hstack([np.broadcast_to(q, (len(t), 7)) for q in (motion.q_lhand, motion.q_rhand)])
    return T, fingers


def plan(planner, policy, end):
    T, fingers = poses(policy, planner.config.dt, 0.0, end)
    return T, planner.plan(planner.q_stance, np.zeros(planner.model.nv), T, fingers)


def inverse_dynamics(planner, motion):
    """Zero-moment points (K - 2, 2) and joint torques (K - 2, nv - 6) of a planned motion."""
    model, data, dt = planner.model, planner.model.createData(), planner.config.dt
    points, torques = [], []
    for k in range(1, len(motion.q) - 1):
        v, a = 0.5 * (motion.v[k] + motion.v[k + 1]), (motion.v[k + 1] - motion.v[k]) / dt
        tau = pin.rnea(model, data, motion.q[k], v, a)
        R = pin.Quaternion(motion.q[k, 3:7]).toRotationMatrix()
        force = R @ tau[:3]
        moment = R @ tau[3:6] + np.cross(motion.q[k, :3], force)
        points.append([-moment[1] / force[2], moment[0] / force[2]])
        torques.append(tau[6:].copy())
    return np.array(points), np.array(torques)


@pytest.mark.parametrize(("x", "z"), [(0.40, 0.30), (0.45, 0.60), (0.50, 1.00)])
def test_reaches_are_planned_to_millimetres_with_every_bound_kept(planner, x, z):
    T, motion = plan(planner, reach(x, z), 4.0)
    assert np.linalg.norm(motion.T_palms[-1, :, :3, 3] - T[-1, :, :3, 3], axis=1).max() < 3e-3
    assert motion.excess.max() < 3.0


@pytest.mark.parametrize(("policy", "end"), [(two_hand_lift(), 4.0), (lissajous(), 4.0)])
def test_inverse_dynamics_finds_balance_and_waist_torque_inside_their_bounds(planner, policy, end):
    _, motion = plan(planner, policy, end)
    zmp, torques = inverse_dynamics(planner, motion)
    margin = np.min(planner.support.offsets - zmp @ planner.support.normals.T, axis=1)
    waist = [planner.model.joints[planner.model.getJointId(f"waist_{x}_joint")].idx_v - 6 for x in ("roll", "pitch")]
    assert margin.min() > planner.config.zmp_margin - 3e-3
    assert np.abs(torques[:, waist]).max() < 35.0 * (planner.config.torque_share + 0.06)
    # What the planner says of itself is what inverse dynamics says; its fingers are locked where the stance has them.
    assert np.allclose(motion.zmp[1:-1], zmp, atol=2e-3)


def test_a_motion_of_one_metre_a_second_is_planned_within_millimetres(planner):
    T, motion = plan(planner, lissajous(), 4.0)
    error = np.linalg.norm(motion.T_palms[:, :, :3, 3] - T[:, :, :3, 3], axis=2)
    # The path stops dead at its end, which nothing can follow.
    assert error[:-30].max() < 5e-3


def test_a_jump_of_the_target_breaks_no_joint_limit(planner):
    T, fingers = poses(reach(), planner.config.dt, 0.0, 2.0)
    T[20:, :, :3, 3] += [0.5, 0.5, -0.5]
    T[40:, :, :3, 3] -= [1.0, 1.0, -1.0]
    motion = planner.plan(planner.q_stance, np.zeros(planner.model.nv), T, fingers)
    for i, name in enumerate(list(planner.model.names[2:])):
        joint = SPEC.joints[SPEC.index(name)]
        assert motion.q[:, 7 + i].min() > joint.position_min - 0.01, name
        assert motion.q[:, 7 + i].max() < joint.position_max + 0.01, name


@pytest.mark.parametrize("target", [(1.5, 0.0, 0.9), (-0.8, 0.3, 0.5), (0.3, 0.2, -0.5), (0.2, 1.2, 2.0)])
def test_for_targets_out_of_reach_the_feet_stay_and_the_trunk_keeps_its_bounds(planner, target):
    T, fingers = poses(reach(), planner.config.dt, 0.0, 3.0)
    T[5:, :, :3, 3] = target
    motion = planner.plan(planner.q_stance, np.zeros(planner.model.nv), T, fingers)
    x, y = motion.q[:, 3], motion.q[:, 4]
    assert np.arccos(1.0 - 2.0 * (x * x + y * y)).max() < planner.config.pelvis_tilt + 0.05
    assert motion.q[:, 2].min() > planner.config.height_min - 0.02
    data = planner.model.createData()
    for foot in SPEC.feet:
        frame = planner.model.getFrameId(foot.frame)
        start, end = (placed(planner.model, data, q, frame) for q in (motion.q[0], motion.q[-1]))
        assert np.linalg.norm(start - end) < 1e-5


def placed(model, data, q, frame):
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[frame].translation.copy()


def test_the_derivatives_of_the_motion_rows_are_those_of_differences(knots):
    rng = np.random.default_rng(0)
    q = pin.integrate(knots.model, knots.q_stance, 0.1 * rng.normal(size=N_BODY))
    v, a, h = 0.3 * rng.normal(size=N_BODY), rng.normal(size=N_BODY), 1e-6
    n = at.ZMP_EDGES.start + knots.n_edges

    def rows(q, v, a):
        r, bound, sign = np.zeros(at.N_MOTION), np.zeros(n), np.ones(n)
        D, D_bound = np.zeros((3, at.N_MOTION, N_BODY)), np.zeros((3, n, N_BODY))
        knots.motion(q, v, a, (r, D), (bound, D_bound, sign))
        return np.concatenate([r, bound]), np.concatenate([D, D_bound], axis=1)

    _, D = rows(q, v, a)
    for j in range(N_BODY):
        d = np.zeros(N_BODY)
        d[j] = h
        for i, (plus, minus) in enumerate([
            ((pin.integrate(knots.model, q, d), v, a), (pin.integrate(knots.model, q, -d), v, a)),
            ((q, v + d, a), (q, v - d, a)),
            ((q, v, a + d), (q, v, a - d)),
        ]):  # fmt: skip
            assert np.allclose((rows(*plus)[0] - rows(*minus)[0]) / (2.0 * h), D[i, :, j], atol=2e-6, rtol=1e-5)


def test_the_directions_left_free_are_orthonormal_and_leave_the_feet(knots):
    q = pin.integrate(knots.model, knots.q_stance, 0.2 * np.random.default_rng(1).normal(size=N_BODY))
    N = np.zeros((N_BODY, N_FREE))
    q = knots.settle(q, N)
    assert np.allclose(N.T @ N, np.eye(N_FREE), atol=1e-12)
    data = knots.model.createData()
    pin.computeJointJacobians(knots.model, data, q)
    pin.updateFramePlacements(knots.model, data)
    for foot in SPEC.feet:
        J = pin.getFrameJacobian(knots.model, data, knots.model.getFrameId(foot.frame), pin.LOCAL_WORLD_ALIGNED)
        assert np.allclose(J @ N, 0.0, atol=1e-12)


def test_the_nearest_pairs_are_those_of_all_distances(knots):
    rng, distances = np.random.default_rng(2), knots.distances
    data = knots.full.createData()
    for _ in range(20):
        q = knots.q_full.copy()
        q[7:] += 0.25 * rng.normal(size=len(q) - 7)
        pin.computeJointJacobians(knots.full, data, q)
        found = distances.find(data, 0.025, 16)
        rooms = distances.distance[found] - distances.margin[found]
        pin.computeDistances(knots.full, data, distances.geometry, distances.data, q)
        every = np.array([result.min_distance for result in distances.data.distanceResults]) - distances.margin
        nearest = np.sort(every[every < 0.025])[:16]
        assert np.allclose(np.sort(rooms), nearest, atol=1e-6)


def test_a_step_of_the_program_lowers_the_cost_as_promised(knots):
    config = PosturePlanConfig()
    T, fingers = poses(reach(0.45, 0.60), config.dt, 0.0, 1.0)
    q = np.tile(knots.q_stance, (len(T), 1))
    program = Program(knots, config.dt, T, fingers, np.zeros(N_BODY))
    program.linearise(q)
    before = program.weigh(config, 1.0)
    program.prepare()
    z, promise = program.step(1.0)
    after = program.fresh()
    after.linearise(program.moved(q, 1e-3 * z))
    assert before - after.weigh(config, 1.0) == pytest.approx(2e-3 * promise, rel=0.5)
    assert before - after.cost > 0.0
