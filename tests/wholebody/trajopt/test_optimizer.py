"""Strategy: the real planner on slow, fast and impossible paths; Pinocchio's inverse dynamics judges what it says, and
the readable specification (`formulation.py`) judges values and derivatives of the kernels on random motions."""

from itertools import pairwise, product

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import nnls

from models import g1
from policy.scripted.library import lissajous, reach, two_hand_lift, wave
from wholebody.collision.floor_clearance import FloorClearance
from wholebody.config import ControllerConfig, TrajectoryConfig
from wholebody.errors import InputError
from wholebody.planning.trajectory import curve_through
from wholebody.trajopt import gauss_newton as optimiser
from wholebody.trajopt import layout, weights
from wholebody.trajopt import optimizer as optimizer_module
from wholebody.trajopt import problem as problem_module
from wholebody.trajopt.centroidal import Centroidal
from wholebody.trajopt.formulation import (
    Formulation,
    bounds,
    configuration_cost,
    dense,
    motion_cost,
    reduced,
)
from wholebody.trajopt.kernels.between import START_SHARE
from wholebody.trajopt.kernels.inequalities import derivative
from wholebody.trajopt.layout import N_BODY
from wholebody.trajopt.optimizer import TrajectoryOptimizer
from wholebody.trajopt.problem import TrajectoryProblem
from wholebody.trajopt.robot_tables import RobotTables
from wholebody.trajopt.weights import BOUNDS

SPEC = g1()


@pytest.fixture(scope="module")
def planner():
    return TrajectoryOptimizer(SPEC)


@pytest.fixture(scope="module")
def body():
    return RobotTables(SPEC, TrajectoryConfig())


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


def test_palms_of_whole_numbers_are_those_of_the_same_reals(planner):
    q = np.zeros((2, planner.model.nq), dtype=int)
    q[:, 2] = q[:, 6] = 1
    for kind in (int, np.float32):
        assert np.array_equal(planner.palms(q.astype(kind)), planner.palms(q.astype(float)))
    assert np.isfinite(planner.palms(q)).all()


@pytest.mark.parametrize(("x", "z"), [(0.40, 0.30), (0.45, 0.60), (0.50, 1.00)])
def test_reaches_are_planned_to_millimetres_with_every_bound_kept(planner, x, z):
    T, motion = plan(planner, reach(x, z), 4.0)
    assert np.linalg.norm(motion.T_palms[-1, :, :3, 3] - T[-1, :, :3, 3], axis=1).max() < 3e-3
    assert motion.violation.max() < 0.5


@pytest.mark.parametrize(("policy", "end"), [(two_hand_lift(), 4.0), (lissajous(), 4.0)])
def test_inverse_dynamics_finds_balance_and_waist_torque_inside_their_bounds(planner, policy, end):
    _, motion = plan(planner, policy, end)
    zmp, torques = inverse_dynamics(planner, motion)
    support = planner.body.footing.support
    margin = np.min(support.offsets - zmp @ support.normals.T, axis=1)
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


@pytest.mark.parametrize(("height", "knots"), [(0.0, 6), (0.0, 30), (0.08, 30)])
def test_hands_sent_into_the_floor_fingers_first_stay_above_it(planner, height, knots):
    T, fingers = poses(reach(0.40, 0.30), planner.config.dt, 0.0, 4.0)
    share = np.interp(np.arange(len(T)), [45 - knots, 45], [0.0, 1.0])
    T[:, :, 2, 3] += (share * (height - 0.30))[:, None]
    T[:, :, :3, :3] = T[:, :, :3, :3] @ np.array([[pin.exp3(np.array([0.0, 0.8 * x, 0.0]))] for x in share])
    motion = planner.plan(planner.q_stance, np.zeros(planner.model.nv), T, fingers)
    underside = FloorClearance(planner.spec, planner.model, planner.body.proximity.geometry)
    data = planner.model.createData()
    least = np.inf
    steps = planner.config.dt * np.arange(len(motion.q))
    on_curve, _, _ = curve_through(steps, motion.q, np.zeros(planner.model.nv))(steps)
    for q in on_curve:
        pin.forwardKinematics(planner.model, data, q)
        least = min(least, underside.lowest(data)[:, 2].min())
    # As for every bound, three times its scale is accepted.
    scale = next(bound.scale for bound in BOUNDS if bound.name == "distance to bodies and floor")
    assert planner.config.floor_distance - 3.0 * scale < least < 0.04
    assert motion.T_palms[-1, :, 2, 3].min() < 0.15


