"""Strategy: a G1 with locked joints is the G1 whose joints are at zero: masses, frames and forces are compared with the
whole one's, in Pinocchio and in MuJoCo.
"""

import pickle

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from models import RobotSpecError, g1
from models.mujoco_model import load_mujoco
from models.pinocchio_model import load_pinocchio, stance_q
from models.robots import robot_with
from models.unitree_g1 import LOCKED

VARIANTS = [
    pytest.param(hands, LOCKED[n], id=f"{n}{' with hands' if hands else ''}") for hands in (True, False) for n in LOCKED
]


@pytest.mark.parametrize(("hands", "locked"), VARIANTS)
def test_a_locked_robot_is_the_whole_one_with_these_joints_at_zero(hands, locked):
    spec, whole = g1(hands, locked=locked), g1(hands)
    model, full = load_pinocchio(spec), load_pinocchio(whole)
    rng = np.random.default_rng(0)
    angles = dict(zip(spec.joint_names, rng.uniform(-0.5, 0.5, spec.n_joints), strict=True))
    placed = []
    for m in (model, full):
        q = stance_q(spec if m is model else whole, m)
        for name in list(m.names)[2:]:
            q[m.joints[m.getJointId(name)].idx_q] = angles.get(name, 0.0)
        data = m.createData()
        pin.framesForwardKinematics(m, data, q)
        frames = [tool.palm_frame for tool in spec.tools] + [foot.frame for foot in spec.feet] + [spec.torso_body]
        tau = dict(zip(list(m.names)[2:], pin.rnea(m, data, q, np.zeros(m.nv), np.zeros(m.nv))[6:], strict=True))
        poses = [data.oMf[m.getFrameId(name)].homogeneous for name in frames]
        placed.append((pin.computeTotalMass(m), poses, [tau[name] for name in spec.joint_names]))
    for found, expected in zip(*placed, strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-10)


@pytest.mark.parametrize(("hands", "locked"), VARIANTS)
def test_mujoco_has_the_same_joints_and_mass(hands, locked):
    spec = g1(hands, locked=locked)
    mj, model = load_mujoco(spec), load_pinocchio(spec)
    assert {mj.joint(i).name for i in range(1, mj.njnt)} == set(spec.joint_names)
    assert mujoco.mj_getTotalmass(mj) == pytest.approx(pin.computeTotalMass(model), abs=1e-10)


def test_unitrees_variants_have_the_joints_of_their_names():
    numbers = {name: len(g1(locked=locked).body_joints) for name, locked in LOCKED.items()}
    assert numbers == {"29dof": 29, "27dof": 27, "locked_waist": 26, "23dof": 23}


def test_what_is_no_joint_of_waist_and_arms_is_not_locked():
    with pytest.raises(RobotSpecError, match="waist_yaw_joint"):
        g1(locked=("left_knee_joint",))


def test_a_robot_is_the_same_key_in_every_process():
    spec = g1(locked=LOCKED["27dof"])
    assert spec.limbs["waist"].tolist() == [12]
    again = pickle.loads(pickle.dumps(spec))  # noqa: S301 - our own bytes
    assert again == spec
    assert hash(again) == hash(spec)
    assert "_hash" not in spec.__getstate__()


def test_a_robot_is_known_by_its_joints_however_ordered():
    for locked in LOCKED.values():
        spec = g1(locked=locked)
        assert robot_with(sorted(spec.joint_names)) == spec
    assert robot_with(g1(hands=False).joint_names) == g1(hands=False)
    with pytest.raises(RobotSpecError, match="2 joints, 'a' among them"):
        robot_with(["b", "a"])
