"""Strategy: where hands go is held against the hulls of the hand in MuJoCo and the places of the scenes; forces that
are expected are there while something is touched, and nowhere else."""

import mujoco
import numpy as np
import pytest

from models import g1
from models.mujoco_model import load_mujoco
from models.places import BUTTON, BUTTON_TRAVEL, CARTON_WIDTH, CRATE_WIDTH, LEVER, LEVER_TURN, TABLE_HEIGHT, WALL_AHEAD
from policy import PolicyError, scripted_policy
from policy.action_spec.hands import grasp_posture
from policy.scripted.contact import (
    FINGERS_AHEAD,
    FIST_AHEAD,
    FLAT_HAND,
    HAND_BACK,
    HAND_HALF,
    PALM_FACE,
    lift_box,
    lift_up,
    press,
    pull_drawer,
    touch,
    turn_handle,
    wipe,
)
from policy.scripted.library import hand_over
from policy.scripted.policy import stance_pose

SPEC = g1()


def extent(fingers):
    """Least and largest coordinates of the left hand's hulls in the stance, from its palm point [m]."""
    model = load_mujoco(SPEC)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for name, angle in zip(SPEC.tool("left").finger_joints, fingers, strict=True):
        data.joint(name).qpos[:] = angle
    mujoco.mj_forward(model, data)
    points = []
    for g in range(model.ngeom):
        name = model.body(model.geom_bodyid[g]).name
        if "left_hand" in name and "thumb" not in name and model.geom_type[g] == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.geom_dataid[g]
            first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
            corners = model.mesh_vert[first : first + count] @ data.geom_xmat[g].reshape(3, 3).T
            points.append(corners + data.geom_xpos[g] - data.site("left_palm_point").xpos)
    points = np.vstack(points)
    return points.min(axis=0), points.max(axis=0)


def test_the_hand_is_as_large_as_the_scripts_take_it_to_be():
    low, high = extent(stance_pose().q_lhand)
    assert high[0] == pytest.approx(FINGERS_AHEAD, abs=1e-3)
    assert (-low[2], high[2]) == pytest.approx((HAND_HALF, HAND_HALF), abs=1e-3)
    assert high[1] < HAND_BACK < high[1] + 0.007  # the wrist is thicker than the palm
    assert extent(grasp_posture("left", 1.0))[1][0] == pytest.approx(FIST_AHEAD, abs=1e-3)
    assert -extent(FLAT_HAND)[0][1] == pytest.approx(PALM_FACE, abs=5e-3)


@pytest.mark.parametrize("direction", ["down", "ahead", "side", "up"])
@pytest.mark.parametrize("hands", ["left", "right", "both"])
def test_touch_goes_in_as_deep_and_as_fast_as_it_is_told(direction, hands):
    policy = touch(direction, hands, speed=0.2, depth=0.05, begin=3.0, hold=1.0)
    t = np.arange(0.0, policy.duration + 1.0, 0.002)
    motion = policy.script(t)
    for hand, side in (("l", "left"), ("r", "right")):
        p = getattr(motion, f"p_world_{hand}palm")
        if hands not in (side, "both"):
            assert np.ptp(p, axis=0).max() < 1e-9
            continue
        way = p[t > 3.0] - p[np.searchsorted(t, 3.0)]
        axis = {"down": [0, 0, -1], "ahead": [1, 0, 0], "up": [0, 0, 1]}.get(
            direction, [0, 1 if hand == "l" else -1, 0]
        )
        along = way @ np.array(axis, dtype=float)
        assert along.max() == pytest.approx(0.05 + 0.05, abs=1e-6)
        assert np.abs(way - along[:, None] * np.array(axis)).max() < 1e-9
        assert np.abs(np.gradient(along, 0.002)).max() == pytest.approx(0.2, rel=0.01)
        assert along[-1] == pytest.approx(0.0, abs=1e-9)


def test_touch_ends_where_the_surface_is():
    table, wall = touch("down", depth=0.02), touch("ahead", depth=0.02, fist=True)
    assert table.script(np.array([table.duration / 2.0])).p_world_lpalm[0, 2] == pytest.approx(
        TABLE_HEIGHT + HAND_HALF - 0.02
    )
    assert wall.script(np.array([wall.duration / 2.0])).p_world_lpalm[0, 0] == pytest.approx(
        WALL_AHEAD - FIST_AHEAD + 0.02
    )


