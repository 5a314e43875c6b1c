"""Strategy: the compiled dynamics against Pinocchio through `Robot`, on random states with the base anywhere."""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from wholebody.errors import InputError
from wholebody.jit.entry import Entry
from wholebody.robot.body_table import body_table
from wholebody.robot.kernels import rigid_body as core
from wholebody.robot.state import Robot

STATES = 200
TOLERANCE = 1e-10


class CompiledDynamics:
    """The compiled `rigid_body.dynamics` on memory of its own."""

    compute = Entry(core.dynamics)

    def __init__(self, model):
        nv, n = model.nv, model.njoints - 1
        table, parent = body_table(model)
        self.q, self.v = np.zeros(model.nq), np.zeros(nv)
        self.R, self.p, self.S = np.zeros((n, 3, 3)), np.zeros((n, 3)), np.zeros((nv, 6))
        self.V, self.A, self.M = np.zeros((n, 6)), np.zeros((n, 6)), np.zeros((nv, nv))
        self.nle, self.sums = np.zeros(nv), np.zeros(core.SUMS)
        self.arguments = (
            self.q, self.v, table, parent, np.array(model.armature), np.array(model.gravity.linear), self.R, self.p,
            self.S, self.V, self.A, np.zeros((n, 10)), np.zeros((n, 6)), np.zeros((n, 6)), self.M, np.zeros((nv, 6)),
            self.nle, self.sums,
        )  # fmt: skip

    def update(self, q, v):
        self.q[:], self.v[:] = q, v
        self.compute(*self.arguments)


@pytest.fixture(scope="module", params=[True, False], ids=["hands", "rubber"])
def pair(request):
    robot = Robot(g1(hands=request.param))
    return robot, CompiledDynamics(robot.model)


def states(robot, seed, count=STATES):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        q = pin.randomConfiguration(robot.model, np.full(robot.nq, -2.0), np.full(robot.nq, 2.0))
        q[:3], q[7:] = rng.uniform(-5.0, 5.0, 3), rng.uniform(-2.5, 2.5, robot.n_joints)
        yield q, rng.uniform(-5.0, 5.0, robot.nv)


def difference(found, expected):
    """Largest |found - expected| / max(1, |expected|)."""
    return np.max(np.abs(found - expected) / np.maximum(1.0, np.abs(expected)))


def test_mass_matrix_bias_and_sums_are_those_of_pinocchio(pair):
    robot, fast = pair
    for q, v in states(robot, 1):
        robot.update(q, v)
        fast.update(q, v)
        sums = fast.sums
        expected = {core.COM: robot.com, core.COM_V: robot.com_velocity, core.COM_DRIFT: robot.drift_com}
        expected |= {core.MOMENTUM: robot.momentum[3:], core.MOMENTUM_DRIFT: robot.drift_momentum[3:]}
        assert difference(fast.M, robot.M) <= TOLERANCE
        assert difference(fast.nle, robot.nle) <= TOLERANCE
        for at, value in expected.items():
            assert difference(sums[at : at + 3], value) <= TOLERANCE
        assert sums[core.TOTAL_MASS] == pytest.approx(robot.mass, abs=1e-12)


def test_joint_frames_twists_and_drifts_are_those_of_pinocchio(pair):
    robot, fast = pair
    frame = pin.LOCAL_WORLD_ALIGNED
    for q, v in states(robot, 2, 20):
        robot.update(q, v)
        fast.update(q, v)
        for i in range(1, robot.model.njoints):
            p, V, A = fast.p[i - 1], fast.V[i - 1], fast.A[i - 1]
            w = V[3:]
            assert difference(fast.R[i - 1], robot.data.oMi[i].rotation) <= TOLERANCE
            assert difference(q[:3] + p, robot.data.oMi[i].translation) <= TOLERANCE
            twist = pin.getVelocity(robot.model, robot.data, i, frame)
            velocity = V[:3] + np.cross(w, p)
            assert difference(velocity, twist.linear) <= TOLERANCE
            assert difference(w, twist.angular) <= TOLERANCE
            drift = pin.getClassicalAcceleration(robot.model, robot.data, i, frame)
            acceleration = A[:3] + np.cross(A[3:], p) + np.cross(w, velocity)
            assert difference(acceleration, drift.linear) <= TOLERANCE
            assert difference(A[3:], drift.angular) <= TOLERANCE


def test_a_model_without_a_free_flyer_is_refused():
    with pytest.raises(InputError, match="load_pinocchio"):
        body_table(pin.buildSampleModelManipulator())