def test_far_down_the_waist_could_hold_still_wherever_the_plan_goes(planner):
    T, fingers = poses(reach(0.40, 0.30), planner.config.dt, 0.0, 4.0)
    T[:, :, 0, 3] += np.interp(np.arange(len(T)), [20, 45], [0.0, 0.2])[:, None]
    motion = planner.plan(planner.q_stance, np.zeros(planner.model.nv), T, fingers)
    model, data = planner.model, planner.model.createData()
    waist = model.joints[model.getJointId("waist_pitch_joint")].idx_v
    still = [abs(pin.computeGeneralizedGravity(model, data, q)[waist]) for q in motion.q]
    # The plans of a program that only knew the torques of the motion shook their shoulders to hold 43 N m with 31.
    assert max(still) < 35.0 * (planner.config.torque_share + 0.05)
    assert np.linalg.norm(motion.T_palms[-1, :, :3, 3] - T[-1, :, :3, 3], axis=1).min() < 3e-3


def test_palms_of_many_configurations_are_those_of_each_whichever_are_asked_for_first(planner, monkeypatch):
    """Compiled for one row, in which every layout in memory looks alike, it read several rows as if turned."""
    entry = optimizer_module._place_palms
    monkeypatch.setattr(optimizer_module, "_place_palms", type(entry)(entry.function))
    rows = np.tile(planner.q_stance, (3, 1))
    rows[:, 7:] += np.random.default_rng(0).uniform(-0.2, 0.2, rows[:, 7:].shape)
    each = [planner.palms(row[None])[0] for row in rows]
    assert planner.palms(rows) == pytest.approx(np.array(each), abs=1e-12)


def placed(model, data, q, frame):
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[frame].translation.copy()


def linearised(body, K, seed, speed=1.0, config=None, pushes=None):
    """A random motion with the feet in place, and its program."""
    rng, config = np.random.default_rng(seed), config or TrajectoryConfig()
    program = TrajectoryProblem(body, config, K)
    T, fingers = poses(reach(0.45, 0.60), config.dt, 0.0, (K - 0.5) * config.dt)
    T = T @ np.array([[pin.exp6(0.2 * rng.normal(size=6)).homogeneous for _ in range(2)] for _ in range(K)])
    program.begin(T, fingers, 0.3 * rng.normal(size=N_BODY), pushes)
    program.set_weights(config, 1.0)
    q = pin.integrate(body.model, body.tables.q_stance, 0.15 * rng.normal(size=N_BODY))
    for k in range(K):
        program.now.q[k] = q
        q = pin.integrate(body.model, q, speed * config.dt * rng.normal(size=N_BODY))
    program.linearise(program.now)
    return program, T


def near(found, expected):
    """Whether two arrays are equal to 1e-9 of max(1, |value|)."""
    return np.max(np.abs(found - expected) / np.maximum(1.0, np.abs(expected))) < 1e-9


@pytest.mark.parametrize("seed", range(12))
def test_compiled_terms_and_derivatives_are_those_of_pinocchio(body, seed):
    program, T = linearised(body, 6, seed, speed=[0.1, 1.0, 4.0][seed % 3])
    m, dt, judge = program.now, TrajectoryConfig().dt, Formulation(body, SPEC)
    v_mid, back, forth = judge.mid_velocities(m.q, m.v_mid[0], dt)
    assert near(m.v_mid, v_mid)
    N, E = dense(m.free), len(body.tables.normals)
    kept = np.r_[: layout.DISTANCE, layout.COM_EDGE : layout.n_inequalities(E)]
    for k in range(1, 6):
        v, a = 0.5 * (v_mid[k] + v_mid[k + 1]), (v_mid[k + 1] - v_mid[k]) / dt
        r, J = judge.configuration(m.q[k], T[k])
        rows, D = judge.dynamics(m.q[k], v, a)
        assert near(m.r[k], r)
        assert near(m.J[k], J @ N[k])
        assert near(m.dynamics[k], rows)
        assert near(m.J_dynamics[k], reduced(k, D, back, forth, N, dt))
        still, capture = judge.static_torque(m.q[k]), judge.capture_point(m.q[k], v, rows)
        assert near(m.violation[k][kept], bounds(body.tables, r, m.q[k], v_mid[k], a, rows, still, capture))
        assert near(m.zmp[k], rows[:2] / max(rows[2], 0.05))
    rows, D = judge.dynamics(m.q[0], v_mid[0], 2.0 * (v_mid[1] - v_mid[0]) / dt)
    assert near(m.dynamics[0], rows)
    assert near(m.J_dynamics[0, :, 46:], reduced(0, D, back, forth, N, dt)[:, 46:])


