"""Strategy: each fixture is pushed by a known force at its joint and moves as what it is said to be; bodies that move
are put back where they were by their poses alone."""

import mujoco
import numpy as np
import pytest

from models import g1
from models.moving_bodies import moving_joints, poses_of, put
from models.mujoco_model import load_mujoco
from models.places import (
    BAR,
    BUTTON,
    BUTTON_FORCE,
    BUTTON_TRAVEL,
    DRAWER_FRICTION,
    LEVER,
    LEVER_TORQUE,
    LEVER_TURN,
    LOCKED_STIFFNESS,
    ON_TABLE,
)
from models.scenes import SceneFile
from models.scenes.fixtures import FIXTURE_JOINT

SPEC = g1()


def pushed(scene, force, seconds=2.0):
    """How far the fixture's joint is after a force or torque on it [m, rad], nothing in its way."""
    model = load_mujoco(SPEC, scene=scene)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    joint, robot, robot_v = data.joint(FIXTURE_JOINT), 7 + SPEC.n_joints, 6 + SPEC.n_joints
    start = data.qpos.copy()
    for _ in range(round(seconds / model.opt.timestep)):
        joint.qfrc_applied[:] = force
        mujoco.mj_step(model, data)
        data.qpos[:robot], data.qvel[:robot_v] = start[:robot], 0.0
    return float(joint.qpos[0])


def test_a_drawer_stays_below_its_friction_and_comes_out_above():
    assert pushed("drawer", 0.97 * DRAWER_FRICTION) < 1e-4
    assert pushed("drawer", DRAWER_FRICTION + 9.0) > 0.25


def test_a_locked_door_gives_by_its_spring():
    assert pushed("locked", 100.0, 4.0) == pytest.approx(100.0 / LOCKED_STIFFNESS, abs=1e-3)


@pytest.mark.parametrize(("scene", "forces", "travel"), [
    ("button", BUTTON_FORCE, BUTTON_TRAVEL), ("door", LEVER_TORQUE, LEVER_TURN)
])  # fmt: skip
def test_a_spring_holds_against_its_first_force_and_clicks_at_its_second(scene, forces, travel):
    low, high = forces
    assert pushed(scene, 0.8 * low) < 0.02 * travel + 1e-3
    assert pushed(scene, 0.5 * (low + high)) == pytest.approx(0.5 * travel, rel=0.15)
    assert pushed(scene, 1.15 * high) > travel


@pytest.mark.parametrize(("scene", "body", "place"), [
    ("drawer", "bar", BAR), ("locked", "bar", BAR), ("button", "button", BUTTON), ("door", "lever", LEVER)
])  # fmt: skip
def test_fixtures_are_where_the_places_say(scene, body, place):
    model = load_mujoco(SPEC, scene=scene)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    at = data.geom("bar").xpos if body == "bar" else data.body(body).xpos
    np.testing.assert_allclose(at, place, atol=1e-9)


@pytest.mark.parametrize(
    ("thing", "mass", "y"), [("flask", 1.0, ON_TABLE[1]), ("carton", 1.0, 0.0), ("crate", 2.0, 0.0)]
)
def test_objects_have_the_mass_that_they_are_said_to_have(thing, mass, y):
    model = load_mujoco(SPEC, scene=f"table_{thing}")
    assert model.body("object").mass[0] == pytest.approx(mass)
    np.testing.assert_allclose(model.body("object").pos[:2], [ON_TABLE[0], y])


XML = """<mujoco><worldbody>
<body name="ball" pos="0.6 0.2 0.8"><freejoint/><geom size="0.05"/></body>
<body name="slide" pos="1 0 1" euler="0 0 90"><joint type="slide" axis="1 0 0"/><geom size="0.05"/></body>
<body name="hinge" pos="1 1 1" euler="30 0 0"><joint axis="0 1 0" pos="0.1 0 0.2"/><geom size="0.05"/></body>
<body name="socket" pos="1 2 1" euler="0 20 0"><joint type="ball" pos="0 0.1 0"/><geom size="0.05"/>
<body pos="0.2 0 0"><joint/><geom size="0.05"/></body></body>
<body name="two" pos="1 3 1"><joint type="slide" axis="1 0 0"/><joint axis="0 1 0"/><geom size="0.05"/></body>
</worldbody></mujoco>"""


def test_bodies_are_put_back_by_their_poses_alone():
    model = load_mujoco(SPEC, scene=SceneFile("moving", XML))
    data, joints = mujoco.MjData(model), moving_joints(model)
    names = [model.body(model.jnt_bodyid[j]).name for j in joints]
    assert names == ["scene_ball", "scene_slide", "scene_hinge", "scene_socket"]
    rng = np.random.default_rng(0)
    for _ in range(20):
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.qvel[:] = rng.normal(size=model.nv)
        mujoco.mj_integratePos(model, data.qpos, data.qvel, 1.0)
        mujoco.mj_kinematics(model, data)
        poses = poses_of(model, data.qpos, joints)
        for name, pose in zip(names, poses, strict=True):
            np.testing.assert_allclose(pose[:3], data.body(name).xpos, atol=1e-12)
            assert abs(pose[3:] @ data.body(name).xquat) == pytest.approx(1.0, abs=1e-12)
        before, places = data.qpos.copy(), [data.body(name).xpos.copy() for name in names]
        data.qpos[7 + SPEC.n_joints :] = model.qpos0[7 + SPEC.n_joints :]
        put(model, data.qpos, joints, poses)
        mujoco.mj_kinematics(model, data)
        assert np.abs(before - data.qpos).max() > 1e-3  # the body with two joints is not among them
        np.testing.assert_allclose([data.body(name).xpos for name in names], places, atol=1e-9)
        np.testing.assert_allclose(poses_of(model, data.qpos, joints), poses, atol=1e-9)
