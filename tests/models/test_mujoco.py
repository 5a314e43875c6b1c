"""The MuJoCo model: actuators, contacts, sensors, payload, scenes, and what loading costs."""

import subprocess
import sys

import mujoco
import numpy as np
import pytest

from models import RobotSpecError, g1
from models.mujoco_model import BASE_JOINT, STANCE_KEY, build_mujoco, load_mujoco
from models.scenes import SCENES
from models.urdf import JointTree, light_urdf, parse


@pytest.fixture(scope="module")
def spec():
    return g1()


@pytest.fixture(scope="module")
def model(spec):
    return load_mujoco(spec)


def in_stance(model):
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(STANCE_KEY).id)
    mujoco.mj_forward(model, data)
    return data


def contact_pairs(model, data):
    return [{model.geom(contact.geom1).name, model.geom(contact.geom2).name} for contact in data.contact]


def hold(model, data, spec, target, seconds, watch):
    """Step with the spec's PD gains around joint angles in motor order."""
    joints = [model.joint(name) for name in spec.joint_names]
    qpos, qvel = [joint.qposadr[0] for joint in joints], [joint.dofadr[0] for joint in joints]
    for _ in range(round(seconds / model.opt.timestep)):
        data.ctrl[:] = spec.kp * (target - data.qpos[qpos]) - spec.kd * data.qvel[qvel]
        mujoco.mj_step(model, data)
        watch(data)
    return data.qpos[qpos] - target


def test_physics_settings_are_those_every_bar_is_measured_with(model):
    assert model.opt.timestep == 0.002
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert model.opt.impratio == 10.0
    assert load_mujoco(g1(hands=False), timestep=0.001).opt.timestep == 0.001


def test_motors_are_in_motor_order_with_effort_as_range(spec, model):
    assert [model.actuator(i).name for i in range(model.nu)] == list(spec.joint_names)
    np.testing.assert_array_equal(model.actuator_ctrlrange[:, 1], spec.effort_max)
    np.testing.assert_array_equal(model.actuator_ctrlrange[:, 0], -spec.effort_max)
    assert model.actuator_ctrllimited.all()


def test_a_command_is_the_torque_at_the_joint_and_is_clipped(spec, model):
    data = in_stance(model)
    data.ctrl[:] = np.where(np.arange(model.nu) % 2, 1e6, 0.25)
    mujoco.mj_forward(model, data)
    for i, name in enumerate(spec.joint_names):
        assert data.joint(name).qfrc_actuator[0] == (spec.effort_max[i] if i % 2 else 0.25)


def test_damping_and_dry_friction_are_zero_unless_wanted(model):
    assert not model.dof_damping.any()
    assert not model.dof_frictionloss.any()
    changed = load_mujoco(g1(hands=False).with_joints({".*": {"damping": 0.05, "friction_loss": 0.2}}))
    assert set(changed.dof_damping[6:]) == {0.05}
    assert set(changed.dof_frictionloss[6:]) == {0.2}
    assert not changed.dof_damping[:6].any()


@pytest.mark.parametrize("hands", [True, False])
def test_in_the_stance_only_the_soles_touch_the_floor(hands):
    model = load_mujoco(g1(hands))
    data = in_stance(model)
    data.qpos[2] -= 1e-5
    mujoco.mj_forward(model, data)
    pairs = contact_pairs(model, data)
    assert len(pairs) == 8
    assert all("floor" in pair and any("ankle_roll" in name for name in pair) for pair in pairs)
    np.testing.assert_allclose(data.subtree_com[1][:2], 0, atol=1e-3)
    for side, y in (("left", 0.119), ("right", -0.119)):
        np.testing.assert_allclose(data.site(f"{side}_sole").xpos, [0, y, -1e-5], atol=1e-6)


def test_friction_of_the_feet_is_the_one_asked_for(spec):
    model = load_mujoco(g1(hands=False), friction=0.3)
    data = in_stance(model)
    data.qpos[2] -= 1e-4
    mujoco.mj_forward(model, data)
    assert {contact.friction[0] for contact in data.contact} == {0.3}
    for wrong in (0.0, -0.1, float("nan")):
        with pytest.raises(RobotSpecError, match="friction"):
            load_mujoco(spec, friction=wrong)
        with pytest.raises(RobotSpecError, match="timestep"):
            load_mujoco(spec, timestep=wrong)


