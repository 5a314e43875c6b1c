"""Strategy: one plant a question, standing on torques of gravity and stiff position loops; pushes, payload, friction.

The commands here are made by hand: no controller is needed to see whether physics does what it is told.
"""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from models.pinocchio_model import load_pinocchio
from wholebody.errors import InputError, SimulationError
from wholebody.sim.fall import detect_fall
from wholebody.sim.limit_monitor import LimitMonitor
from wholebody.sim.plant import MujocoPlant
from wholebody.types import JointCommand, Status

SPEC = g1()


@pytest.fixture(scope="module")
def plant():
    return MujocoPlant(SPEC)


def stiff(plant, *, kp=400.0, kd=8.0, tau=0.0):
    """Hold the present joint angles, stiff enough to stand for a while."""
    n = SPEC.n_joints
    fingers = np.array(["_hand_" in name for name in SPEC.joint_names])
    gains = [np.where(fingers, own, value) for own, value in ((SPEC.kp, kp), (SPEC.kd, kd))]
    return JointCommand(0.0, plant.joint_positions().copy(), np.zeros(n), np.full(n, tau), *gains)


def run(plant, command, seconds):
    for _ in range(round(seconds / plant.control_dt)):
        state = plant.step(command)
    return state


def test_it_stands_on_stiff_joints_and_the_floor_carries_its_weight(plant):
    plant.reset()
    command, loads = stiff(plant), []
    for _ in range(250):
        state = plant.step(command)
        loads.append(plant.foot_load()[0])
    # It rings on its stiff legs: the mean carries the weight.
    assert np.mean(loads) == pytest.approx(9.81 * plant.model.body_subtreemass[1], rel=0.02)
    assert abs(plant.foot_load()[1][0]) < 0.085
    assert detect_fall(plant, state, Status.TRACKING) is None
    assert plant.contacts() == []


def test_a_state_has_the_torques_that_led_to_it_in_the_order_of_its_joints(plant):
    plant.reset()
    state, names = run(plant, stiff(plant), 0.1), list(load_pinocchio(SPEC).names)[2:]
    told = dict(zip(names, state.tau, strict=True))
    assert [told[name] for name in SPEC.joint_names] == plant.torque.tolist()
    assert np.ptp(plant.torque) > 0.0


def test_motors_give_no_more_than_their_effort_limit_and_say_what_was_asked(plant):
    plant.reset()
    watch = LimitMonitor(plant)
    state = plant.step(stiff(plant, tau=1000.0))
    watch.look(state.time)
    assert np.array_equal(plant.torque, SPEC.effort_max)
    assert plant.torque_asked.max() >= 999.0
    assert "left_knee_joint" in watch.torques
    assert watch.torques["left_knee_joint"].bound == SPEC.effort_max[SPEC.indices(["left_knee_joint"])[0]]
    assert not any("_hand_" in name for name in watch.torques)


def test_physics_at_1_ms_gives_the_same_fall_within_a_few_millimetres(plant):
    fine = MujocoPlant(SPEC, timestep=0.001)
    ends = []
    for one in (plant, fine):
        one.reset()
        ends.append(run(one, stiff(one), 0.4))
    assert ends[0].time == pytest.approx(ends[1].time)
    assert np.abs(ends[0].q[:3] - ends[1].q[:3]).max() < 3e-3


def test_a_control_period_that_is_no_multiple_of_the_step_is_refused():
    with pytest.raises(InputError, match="no multiple"):
        MujocoPlant(SPEC, control_dt=0.003)


def test_a_push_moves_the_robot_the_way_it_points_and_ends(plant):
    plant.reset()
    command = stiff(plant)
    plant.push("torso_link", np.array([0.0, 60.0, 0.0]), start=0.0, duration=0.1)
    state = run(plant, command, 0.1)
    momentum = plant.model.body_subtreemass[1] * (state.v[1])
    assert 1.0 < momentum < 9.0  # of the 6 N s some goes into the floor, the trunk turns too
    run(plant, command, 0.1)
    assert not plant.data.xfrc_applied.any()
    with pytest.raises(InputError, match="has no body 'torso'"):
        plant.push("torso", np.zeros(3), start=0.0, duration=0.1)


