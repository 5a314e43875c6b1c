"""Strategy: a second humanoid by one file: what its description says agrees with its URDF and between both physics, and
it stands on its soles. That it reaches is tested with the other robots, in `test_second_humanoid.py`.
"""

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from models.mujoco_model import load_mujoco
from models.pinocchio_model import load_pinocchio, stance_q
from models.talos import COVERED, LOCKED, talos


@pytest.fixture(scope="module")
def model():
    return load_pinocchio(talos())


def test_it_stands_with_flat_soles_and_its_mass_over_their_middle(model):
    spec, data = talos(), model.createData()
    q = stance_q(spec, model)
    pin.framesForwardKinematics(model, data, q)
    points = []
    for foot in spec.feet:
        T = data.oMf[model.getFrameId(foot.frame)]
        assert np.abs(T.rotation - np.eye(3)).max() < 1e-6
        points += [T.act(point) for point in foot.points]
    assert np.abs(np.array(points)[:, 2]).max() < 1e-6
    assert np.abs(pin.centerOfMass(model, data, q)[:2] - np.mean(points, axis=0)[:2]).max() < 1e-3


def test_both_physics_have_the_same_robot(model):
    spec, mj = talos(), load_mujoco(talos())
    assert {mj.joint(i).name for i in range(1, mj.njnt)} == set(spec.joint_names)
    assert mujoco.mj_getTotalmass(mj) == pytest.approx(pin.computeTotalMass(model), abs=1e-9)
    assert model.nv == 6 + 28
    assert not set(LOCKED) & set(spec.joint_names)


def test_it_stands_on_spheres_and_covered_links_have_no_shapes():
    mj = load_mujoco(talos())
    for foot in talos().feet:
        body = mj.body(foot.frame)
        first, count = int(body.geomadr[0]), int(body.geomnum[0])
        assert count == len(foot.contact_points)
        assert (mj.geom_type[first : first + count] == mujoco.mjtGeom.mjGEOM_SPHERE).all()
    assert all(int(mj.body(link).geomnum[0]) == 0 for link in COVERED)
