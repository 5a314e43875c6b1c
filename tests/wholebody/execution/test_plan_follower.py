"""Strategy: the compiled tick of the reference against the same made of the pieces that specify it, the path clock,
`HandPath`, `time_scaled`, `ReferenceSmoother` and Pinocchio's rotations, along a real plan with errors put in.
"""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import stance_q
from policy.scripted.library import scripted_policy
from tests.support.reference_motions import row_at, step
from wholebody.config import ControllerConfig, PlanningConfig
from wholebody.control.reference_packet import BodyReference, PalmReference
from wholebody.episode.run import observe
from wholebody.execution.kernels.plan_follower import TRUST_MIN
from wholebody.execution.plan_follower import PlanFollower
from wholebody.execution.supervisor import Supervisor
from wholebody.planning.trajectory import SampledTrajectory
from wholebody.reference import HandMotion, ReferenceSmoother, rest_row, time_scaled
from wholebody.reference.kernels.path_clock import advanced
from wholebody.robot.kernels.pendulum import natural_frequency
from wholebody.types import RobotState

SPEC = g1()
DT = 0.002


@pytest.fixture(scope="module")
def planned():
    """A supervisor, the state it stands in, a plan of half a second and the parameter of the chunk's last step."""
    supervisor = Supervisor(SPEC, ControllerConfig(planning=PlanningConfig(lead=0.0)))
    state = RobotState(0.0, stance_q(SPEC, supervisor.robot.model), np.zeros(supervisor.robot.nv))
    supervisor.reset(state)
    policy = scripted_policy("wave")
    policy.reset()
    chunk = policy.infer(observe(SPEC, supervisor, state))
    supervisor.accept(chunk)
    return supervisor, state, supervisor.plan, chunk.times[-1] - chunk.t_obs


def beginning(planned):
    supervisor, state, _, _ = planned
    supervisor.controller.reset(state)
    poses = [supervisor.robot.pose(tool.wrist_frame).homogeneous for tool in SPEC.tools]
    joints = [state.q[7 + supervisor.robot.joint_indices(tool.finger_joints)] for tool in SPEC.tools]
    rows = np.stack([rest_row(T, q) for T, q in zip(poses, joints, strict=True)])
    return (
        SampledTrajectory.still(supervisor.robot, state.q),
        ReferenceSmoother(rows, supervisor.planner.hand_limits),
        rows,
    )


def follower(planned, *, interpret=False):
    return PlanFollower(planned[0].controller, planned[0].config, *beginning(planned), interpret=interpret)


class Specification:
    """The same, made of the pieces."""

    def __init__(self, planned):
        self.supervisor, self.state, self.plan, self.last = planned
        _, self.smoother, _ = beginning(planned)
        self.s, self.rate, self.change = self.plan.start, self.plan.rate, 0.0
        self.elapsed = self.travelled = 0.0

    def governor(self):
        c, safety = self.supervisor.controller, self.supervisor.config.safety
        palms = [self.body(self.smoother.motion).palms[i].T_world.translation for i in (0, 1)]
        error = np.linalg.norm(palms - c.palm_positions(), axis=1).max()
        share = np.clip((safety.error_stop - error) / (safety.error_stop - safety.error_slow), 0.0, 1.0)
        capture = c.robot.com[:2] + c.robot.com_velocity[:2] / natural_frequency(c.robot.com[2])
        return min(share, np.clip(c.balance.support.margin(capture) / safety.balance_slow, 0.0, 1.0))

    def reference(self, q):
        self.s, self.rate, self.change = advanced(self.s, self.rate, self.change, DT, self.plan.rate * self.governor())
        target = HandMotion(np.stack([row_at(path, self.s) for path in self.plan.paths]))
        motion = step(self.smoother, time_scaled(target, self.rate, self.change).rows, DT)
        if self.s < self.last:
            self.elapsed, self.travelled = self.elapsed + DT, self.travelled + DT * self.rate
        row = self.body(motion).pack()
        safety, names = self.supervisor.config.safety, self.supervisor.robot.joint_names
        shares = np.array([0.0 if "_hand_" in x else 1.0 / 3.0 if "_wrist_" in x else 1.0 for x in names])
        distances, arms = shares * np.abs(q[7:] - row[96:139]), np.zeros((2, len(names)), dtype=bool)
        for arm, tool in zip(arms, SPEC.tools, strict=True):
            arm[self.supervisor.robot.joint_indices(self.supervisor.robot.arm_joints(tool.side))] = True
        distance = np.max(distances[~arms.any(axis=0)])
        body = 2.0 * distance / safety.posture_slow - 1.0
        for arm, at, palm in zip(arms, (9, 33), self.supervisor.controller.palm_positions(), strict=True):
            counts = np.clip(max(50.0 * np.linalg.norm(palm - row[at : at + 3]) - 1.0, body), 0.0, 1.0)
            distance = max(distance, counts * np.max(distances[arm]))
        share = (safety.posture_stop - distance) / (safety.posture_stop - safety.posture_slow)
        return row, np.clip(share, 1e-3, 1.0)

    def body(self, motion):
        track, rate = self.plan.trajectory, self.rate
        k = track.row(self.s)
        q, dq, ddq = track.q[k].copy(), rate * track.v[k, 6:], rate**2 * track.ddq[k]
        for i, tool in enumerate(SPEC.tools):
            j = self.supervisor.robot.joint_indices(tool.finger_joints)
            q[7 + j], dq[j], ddq[j] = motion.q_finger[i], motion.dq_finger[i], motion.ddq_finger[i]
        powers = rate ** np.arange(3)
        return BodyReference(
            palms=tuple(palm(motion, i) for i in (0, 1)),
            q=q,
            dq=dq,
            ddq=ddq,
            pelvis=tuple(part[k] * power for part, power in zip(track.pelvis, powers, strict=True)),
            torso=tuple(part[k] * power for part, power in zip(track.torso, powers, strict=True)),
            height=tuple(track.height[:, k] * powers),
            com=tuple(track.com[:, k] * powers[:, None]),
            momentum=(rate * track.momentum[0, k], rate**2 * track.momentum[1, k]),
        )