def test_a_payload_weighs_on_the_floor():
    bare, loaded = (MujocoPlant(SPEC, payload_kg=payload) for payload in ((0.0, 0.0), (1.0, 2.0)))
    assert loaded.model.body_subtreemass[1] - bare.model.body_subtreemass[1] == pytest.approx(3.0)


def test_low_friction_lets_the_feet_slide():
    creep = {}
    for friction in (0.05, 0.8):
        plant = MujocoPlant(SPEC, friction=friction)
        plant.reset()
        watch = LimitMonitor(plant)
        command = stiff(plant)
        plant.push("pelvis", np.array([80.0, 0.0, 0.0]), start=0.0, duration=0.15)
        for _ in range(100):
            watch.look(plant.step(command).time)
        creep[friction] = watch.creep
    assert creep[0.05] > 0.01
    assert creep[0.8] < 0.005


def test_the_watch_sees_the_robot_tip_over_its_toes_and_joints_past_their_limits(plant):
    plant.reset()
    watch = LimitMonitor(plant)
    command = stiff(plant)
    plant.push("torso_link", np.array([200.0, 0.0, 0.0]), start=0.0, duration=0.2)
    for _ in range(150):
        watch.look(plant.step(command).time)
    assert watch.edge is not None
    assert watch.margin < 1e-3
    assert 0.0 < watch.edge.first < 0.3
    knee = SPEC.indices(["left_knee_joint"])[0]
    plant.data.qpos[plant.model.joint("left_knee_joint").qposadr] = SPEC.position_max[knee] + 0.1
    watch.look(1.0)
    assert watch.positions["left_knee_joint"].worst == pytest.approx(SPEC.position_max[knee] + 0.1)


def test_lying_on_the_floor_is_a_fall_whose_body_is_named(plant):
    plant.reset()
    state = run(plant, stiff(plant, kp=0.0, kd=1.0), 1.0)
    fall = detect_fall(plant, state, Status.TRACKING)
    assert fall is not None
    assert fall.cause
    assert detect_fall(plant, plant.reset(), Status.DAMPING).cause == "the supervisor gave up standing"


def test_the_state_is_in_pinocchios_joint_order(plant):
    state = plant.reset()
    names = list(load_pinocchio(SPEC).names[2:])
    assert np.array_equal(state.q[7:][[names.index(name) for name in SPEC.joint_names]], plant.joint_positions())


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"q": np.full(43, np.nan)}, r"command\.q\[0\] is nan"),
        ({"tau": np.full(43, np.inf)}, r"command\.tau\[0\] is inf"),
        ({"kd": np.full(43, -1.0)}, r"command\.kd\[0\] is -1"),
        ({"dq": np.zeros(29)}, r"command\.dq has shape \(29,\)"),
        (
            {"q": np.full(43, 1e300), "kp": np.full(43, 1e10)},
            "asks joint 'left_hip_pitch_joint' for a torque of inf N m",
        ),
    ],
)
def test_a_command_that_is_none_is_refused_and_time_stands_still(plant, change, said):
    before = plant.reset()
    command = replace(stiff(plant), **change)
    with pytest.raises(InputError, match=said):
        plant.step(command)
    assert np.array_equal(plant.state().q, before.q)
    assert plant.state().time == 0.0


def test_a_simulation_that_breaks_down_says_which_joint_and_when_and_does_not_begin_again(plant, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log
    plant.reset()
    command = stiff(plant)
    run(plant, command, 0.1)
    plant.data.joint("left_knee_joint").qvel[:] = 1e11
    with pytest.raises(
        SimulationError, match=r"broke down at 0\.10\d s: the (position|speed) of joint '\w+' is"
    ) as caught:
        plant.step(command)
    assert caught.value.fields["time"] >= 0.1
    assert plant.data.time >= 0.1
    plant.reset()
    assert plant.step(stiff(plant)).time == pytest.approx(plant.control_dt)


def test_a_new_plant_stands_in_the_stance():
    plant = MujocoPlant(SPEC)
    first = plant.state().q
    assert np.array_equal(first, plant.reset().q)
    assert first[2] > 0.6
