"""Pinocchio and MuJoCo are the same robot.

Strategy: 200 random states, base anywhere, speeds up to 5, and everything a controller asks a model for is compared
after `models.conversion`. Difference: max |a - b| / max(1, |b|).
"""

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.conversion import Conversion
from models.mujoco_model import load_mujoco
from models.pinocchio_model import load_pinocchio

N_STATES = 200
TOLERANCE = 1e-10


def difference(a, b):
    return float(np.max(np.abs(np.asarray(a) - b) / np.maximum(1.0, np.abs(b))))


class Pair:
    """One robot in both libraries, put into random states."""

    def __init__(self, hands, scene, payload):
        self.spec = g1(hands)
        self.model = load_pinocchio(self.spec, payload_kg=payload)
        self.data = self.model.createData()
        self.mj_model = load_mujoco(self.spec, scene=scene, payload_kg=payload)
        # Random states are full of contacts; their forces are no part of the comparison and slow to compute.
        self.mj_model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.mj_data = mujoco.MjData(self.mj_model)
        self.convert = Conversion(self.spec, self.model, self.mj_model)

    def states(self):
        rng = np.random.default_rng(0)
        for _ in range(N_STATES):
            quat = rng.normal(size=4)
            angles = rng.uniform(self.model.lowerPositionLimit[7:], self.model.upperPositionLimit[7:])
            q = np.concatenate([rng.uniform(-10, 10, 3), quat / np.linalg.norm(quat), angles])
            v = rng.uniform(-5, 5, self.model.nv)
            self.convert.to_mujoco(q, v, self.mj_data.qpos, self.mj_data.qvel)
            mujoco.mj_forward(self.mj_model, self.mj_data)
            yield q, v

    def mass_matrix(self):
        M = np.zeros((self.mj_model.nv, self.mj_model.nv))
        mujoco.mj_fullM(self.mj_model, self.mj_data, M)
        return M

    def shared_bodies(self):
        for i in range(1, self.mj_model.nbody):
            name = self.mj_model.body(i).name
            if self.model.existFrame(name):
                yield i, self.model.getFrameId(name)


@pytest.fixture(
    scope="module",
    params=[
        pytest.param((True, "floor", (0.0, 0.0)), id="dex3"),
        pytest.param((False, "floor", (0.0, 0.0)), id="rubber"),
        pytest.param((True, "table_cylinder", (0.0, 0.0)), id="free-object"),
        pytest.param((True, "floor", (1.5, 0.7)), id="payload"),
    ],
)
def pair(request):
    return Pair(*request.param)


def test_mass_and_com_agree(pair):
    robot = pair.mj_model.body(pair.spec.base_body).id
    assert difference(pin.computeTotalMass(pair.model), pair.mj_model.body_subtreemass[robot]) < TOLERANCE
    for q, _ in pair.states():
        assert difference(pin.centerOfMass(pair.model, pair.data, q), pair.mj_data.subtree_com[robot]) < TOLERANCE


def test_mass_matrices_agree_armature_included(pair):
    for q, _ in pair.states():
        M = pin.crba(pair.model, pair.data, q)
        M = np.triu(M) + np.triu(M, 1).T
        assert difference(M, pair.convert.mass_matrix_to_pinocchio(q, pair.mass_matrix())) < TOLERANCE


def test_bias_forces_agree(pair):
    for q, v in pair.states():
        ours = pin.nonLinearEffects(pair.model, pair.data, q, v)
        theirs = pair.convert.bias_to_pinocchio(q, v, pair.mj_data.qfrc_bias, pair.mass_matrix())
        assert difference(ours, theirs) < TOLERANCE


def test_placements_of_all_bodies_and_sites_agree(pair):
    data, mj_data = pair.data, pair.mj_data
    bodies = list(pair.shared_bodies())
    assert len(bodies) == (53 if pair.spec.n_joints == 43 else 39)
    for q, _ in pair.states():
        pin.framesForwardKinematics(pair.model, data, q)
        for body, frame in bodies:
            assert difference(data.oMf[frame].translation, mj_data.xpos[body]) < TOLERANCE
            assert difference(data.oMf[frame].rotation, mj_data.xmat[body].reshape(3, 3)) < TOLERANCE
        for tool in pair.spec.tools:
            palm = data.oMf[pair.model.getFrameId(tool.palm_frame)].translation
            assert difference(palm, mj_data.site(tool.palm_frame).xpos) < TOLERANCE
        for foot in pair.spec.feet:
            sole = data.oMf[pair.model.getFrameId(foot.frame)].act(foot.sole_center)
            assert difference(sole, mj_data.site(f"{foot.side}_sole").xpos) < TOLERANCE


def test_velocities_of_all_bodies_agree(pair):
    twist = np.zeros(6)
    bodies = list(pair.shared_bodies())
    for q, v in pair.states():
        pin.forwardKinematics(pair.model, pair.data, q, v)
        for body, frame in bodies:
            mujoco.mj_objectVelocity(pair.mj_model, pair.mj_data, mujoco.mjtObj.mjOBJ_XBODY, body, twist, 0)
            ours = pin.getFrameVelocity(pair.model, pair.data, frame, pin.LOCAL_WORLD_ALIGNED)
            assert difference(ours.angular, twist[:3]) < TOLERANCE
            assert difference(ours.linear, twist[3:]) < TOLERANCE


def test_inverse_dynamics_agree(pair):
    rng = np.random.default_rng(1)
    for q, v in pair.states():
        a = rng.uniform(-20, 20, pair.model.nv)
        pair.mj_data.qacc[:] = 0.0
        pair.convert.acceleration_to_mujoco(q, v, a, pair.mj_data.qacc)
        mujoco.mj_inverse(pair.mj_model, pair.mj_data)
        theirs = pair.convert.force_to_pinocchio(q, pair.mj_data.qfrc_inverse)
        assert difference(pin.rnea(pair.model, pair.data, q, v, a), theirs) < TOLERANCE


def test_limits_agree(pair):
    for joint in pair.spec.joints:
        entry = pair.model.joints[pair.model.getJointId(joint.name)]
        hinge, motor = pair.mj_model.joint(joint.name), pair.mj_model.actuator(joint.name)
        np.testing.assert_allclose(
            hinge.range, [pair.model.lowerPositionLimit[entry.idx_q], pair.model.upperPositionLimit[entry.idx_q]]
        )
        effort = pair.model.effortLimit[entry.idx_v]
        np.testing.assert_array_equal(motor.ctrlrange, [-effort, effort])
        np.testing.assert_array_equal(pair.mj_model.jnt_actfrcrange[hinge.id], [-effort, effort])
        assert pair.mj_model.dof_armature[hinge.dofadr[0]] == pair.model.armature[entry.idx_v]
