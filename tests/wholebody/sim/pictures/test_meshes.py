"""Strategy: what is drawn is compared with the robot's own meshes: fewer triangles, in the same places."""

import mujoco
import numpy as np

from models import g1
from models.mujoco_model import load_mujoco
from wholebody.sim.pictures.drawing import drawn_model
from wholebody.sim.pictures.meshes import CELLS


def corners(model, body):
    """Least and largest coordinates of the meshes of a body in its axes, shape (2, 3), [m]."""
    found = []
    for g in np.flatnonzero((model.geom_bodyid == model.body(body).id) & (model.geom_group == 2)):
        mesh, R = int(model.geom_dataid[g]), np.zeros(9)
        mujoco.mju_quat2Mat(R, model.geom_quat[g])
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        found.append(model.mesh_vert[first : first + count] @ R.reshape(3, 3).T + model.geom_pos[g])
    points = np.concatenate(found)
    return np.array([points.min(axis=0), points.max(axis=0)])


def test_pictures_have_a_third_of_the_triangles_in_the_same_places():
    """A frame took 2 s without a graphics card, nearly all for triangles smaller than a pixel."""
    whole, drawn = load_mujoco(g1(), visuals=True), drawn_model(g1(), "floor")
    assert drawn.nmeshface < whole.nmeshface / 3
    assert drawn.nq == whole.nq
    for body in ("torso_link", "left_knee_link", "right_elbow_link", "left_wrist_yaw_link"):
        before, after = corners(whole, body), corners(drawn, body)
        assert np.abs(after - before).max() <= CELLS * np.ptp(before, axis=0).max()