@pytest.mark.parametrize(
    ("change", "first", "second"),
    [
        ({"left_shoulder_roll_joint": -0.4}, "left", "torso"),
        ({"right_hip_roll_joint": 0.4, "left_hip_roll_joint": -0.4}, "left", "right"),
        (
            {"left_elbow_joint": -1.0, "left_shoulder_pitch_joint": -1.9, "left_shoulder_yaw_joint": -0.7},
            "hand",
            "head",
        ),
    ],
)
def test_the_robot_collides_with_itself(model, change, first, second):
    data = in_stance(model)
    for name, angle in change.items():
        data.joint(name).qpos[0] = angle
    mujoco.mj_forward(model, data)
    pairs = [pair for pair in contact_pairs(model, data) if "floor" not in pair]
    assert any(any(first in name for name in pair) and any(second in name for name in pair) for pair in pairs), pairs


def test_neighbours_never_collide(spec, model):
    """Shells of links within two joints overlap by design; contact forces there would lock the joints."""
    tree = JointTree(parse(light_urdf(spec)))
    data = in_stance(model)
    rng = np.random.default_rng(0)
    seen = set()
    for _ in range(100):
        data.qpos[7:] = rng.uniform(model.jnt_range[1:, 0], model.jnt_range[1:, 1])
        mujoco.mj_forward(model, data)
        bodies = [sorted(model.body(model.geom_bodyid[geom]).name for geom in c.geom) for c in data.contact]
        seen |= {tree.joints_between(*pair) for pair in bodies if "world" not in pair}
    assert min(seen) == 3
    assert max(seen) > 10


@pytest.mark.parametrize("closed", [0.0, 0.5, 1.0])
def test_fingers_may_touch_each_other_without_shaking(spec, model, closed):
    model.opt.gravity[:] = 0.0
    data = in_stance(model)
    target = spec.stance.joints.copy()
    bounds = np.where(np.abs(spec.position_max) > np.abs(spec.position_min), spec.position_max, spec.position_min)
    fingers = [i for i, name in enumerate(spec.joint_names) if "_hand_" in name and "thumb_0" not in name]
    target[fingers] = closed * bounds[fingers]
    deepest = [0.0]
    hold(model, data, spec, target, 1.5, lambda d: deepest.append(min((c.dist for c in d.contact), default=0.0)))
    model.opt.gravity[:] = (0.0, 0.0, -9.81)
    assert np.abs(data.qvel).max() < 0.05
    assert min(deepest) > -0.005


def test_imu_measures_gravity_and_turning(model):
    data = in_stance(model)
    data.qvel[3:6] = (0.1, -0.2, 0.3)
    data.qacc[:] = 0.0
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.sensor("imu_gyro").data, [0.1, -0.2, 0.3], atol=1e-12)
    np.testing.assert_allclose(data.sensor("imu_quat").data, [1, 0, 0, 0], atol=1e-12)
    assert data.sensor("imu_accelerometer").data.shape == (3,)


def test_payload_is_refused_when_senseless(spec):
    for wrong in (-1.0, float("nan")):
        with pytest.raises(RobotSpecError, match="payload of the left hand"):
            load_mujoco(spec, payload_kg=(wrong, 0.0))


def test_linkage_effort_reaches_motors_and_joints():
    model = load_mujoco(g1(hands=False, linkage_effort=50.0))
    assert model.actuator("waist_pitch_joint").ctrlrange[1] == 50.0
    assert model.jnt_actfrcrange[model.joint("left_ankle_roll_joint").id][1] == 50.0


@pytest.mark.parametrize("scene", SCENES)
def test_a_scene_stays_still_for_two_seconds_around_a_robot_that_does(spec, scene):
    model = load_mujoco(spec, scene=scene)
    data = in_stance(model)
    assert not [pair for pair in contact_pairs(model, data) if not pair & {"floor", "object"}]
    start, robot_qpos, robot_qvel = data.qpos.copy(), 7 + spec.n_joints, 6 + spec.n_joints
    for _ in range(1000):
        mujoco.mj_step(model, data)
        data.qpos[:robot_qpos], data.qvel[:robot_qvel] = start[:robot_qpos], 0.0
    assert np.isfinite(data.qpos).all()
    np.testing.assert_allclose(data.qpos, start, atol=1e-3)
    assert np.abs(data.qvel).max(initial=0.0) < 0.02  # a round rim rocks by a few mrad/s
    assert not any(warning.number for warning in data.warning)
    if "_" in scene:
        assert not [pair for pair in contact_pairs(model, data) if "object" in pair and any("hand" in n for n in pair)]


def test_the_object_decides_how_its_contacts_grip():
    model = load_mujoco(g1(hands=False), scene="table_box", friction=0.3)
    data = in_stance(model)
    mujoco.mj_step(model, data, 100)
    on_table = [c for c in data.contact if {model.geom(c.geom1).name, model.geom(c.geom2).name} == {"table", "object"}]
    assert on_table
    assert {(contact.friction[0], contact.dim) for contact in on_table} == {(1.0, 4)}