def palm(motion, i):
    R, offset = pin.Quaternion(motion.quat[i]).toRotationMatrix(), np.array(SPEC.tools[i].palm_offset)
    arm, w = R @ offset, motion.w[i]
    twist = np.concatenate([motion.v[i] + np.cross(w, arm), w])
    turning = np.cross(motion.alpha[i], arm) + np.cross(w, np.cross(w, arm))
    acceleration = np.concatenate([motion.a[i] + turning, motion.alpha[i]])
    return PalmReference(T_world=pin.SE3(R, motion.p[i] + arm), twist=twist, acceleration=acceleration)


def states(planned, n):
    """Configurations around the plan, and where centre of mass and palms are said to be: off by more and more."""
    supervisor, state, plan, _ = planned
    rng, robot = np.random.default_rng(3), supervisor.robot
    for k in range(n):
        q = plan.trajectory.q[min(k, len(plan.trajectory.q) - 1)].copy()
        q[7:] += rng.normal(0.0, 0.1 * k / n, 43)
        robot.com, robot.com_velocity = state.q[:3] + rng.normal(0.0, 0.05, 3), rng.normal(0.0, 0.1 * k / n, 3)
        yield q


@pytest.mark.parametrize("interpret", [False, True])
def test_a_tick_is_that_of_the_pieces(planned, interpret):
    one, pieces = follower(planned, interpret=interpret), Specification(planned)
    one.begin(planned[2], planned[3])
    slowed = trusted = False
    for q in states(planned, 60 if interpret else 1200):
        wanted, share = pieces.reference(q)
        got = one.reference(q).row
        assert np.abs(got - wanted).max() < 1e-10 * max(1.0, np.abs(wanted).max())
        assert abs(planned[0].controller.palms[0].trust - share) < 1e-12
        assert abs(one.s - pieces.s) < 1e-12
        assert abs(one.rate - pieces.rate) < 1e-12
        slowed, trusted = slowed or one.rate < 0.9, trusted or share < 1.0
    assert interpret or (slowed and trusted)
    assert abs(one.time_factor - pieces.elapsed / pieces.travelled) < 1e-12


def test_without_a_plan_the_stance_is_held(planned):
    one, state = follower(planned), planned[1]
    for _ in range(5):
        row = one.reference(state.q).row
    assert np.allclose(row[96:139], state.q[7:])
    assert np.abs(row[139:]).max() < 1e-12
    for T, tool in zip(one.palm_poses(), SPEC.tools, strict=True):
        assert np.allclose(T, planned[0].robot.pose(tool.palm_frame).homogeneous)
    assert one.time_factor == 1.0


def test_a_configuration_in_single_precision_is_read_as_what_it_is(planned):
    one = follower(planned)
    one.reference(planned[1].q.astype(np.float32))
    assert planned[0].controller.palms[0].trust == 1.0


@pytest.mark.parametrize("interpret", [False, True])
def test_what_is_foreseen_is_what_is_followed_then(planned, interpret):
    one, state = follower(planned, interpret=interpret), planned[1]
    one.begin(planned[2], planned[3])
    one.reference(state.q)
    ticks = 5 if interpret else 50
    foreseen = one.foreseen(ticks)
    for _ in range(ticks):
        one.reference(state.q)
    reached = one.foreseen(0)
    assert (one.rate, abs(foreseen.s - one.s) < 1e-12) == (1.0, True)
    np.testing.assert_allclose(foreseen.hands.rows, reached.hands.rows, atol=1e-12)
    np.testing.assert_allclose(foreseen.body.q, reached.body.q, atol=1e-12)
    np.testing.assert_allclose(foreseen.body.v, reached.body.v, atol=1e-12)


def test_a_plan_follows_time_and_not_ticks(planned):
    state, one, other = planned[1], follower(planned), follower(planned)
    for it in (one, other):
        it.begin(planned[2], planned[3])
    for k in range(60):
        one.reference(state.q)
        if k % 3 == 2:  # two ticks in three are lost
            other.reference(state.q, 3 * DT)
    assert abs(one.s - other.s) < 1e-3
    assert one.reference(state.q, 0.0).row[0] == one.row[0]
    before = one.s
    one.reference(state.q, 0.0)
    assert one.s == before


def test_a_plan_is_taken_over_beyond_its_start_and_below_its_speed(planned):
    one = follower(planned)
    one.begin(planned[2], planned[3], beyond=0.01, speed_fraction=0.5)
    assert (one.s, one.rate) == (planned[2].start + 0.01, 0.5 * planned[2].rate)


def test_off_any_plan_the_hands_are_let_go_of_and_one_posture_is_held(planned):
    one, state = follower(planned), planned[1]
    one.begin(planned[2], planned[3])
    for _ in range(20):
        one.reference(state.q)
    trajectory, _, rows = beginning(planned)
    one.stand(trajectory, rows)
    row = one.reference(state.q).row
    assert planned[0].controller.palms[0].trust == TRUST_MIN
    np.testing.assert_allclose(row[96:139][:29], state.q[7:36], atol=0.5)
    assert not row[139:].reshape(2, -1)[:, :12].any(), "legs rest"
    assert one.foreseen(10).rate == 0.0