def pushed_by(judge, q, pushes):
    """Rows of the dynamics (27,) that forces (6,) on the palms add to those of `Formulation.dynamics`."""
    t, rows, weight = judge.body.tables, np.zeros(layout.N_DYNAMICS), judge.body.tables.mass * 9.81
    pin.computeJointJacobians(judge.model, judge.data, q)
    pin.updateFramePlacements(judge.model, judge.data)
    for frame, f in zip(judge.frames[:2], pushes.reshape(2, 3), strict=True):
        J, p = (
            pin.getFrameJacobian(judge.model, judge.data, frame, pin.LOCAL_WORLD_ALIGNED),
            judge.data.oMf[frame].translation,
        )
        rows[layout.TAU : layout.TAU + layout.UPPER] -= f @ J[:3, layout.LOWER :]
        moment = np.cross(p, f)
        rows[:3] += np.array([moment[1], -moment[0], -f[2]]) / weight
        rows[24:] -= np.array([f[0], f[1], moment[2]]) / weight
    assert t.gravity[2] == -9.81
    return rows


@pytest.mark.parametrize("seed", range(4))
def test_forces_on_the_palms_enter_the_dynamics_as_those_of_pinocchio_and_change_with_the_configuration(body, seed):
    pushes = 30.0 * np.random.default_rng(seed).normal(size=(6, 6))
    (free, _), (program, _) = linearised(body, 6, seed), linearised(body, 6, seed, pushes=pushes)
    judge, N, h = Formulation(body, SPEC), dense(program.now.free), 1e-5
    m, plain, E = program.now, free.now, len(body.tables.normals)
    for k in range(6):
        q = m.q[k]
        assert near(m.dynamics[k] - plain.dynamics[k], pushed_by(judge, q, pushes[k]))
        static = (m.violation[k, layout.STATIC : layout.STATIC + 3] + 1.0) * body.tables.tau_max[:3]
        still = judge.static_torque(q)[:3] + pushed_by(judge, q, pushes[k])[layout.TAU : layout.TAU + 3]
        assert near(static, np.abs(still))
        if k == 0:
            continue
        assert near(
            m.violation[k, layout.ZMP + 2 * E : layout.ZMP + 3 * E],
            plain.violation[k, layout.ZMP + 2 * E : layout.ZMP + 3 * E],
        )
        steps = h * N[k].T
        change = [
            (pushed_by(judge, pin.integrate(judge.model, q, step), pushes[k]) -
             pushed_by(judge, pin.integrate(judge.model, q, -step), pushes[k])) / (2.0 * h) for step in steps
        ]  # fmt: skip
        n = layout.N_FREE
        by_q = np.array(change).T
        assert np.abs(m.J_dynamics[k, :, n : 2 * n] - plain.J_dynamics[k, :, n : 2 * n] - by_q).max() < 1e-6
        assert np.abs(m.J_static[k] - plain.J_static[k] - by_q[layout.TAU : layout.TAU + 3]).max() < 1e-6


def between_of(program, k):
    """Torques before and after a knot, (2, 17) [N m], of its inequalities."""
    rows = slice(-layout.N_BETWEEN, None)
    shares = (program.now.violation[k, rows] + 1.0) * program.now.sign[k, rows]
    return shares.reshape(2, -1) * program.body.tables.between_max