def test_the_cylinder_is_the_one_of_the_grasp_bar():
    model = load_mujoco(g1(hands=False), scene="table_cylinder")
    assert model.body("object").mass[0] == pytest.approx(0.3)
    assert model.geom("object").size[0] == pytest.approx(0.03)
    data = in_stance(model)
    bottom = data.body("object").xpos[2] - model.geom("object").size[1]
    assert bottom == pytest.approx(0.75)
    assert data.geom("table").xpos[2] + model.geom("table").size[2] == pytest.approx(0.75)


def body_on_a_lift(spec):
    """The robot with stiff joints on a vertical slide: only the left fingers are driven, in real contact."""
    mj = build_mujoco(spec, scene="table_cylinder")
    mj.delete(mj.keys[0])
    mj.delete(mj.joint(BASE_JOINT))
    mj.body(spec.base_body).add_joint(name="lift", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0, 0, 1))
    lift = mj.add_actuator(name="lift", target="lift", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    lift.set_to_position(kp=1e6, kv=2e4)
    for body in mj.bodies:
        body.gravcomp = 0.0 if body.name in ("world", "object") else 1.0
    for name, angle in zip(spec.joint_names, spec.stance.joints, strict=True):
        if not name.startswith("left_hand"):
            joint = mj.joint(name)
            joint.stiffness, joint.damping, joint.springref = [5000, 0, 0], [200, 0, 0], angle
    return mj.compile()


def test_a_closed_hand_lifts_the_cylinder(spec):
    model = body_on_a_lift(spec)
    data = mujoco.MjData(model)
    joints = [model.joint(name) for name in spec.joint_names]
    qpos, qvel = np.array([j.qposadr[0] for j in joints]), np.array([j.dofadr[0] for j in joints])
    fingers = spec.group_indices("left_hand")
    opened, closed = np.array(spec.hand_open[:7]), np.array(spec.hand_closed[:7])
    data.qpos[qpos] = spec.stance.joints
    data.qpos[qpos[fingers]] = opened
    mujoco.mj_forward(model, data)
    # In the pocket between thumb, palm and fingers.
    data.joint("object_free").qpos[:2] = data.site("left_palm_point").xpos[:2] + np.array([-0.025, -0.055])
    start, held = data.joint("object_free").qpos[2], None
    for step in range(2500):
        time = step * model.opt.timestep
        target = opened + min(time, 1.0) * (closed - opened)
        error = target - data.qpos[qpos[fingers]]
        data.ctrl[fingers] = spec.kp[fingers] * error - spec.kd[fingers] * data.qvel[qvel[fingers]]
        phase = np.clip((time - 1.5) / 1.5, 0, 1)
        data.actuator("lift").ctrl[0] = 0.1 * phase**3 * (10 - 15 * phase + 6 * phase**2)
        mujoco.mj_step(model, data)
        in_hand = data.body("object").xpos - data.site("left_palm_point").xpos
        if time > 3.2 and held is None:
            held = in_hand.copy()
    assert data.body("object").xpos[2] - start > 0.095
    assert np.linalg.norm(in_hand - held) < 0.01


def test_visual_meshes_are_seen_but_not_felt():
    spec = g1(hands=False)
    plain, dressed = load_mujoco(spec), load_mujoco(spec, visuals=True)
    felt = (dressed.geom_contype != 0) | (dressed.geom_conaffinity != 0)
    assert dressed.ngeom > plain.ngeom == felt.sum()
    assert set(dressed.geom_group[~felt]) == {2}
    assert set(dressed.geom_group[felt]) == {0, 3}
    np.testing.assert_array_equal(dressed.body_mass, plain.body_mass)
    np.testing.assert_array_equal(dressed.body_inertia, plain.body_inertia)


def test_an_unknown_scene_is_answered_with_near_names(spec):
    with pytest.raises(RobotSpecError, match="table_cylinder"):
        load_mujoco(spec, scene="table_cilinder")


_COST = """
import time
from pathlib import Path
import pinocchio, mujoco, coal
from models import g1
from models.pinocchio_model import load_pinocchio, load_collision
from models.mujoco_model import load_mujoco
load_collision(g1(), load_pinocchio(g1()))
shares = []
for _ in range(3):
    start = time.process_time()
    model = load_pinocchio(g1())
    joints = time.process_time()
    load_collision(g1(), model)
    load_mujoco(g1())
    shares.append((time.process_time() - start) / (joints - start))
peak = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
print(min(shares), int(peak.split()[1]) / 1024)
"""


def test_loading_everything_warm_is_quick_and_small():
    """Raw meshes took 706 MB. Quick is a multiple of what the joints alone take, best of three: measured 24."""
    done = subprocess.run([sys.executable, "-c", _COST], capture_output=True, text=True, check=True)
    share, megabytes = map(float, done.stdout.split())
    assert share < 100
    assert megabytes < 300
