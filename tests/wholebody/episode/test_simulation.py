"""Strategy: short episodes in MuJoCo, one question each; the long ones are in `test_regression.py`."""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from policy.scripted.library import reach
from policy.scripted.policy import ScriptedMotion, ScriptedPolicy, stance_pose
from wholebody.config import ControllerConfig
from wholebody.control.controller import WholeBodyController
from wholebody.control.reference_packet import BodyReference, PalmReference
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.fall import detect_fall
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.sensors import REALISTIC, SensorConfig, Sensors
from wholebody.types import Status

SPEC = g1()
CREEP = 5e-3
"""How far a sole may slide [m]."""
SHORT = EpisodeConfig(settle=0.2, hold=0.3)


@pytest.fixture(scope="module")
def supervisor():
    return Supervisor(SPEC)


@pytest.fixture(scope="module")
def plant():
    return MujocoPlant(SPEC)


def still(duration=1.0, *, ahead=0.0):
    """Both hands where they are in the stance, or that far ahead of it from the first step on [m]."""
    stance, offset = stance_pose(), np.array([ahead, 0.0, 0.0])

    def script(t):
        palms = [np.tile(p + offset, (len(t), 1)) for p in (stance.p_world_lpalm, stance.p_world_rpalm)]
        return ScriptedMotion(*palms, stance.R_world_lhand, stance.R_world_rhand, stance.q_lhand, stance.q_rhand)

    return ScriptedPolicy("still", script, duration)


def test_it_stands_for_5_s_and_its_feet_stay(supervisor, plant):
    result = run_episode(still(), supervisor, plant, duration=0.1, config=EpisodeConfig(settle=0.0, hold=4.9))
    assert result.fall is None
    assert result.creep < CREEP
    assert result.tilt < np.deg2rad(2.0)
    assert result.margin > 0.02
    assert result.torques == {}


def without_supervisor(plant, ahead, seconds):
    """The controller alone, its hands asked for something far away; the fall, or None."""
    controller = WholeBodyController(SPEC)
    robot, state = controller.robot, plant.reset()
    controller.reset(state)
    palms = []
    for tool in SPEC.tools:
        T = robot.pose(tool.palm_frame)
        target = pin.SE3(T.rotation, T.translation + np.array([ahead, 0.0, 0.0]))
        palms.append(PalmReference(T_world=target, twist=np.zeros(6), acceleration=np.zeros(6)))
    zero, joints = np.zeros(3), np.zeros(robot.n_joints)
    trunk = [(robot.pose(frame).rotation.copy(), zero, zero) for frame in (SPEC.base_body, SPEC.torso_body)]
    reference = BodyReference(
        palms=tuple(palms),
        q=state.q.copy(),
        dq=joints,
        ddq=joints,
        pelvis=trunk[0],
        torso=trunk[1],
        height=(float(state.q[2]), 0.0, 0.0),
        com=(robot.com.copy(), zero, zero),
        momentum=(zero, zero),
    )
    while state.time < seconds:
        command, _ = controller.step(state, reference)
        state = plant.step(command)
        fall = detect_fall(plant, state, Status.TRACKING)
        if fall is not None:
            return fall
    return None


def test_without_the_supervisor_hands_asked_for_5_m_ahead_make_it_fall_and_with_it_they_do_not(supervisor, plant):
    assert without_supervisor(plant, 0.0, 1.0) is None
    assert without_supervisor(plant, 5.0, 4.0) is not None
    # One chunk: a target out of reach is what takes longest to plan.
    result = run_episode(still(ahead=5.0), supervisor, plant, duration=0.8, config=EpisodeConfig(settle=0.2, hold=2.2))
    assert result.fall is None
    assert result.palms.moved.max() > 1.0
    assert result.seconds.get("slowed", 0.0) > 0.5


def test_control_at_250_hz_reaches_as_well(plant):
    half = Supervisor(SPEC, ControllerConfig(dt=0.004))
    slow = MujocoPlant(SPEC, control_dt=0.004)
    result = run_episode(reach(0.45, 1.0), half, slow, duration=3.2, config=SHORT)
    assert result.fall is None
    assert result.errors[-1].max() < 2e-3
    assert result.time_factor == pytest.approx(1.0, abs=0.01)


def test_it_stands_on_realistic_sensors_that_are_10_ms_late(supervisor, plant):
    settings = SensorConfig(**{**vars(REALISTIC), "delay": 0.010})
    sensors = Sensors(SPEC, settings, 0.002)
    result = run_episode(still(), supervisor, plant, duration=1.0, config=SHORT, sensors=sensors)
    assert result.fall is None
    assert result.creep < CREEP


def test_a_push_of_5_newton_seconds_is_survived(supervisor, plant):
    class Pushed(MujocoPlant):
        def reset(self):
            state = super().reset()
            self.push("torso_link", np.array([50.0, 0.0, 0.0]), start=0.3, duration=0.1)
            return state

    result = run_episode(still(), supervisor, Pushed(SPEC), duration=1.0, config=EpisodeConfig(settle=0.2, hold=1.0))
    assert result.fall is None
    assert result.tilt > np.deg2rad(0.5)


def test_a_payload_of_1_kg_in_each_hand_unknown_to_the_controller_is_carried(supervisor):
    loaded = MujocoPlant(SPEC, payload_kg=(1.0, 1.0))
    result = run_episode(still(), supervisor, loaded, duration=1.0, config=SHORT)
    assert result.fall is None
    assert result.errors[-1].max() < 5e-3