def strained(body, K, seed, speed):
    """A random motion whose torques between knots count, and its program."""
    program, _ = linearised(body, K, seed, speed)
    program._count_between(True)
    program.linearise(program.now)
    program.set_weights(TrajectoryConfig(), 1.0)
    return program


@pytest.mark.parametrize("seed", range(4))
def test_torques_beside_knots_are_those_of_inverse_dynamics_on_half_the_way_with_the_acceleration_of_the_knot(
    body, seed
):
    program, dt, data = strained(body, 6, seed, 2.0), TrajectoryConfig().dt, body.model.createData()
    m, model = program.now, Formulation(body, SPEC).model
    for k in range(1, 6):
        for side, sign in ((0, -1.0), (1, 1.0)):
            if (k, side) == (1, 0):
                continue  # counts less
            way = sign * 0.5 * dt * m.v_mid[k + side] + dt**2 / 24.0 * m.a[k]
            q, v = pin.integrate(model, m.q[k], way), m.v[k] + sign * 0.25 * dt * m.a[k]
            torques = pin.rnea(model, data, q, v, m.a[k])[layout.LOWER :]
            assert near(between_of(program, k)[side], torques)


@pytest.mark.parametrize("seed", range(4))
def test_the_mean_of_two_neighbours_torques_is_that_of_the_curve_between_them(body, seed):
    """Where joints swing by a few degrees; the curve is the one that is followed."""
    program, dt, K = strained(body, 8, seed, 0.3), TrajectoryConfig().dt, 8
    m, model, data, h = program.now, Formulation(body, SPEC).model, body.model.createData(), 1e-6
    full = np.tile(body.q_full, (K, 1))
    body.put(full, m.q)
    v_start = np.zeros(body.full.nv)
    body.put_rates(v_start, m.v[0])
    curve, effort = curve_through(dt * np.arange(K), full, v_start), body.tables.between_max
    for k in range(K - 1):
        (q, rate, _), (_, later, _) = (curve(np.array([dt * (k + 0.5) + x])) for x in (0.0, h))
        q, joints, bend = body.body_of(q)[0], body.body_of(rate)[0], (body.body_of(later) - body.body_of(rate))[0] / h
        # The base's part is that of the knots: its spline is one of quaternions.
        v, a = 0.5 * (m.v[k] + m.v[k + 1]), 0.5 * (m.a[k] + m.a[k + 1])
        v[6:], a[6:], v[:6] = joints[7:], bend[7:], v[:6] + dt / 8.0 * (m.a[k] - m.a[k + 1])[:6]
        q[3:7] /= np.linalg.norm(q[3:7])
        there = pin.rnea(model, data, q, v, a)[layout.LOWER :]
        before = between_of(program, k + 1)[0]
        after = between_of(program, k)[1]
        if k == 0:  # they count less
            before, after = (np.sign(x) * (effort + (np.abs(x) - effort) / START_SHARE) for x in (before, after))
        assert np.abs(0.5 * (before + after) - there).max() < 0.02 * effort.max()


def test_torques_beside_knots_change_with_a_step_as_their_derivatives_say(body):
    program, config, h = strained(body, 6, 3, 1.0), TrajectoryConfig(), 1e-4
    program.assemble()
    program.step(1.0)
    m, E = program.now, len(body.tables.normals)
    row, z, before = np.zeros(3 * layout.N_FREE), program.z.ravel(), program.now.violation.copy()
    program.z[:] *= h
    program.move()
    program.linearise(program.trial)
    for k in range(4):
        for i in range(layout.n_inequalities(E), layout.n_rows(E)):
            derivative(i, k, body.tables, m, config.dt, row)
            change = row @ z[k * layout.N_FREE : (k + 3) * layout.N_FREE]
            # How the way to the place halfway turns with the base is left out.
            assert program.trial.violation[k, i] - before[k, i] == pytest.approx(change, abs=2e-6, rel=0.02), (k, i)