@pytest.mark.parametrize("name", ["wipe", "press", "pull_drawer", "turn_handle", "lift_box", "hand_over"])
def test_forces_are_expected_of_what_is_touched_and_of_nothing_before_or_after(name):
    policy = scripted_policy(name)
    motion = policy.script(np.array([0.0, 2.0, policy.duration, policy.duration + 9.0]))
    assert not motion.f_world_lpalm.any()
    assert not motion.f_world_rpalm.any()


def test_forces_point_as_the_world_pushes_back():
    t = np.arange(0.0, 30.0, 0.01)
    forces = {policy.name: (policy.script(t).f_world_lpalm, policy.script(t).f_world_rpalm)
              for policy in (wipe(), press(), pull_drawer(), turn_handle(), lift_box(), hand_over())}  # fmt: skip
    assert forces["wipe"][0].max(axis=0) == pytest.approx([0.0, 0.0, 10.0])
    assert forces["press"][1].min(axis=0) == pytest.approx([-20.0, 0.0, 0.0])
    assert forces["pull_drawer"][1].max(axis=0) == pytest.approx([30.0, 0.0, 0.0])
    lever = forces["turn_handle"][1]
    most = np.linalg.norm(lever, axis=1).max()
    assert most == pytest.approx(
        (1.0 + (LEVER_TURN + 0.1) / LEVER_TURN) / (0.10 - PALM_FACE)
    )  # of its torque, at the palm's edge
    assert (lever[:, 1:] >= 0.0).all()
    assert forces["hand_over"][0].min(axis=0) == pytest.approx([0.0, 0.0, -9.81])
    left, right = forces["lift_box"]
    assert (left + right).min(axis=0) == pytest.approx([0.0, 0.0, -2.0 * 9.81])
    assert np.abs(left + right)[:, 1].max() < 1e-9  # what squeezes the crate cancels out
    assert (left[:, 1].max(), right[:, 1].min()) == pytest.approx((25.0, -25.0))


@pytest.mark.parametrize(("width", "mass"), [(CARTON_WIDTH, 1.0), (CRATE_WIDTH, 2.0)])
def test_a_box_is_lifted_from_where_it_stands_squeezed_before_it_rises(width, mass):
    policy = lift_up(width, mass, (0.02, -0.01), squeeze=32.0)
    motion = policy.script(np.array([0.0, 4.2, 5.2, 7.2, policy.duration]))
    apart, middle = motion.p_world_lpalm - motion.p_world_rpalm, 0.5 * (motion.p_world_lpalm + motion.p_world_rpalm)
    assert apart[1:3, 1] == pytest.approx([width + 2.0 * PALM_FACE, width + 2.0 * PALM_FACE - 0.06])
    assert middle[3] - middle[2] == pytest.approx([0.0, 0.0, 0.10])
    assert middle[2, 1] == pytest.approx(-0.01)
    assert motion.f_world_lpalm[:3, 1] == pytest.approx([0.0, 0.0, 32.0])
    assert (motion.f_world_lpalm + motion.f_world_rpalm)[-1] == pytest.approx([0.0, 0.0, -9.81 * mass])


def test_tasks_go_to_the_places_of_their_scenes():
    t = np.arange(0.0, 20.0, 0.01)
    pressed = press().script(t).p_world_rpalm
    assert pressed[:, 0].max() + FIST_AHEAD > BUTTON[0] + BUTTON_TRAVEL
    assert np.abs(pressed[pressed[:, 0].argmax(), 1:] - BUTTON[1:]).max() < 1e-9
    low = turn_handle().script(t).p_world_rpalm[:, 2].min()
    assert LEVER[2] - low > (0.10 * np.sin(LEVER_TURN)) - HAND_HALF - 0.01
    out = pull_drawer(pull=0.27).script(np.array([5.4, 11.4])).p_world_rpalm
    assert out[0] - out[1] == pytest.approx([0.27, 0.0, 0.0])
    held = lift_box().script(np.array([6.0, 9.0]))
    width = (held.p_world_lpalm - held.p_world_rpalm)[:, 1]
    assert (width < CRATE_WIDTH + 2.0 * PALM_FACE).all()
    assert np.ptp(width) < 1e-9


def test_misuse_of_touch_says_what_would_work():
    with pytest.raises(PolicyError, match="one of down, ahead, side, up"):
        touch("below")
    with pytest.raises(PolicyError, match="one of left, right, both"):
        touch("down", "none")
    with pytest.raises(PolicyError, match="above 0"):
        touch("down", speed=0.0)