def test_a_motion_that_asks_for_too_much_between_knots_is_found_anew_and_no_other_changes(planner):
    """A wrist that holds 2 kg turned away is relieved by shaking it, at knots."""
    T, fingers = poses(reach(0.50, 1.00), planner.config.dt, 0.0, 3.0)
    start = planner.q_stance, np.zeros(planner.model.nv), T, fingers
    plain, bounded = planner.plan(*start), planner.plan(*start, between=True)
    assert not bounded.between
    assert np.array_equal(plain.q, bounded.q)
    planner.body.carry((2.0, 0.0))
    try:
        shaken, bounded = planner.plan(*start), planner.plan(*start, between=True)
        asked = [beyond(planner, motion) for motion in (shaken, bounded)]
    finally:
        planner.body.carry((0.0, 0.0))
    assert bounded.between
    assert asked[0] > 1.1
    assert asked[1] < 1.0


def beyond(planner, motion):
    """The largest torque of waist and arms halfway between knots, the first two left out, as a share of the motors'."""
    body, dt, h = planner.body, planner.config.dt, 1e-6
    model, data, worst = planner.body.model.copy(), planner.body.model.createData(), 0.0
    model.armature[:] = 0.0
    curve = curve_through(dt * np.arange(len(motion.q)), motion.q, np.zeros(planner.model.nv))
    for k in range(1, len(motion.q) - 1):
        states = [curve(np.array([dt * (k + 0.5) + x])) for x in (0.0, h, 2.0 * h)]
        q = [body.body_of(one[0])[0] for one in states]
        for one in q:
            one[3:7] /= np.linalg.norm(one[3:7])
        v = [pin.difference(model, a, b) / h for a, b in pairwise(q)]
        torques = pin.rnea(model, data, q[0], v[0], (v[1] - v[0]) / h)[layout.LOWER :]
        worst = max(worst, float((np.abs(torques) / body.effort_max).max()))
    return worst


def test_the_compiled_cost_is_that_of_the_formulation(body):
    program, T = linearised(body, 6, 2, speed=0.3)
    m, dt, judge, config = program.now, TrajectoryConfig().dt, Formulation(body, SPEC), TrajectoryConfig()
    w, penalty = weights.weights(config), weights.penalties(len(body.tables.normals), 1.0)
    start = layout.LOAD + len(body.tables.normals)
    expected = sum(configuration_cost(w, judge.configuration(m.q[k], T[k])[0]) for k in range(1, 6))
    v_mid, _, _ = judge.mid_velocities(m.q, m.v_mid[0], dt)
    for k in range(6):
        a = (v_mid[k + 1] - v_mid[k]) / dt * (2.0 if k == 0 else 1.0)
        v = v_mid[0] if k == 0 else 0.5 * (v_mid[k] + v_mid[k + 1])
        expected += motion_cost(w, v_mid[k], a, judge.dynamics(m.q[k], v, a)[0])
        kept = slice(start if k == 0 else 0, len(penalty))
        expected += penalty[kept] @ np.maximum(m.violation[k, kept], 0.0) ** 2
    assert program.cost(m) == pytest.approx(expected, rel=1e-9)


def test_palms_on_the_curve_between_control_points_are_those_of_pinocchio(body):
    (program, _), config = linearised(body, 9, 4, speed=0.2), TrajectoryConfig()
    q, a, data = program.now.q.copy(), program.now.a.copy(), body.model.createData()
    T_palms = program.palms_on_curve()
    for k in range(1, 9):
        pin.framesForwardKinematics(body.model, data, pin.integrate(body.model, q[k], config.dt**2 / 6.0 * a[k]))
        for i, frame in enumerate(body.palms):
            there, here = data.oMf[frame], program.now.palms[k, i]
            assert np.abs(there.translation - here[:3, 3]).max() < 0.02, "a larger bend is cut"
            assert np.abs(T_palms[k, i] - there.homogeneous).max() < 1e-9


def test_the_directions_left_free_are_orthonormal_and_leave_the_feet(body):
    program, _ = linearised(body, 3, 1)
    data = body.model.createData()
    for q, N in zip(program.now.q, dense(program.now.free), strict=True):
        assert np.allclose(N.T @ N, np.eye(N.shape[1]), atol=1e-12)
        assert np.allclose(N @ N.T, Formulation(body, SPEC).free_directions(q), atol=1e-9)
        pin.computeJointJacobians(body.model, data, q)
        pin.updateFramePlacements(body.model, data)
        for foot, place in zip(SPEC.feet, body.tables.p_feet, strict=True):
            frame = body.model.getFrameId(foot.frame)
            J = pin.getFrameJacobian(body.model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            assert np.allclose(J @ N, 0.0, atol=1e-12)
            assert np.allclose(data.oMf[frame].translation, place, atol=1e-6)


def most_within_the_approach_time(J, v, a):
    """How much nearer than its control point the curve comes in the approach time about a knot, by rows J, (n,) [m]."""
    config = TrajectoryConfig()
    rate, bend = J @ v, J @ a
    with np.errstate(divide="ignore"):
        turn = np.clip(-rate / bend, -config.approach_time, config.approach_time)
    times = np.stack([turn, np.full_like(turn, config.approach_time), np.full_like(turn, -config.approach_time)])
    return np.max(rate * times + bend * (0.5 * times**2 + config.dt**2 / 6.0), axis=0)


def test_the_nearest_pairs_are_those_of_all_distances(body):
    seen = 0
    for seed in range(8):
        program, _ = linearised(body, 4, 20 + seed, speed=3.0)
        m, fingers = program.now, body.fingers[body.finger_order]
        q, proximity = body.q_full.copy(), body.proximity
        for k in range(1, 4):
            body.put(q, m.q[k])
            q[fingers] = program.q_fingers[k]
            data = body.full.createData()
            pin.computeDistances(body.full, data, proximity.geometry, proximity.data, q)
            every = proximity.margin - np.array([result.min_distance for result in proximity.data.distanceResults])
            expected = np.sort(every[every > -TrajectoryConfig().self_trigger])[::-1][:16]
            assert program.distances.chosen[k] == len(expected)
            added = most_within_the_approach_time(m.approach[k, : len(expected)], m.v[k], m.a[k])
            found = m.violation[k, layout.DISTANCE : layout.DISTANCE + len(expected)] - added
            assert np.allclose(found, expected, atol=4e-6)
            seen += len(expected)
    assert seen > 100


@pytest.fixture(scope="module")
def raised():
    """The robot over a floor as high as its hands."""
    config = TrajectoryConfig(floor_distance=0.75)
    return RobotTables(SPEC, config), config


def test_heights_over_the_floor_and_their_derivatives_are_those_of_pinocchio(raised):
    body, config = raised
    judge, seen = Formulation(body, SPEC), 0
    for seed in range(6):
        program, _ = linearised(body, 4, 40 + seed, speed=2.0, config=config)
        m, pairs = program.now, program.distances.chosen
        N = dense(m.free)
        for k in range(1, 4):
            expected, J = judge.floor(m.q[k], program.q_fingers[k], config.floor_distance, config.floor_trigger)
            assert m.n_near[k] == pairs[k] + len(expected)
            rows = slice(pairs[k], m.n_near[k])
            added = most_within_the_approach_time(J, m.v[k], m.a[k])
            assert near(m.violation[k, layout.DISTANCE :][rows], expected + added)
            assert near(m.approach[k, rows], J)
            assert near(m.J_distance[k, rows], J @ N[k])
            seen += len(expected)
    assert seen > 50


def test_the_bounds_change_with_a_step_as_their_derivatives_say(raised):
    body, config = raised
    program, _ = linearised(body, 5, 3, config=config)
    assert program.now.n_near[2] > program.distances.chosen[2] > 0
    program.assemble()
    program.step(1.0)
    m, E, h = program.now, len(body.tables.normals), 1e-4
    row, z = np.zeros(3 * layout.N_FREE), program.z.ravel()
    smooth = [i for i in range(layout.n_inequalities(E)) if not layout.DISTANCE <= i < layout.COM_EDGE]
    smooth += [layout.DISTANCE + i for i in range(m.n_near[2])]
    program.z[:] *= h
    before = m.violation.copy()
    program.move()
    program.linearise(program.trial)
    for i in smooth:
        derivative(i, 2, body.tables, m, config.dt, row)
        change = row @ z[2 * layout.N_FREE : 5 * layout.N_FREE]
        # How speeds turn with the joints is left out for the capture point and the way down to the floor.
        rough = 0.3 if layout.ZMP + 2 * E <= i < layout.ZMP + 3 * E else 0.0
        rough = 0.1 if layout.DISTANCE + program.distances.chosen[2] <= i < layout.COM_EDGE else rough
        small = 2e-6 if rough else 3e-7
        assert program.trial.violation[2, i] - before[2, i] == pytest.approx(change, abs=small, rel=rough), i


def test_a_step_of_the_program_lowers_the_cost_as_promised(body):
    program, _ = linearised(body, 12, 4, speed=0.1)
    program.assemble()
    before = program.cost(program.now)
    promise, _, _ = program.step(1.0)
    program.z[:] *= 1e-3
    program.move()
    program.linearise(program.trial)
    after = program.cost(program.trial)
    assert before - after == pytest.approx(2e-3 * promise, rel=0.5)
    assert before - after > 0.0


def test_the_least_load_of_a_foot_is_that_of_the_controllers_least_forces(body):
    weight = body.mass * 9.81
    assert body.foot_load_min == pytest.approx(4 * ControllerConfig().force_min / weight)
    heavy = RobotTables(SPEC, TrajectoryConfig(), force_min=20.0)
    assert heavy.foot_load_min == pytest.approx(80.0 / weight)
    # The pressure cannot go as far to the sides, where one foot would carry everything.
    assert (heavy.footing.pressure_offsets <= body.footing.pressure_offsets).all()
    assert (body.footing.pressure_offsets - heavy.footing.pressure_offsets).max() > 0.01


def forces_at(corners):
    """Wrenches per unit of load (6, n), as the rows of the motion, of the edges of the friction pyramids there."""
    mu = TrajectoryConfig().friction_share * ControllerConfig().friction / np.sqrt(2.0)
    edges = [(x, y, mu * a, mu * b) for x, y in corners for a, b in product((-1.0, 1.0), repeat=2)]
    return np.array([[x, y, 1.0, fx, fy, x * fy - y * fx] for x, y, fx, fy in edges]).T


def test_what_is_inside_the_cone_of_friction_can_be_had_from_the_soles_and_what_is_outside_cannot(body):
    """Oracle: whether forces at the corners add up to a wrench, by non-negative least squares."""
    rng, vertices = np.random.default_rng(2), (1.0 - 2.0 * body.foot_load_min) * body.footing.support.vertices
    box = product(*zip(vertices.min(axis=0), vertices.max(axis=0), strict=True))
    sole_accelerations, around, seen = forces_at(vertices), forces_at(box), [0, 0]
    for wrench in rng.uniform(-1.0, 1.0, (400, 6)) * [0.06, 0.1, 0.0, 0.4, 0.4, 0.06] + np.eye(6)[2]:
        over = (body.tables.cone @ wrench).max()
        if over < 0.0:
            seen[0] += 1
            assert nnls(sole_accelerations, wrench)[1] < 1e-9
        elif over > 0.02:
            seen[1] += 1
            assert nnls(around, wrench)[1] > 1e-4
    assert min(seen) > 50


def test_a_program_that_has_no_step_says_so(body):
    program, _ = linearised(body, 5, 4)
    program.assemble()
    program._system.H[3] = -1e12
    with pytest.raises(InputError, match="singular"):
        program.step(1e-7)


def test_a_motion_within_its_bounds_is_found_in_fewer_steps_and_as_good(planner, monkeypatch):
    counts, costs, linearise = [0, 0], [], TrajectoryProblem.linearise
    T, fingers = poses(wave(), planner.config.dt, 0.0, 2.0)
    for i, feasible in enumerate((optimiser.FEASIBLE, -1.0)):
        monkeypatch.setattr(optimiser, "FEASIBLE", feasible)

        def counted(self, motion, i=i):
            counts[i] += 1
            linearise(self, motion)

        monkeypatch.setattr(TrajectoryProblem, "linearise", counted)
        costs.append(planner.plan(planner.q_stance, np.zeros(planner.model.nv), T, fingers).cost)
    assert counts[0] < counts[1]
    assert costs[0] < 1.05 * costs[1]


def test_a_step_is_exact_once_it_exceeds_the_bounds_that_it_counts_on(body):
    program, _ = linearised(body, 12, 4, speed=0.1)
    program.assemble()
    assert not program.step(1.0, 1)[2]
    promise, size, exact = program.step(1.0, 50)
    z = program.z.copy()
    assert exact
    assert program.step(1.0, 51) == (promise, size, True)
    assert np.array_equal(program.z, z)


def test_what_the_start_is_past_a_bound_is_excused_less_with_time_and_never_at_the_end(body):
    tolerance, config = weights.tolerances(len(body.tables.normals))[layout.TILT], TrajectoryConfig()
    for K, back in ((31, problem_module.RETURN_TIME / config.dt), (6, 5.0)):
        program = TrajectoryProblem(body, config, K)
        excess = program.now.violation[:, layout.TILT]
        excess[:] = 5.0 * tolerance
        lasting = program.violation()
        assert lasting[0] == 0.0
        assert lasting[-1] == pytest.approx(5.0)
        assert np.all(np.diff(lasting) >= 0.0)
        excess[:] *= np.maximum(1.0 - np.arange(K) / back, 0.0)
        assert program.violation().max() <= 1.0, "it leads back inside"
        excess[:] = tolerance
        np.testing.assert_allclose(program.violation()[1:], 1.0)


def test_the_motion_that_a_search_begins_with_is_smoothed(planner, monkeypatch):
    """A chunk that goes on where another one was to come to rest: there the motion first tried would jerk."""
    T, fingers = poses(wave(), planner.config.dt, 0.0, 4.0)
    before = planner.plan(planner.q_stance, np.zeros(planner.model.nv), T[:30], fingers[:30])
    first = []
    monkeypatch.setattr(optimizer_module, "optimise", lambda program, _: first.append(start_of(program)))
    for passes in (problem_module.SMOOTHING_PASSES, 0):
        monkeypatch.setattr(problem_module, "SMOOTHING_PASSES", passes)
        planner.plan(before.q[20], before.v[20], T[20:56], fingers[20:56], before.q[21:25])
    assert first[0] < 0.1 < 2.0 < first[1]


def start_of(program):
    """Largest excess over a bound of the motion that a search begins with."""
    program.linearise(program.now)
    return program.violation().max()


def test_the_binomial_filter_keeps_the_first_configuration_and_makes_accelerations_small():
    rng = np.random.default_rng(3)
    q = np.tile(np.eye(36)[6], (20, 1)) + 0.1 * rng.normal(size=(20, 36))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    q[7, 3:7] *= -1.0
    even = q.copy()
    problem_module._smooth(even)
    assert np.array_equal(even[0], q[0])
    assert np.linalg.norm(even[:, 3:7], axis=1) == pytest.approx(1.0)
    rough, smooth = (np.abs(np.diff(x[:, 7:], 2, axis=0)).max() for x in (q, even))
    assert smooth < 0.2 * rough
    assert np.abs(np.diff(even[:, 3:7], axis=0)).max() < 0.1


def test_centroidal_momentum_along_a_motion_are_those_of_pinocchio(body):
    model, rng = body.full, np.random.default_rng(5)
    frames = [model.getFrameId(name) for name in (SPEC.base_body, SPEC.torso_body)]
    q = np.array([pin.integrate(model, body.q_full, rng.normal(size=model.nv)) for _ in range(50)])
    v, data = rng.normal(size=(50, model.nv)), model.createData()
    com, velocity, momentum, turns = Centroidal(SPEC, model, frames)(q, v)
    for k in range(50):
        pin.computeCentroidalMomentum(model, data, q[k], v[k])
        assert near(com[k], data.com[0])
        assert near(velocity[k], data.hg.linear / body.mass)
        assert near(momentum[k], data.hg.angular)
        for i, frame in enumerate(frames):
            assert near(turns[i, k], pin.updateFramePlacement(model, data, frame).rotation)


def test_a_plan_does_not_depend_on_the_plans_before_it(planner):
    T, fingers = poses(lissajous(), planner.config.dt, 2.0, 4.0)
    alone = TrajectoryOptimizer(SPEC).plan(planner.q_stance, np.zeros(planner.model.nv), T, fingers)
    plan(planner, reach(), 1.9)
    again = planner.plan(planner.q_stance, np.zeros(planner.model.nv), T, fingers)
    assert np.array_equal(alone.q, again.q)
