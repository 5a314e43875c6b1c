"""Strategy: the real loop in MuJoCo with loads that nobody tells it; what the observer says against what is there."""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from models.pinocchio_model import stance_q
from policy.scripted.library import scripted_policy
from wholebody.config import ControllerConfig, LoadConfig
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.errors import ConfigError
from wholebody.execution.carrying import Carrying
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.sensors import REALISTIC, Sensors
from wholebody.types import RobotState

SPEC = g1()


@pytest.fixture(scope="module")
def supervisor():
    return Supervisor(SPEC)


@pytest.fixture(scope="module")
def plant():
    return MujocoPlant(SPEC, payload_kg=(0.4, 1.1))


def stand(supervisor, plant, seconds, state=None, change=lambda state: state):
    if state is None:
        state = plant.reset()
        supervisor.reset(state)
    for _ in range(round(seconds / plant.control_dt)):
        state = plant.step(supervisor.step(change(state)))
    return state


def test_loads_are_known_within_20_g_after_a_quarter_of_a_second(supervisor, plant):
    plant.hold((0.4, 1.1))
    stand(supervisor, plant, 0.25)
    carrying = supervisor.carrying
    np.testing.assert_allclose(carrying.observer.loads, (0.4, 1.1), atol=0.02)
    np.testing.assert_allclose(carrying.loads.masses, (0.4, 1.1), atol=0.05)
    assert carrying.loads.reserve == (0.0, 0.0)
    assert supervisor.robot.loads.present == carrying.loads.masses


def test_what_is_known_does_not_depend_on_the_episode_before(supervisor, plant):
    plant.hold((0.4, 1.1))
    known = []
    for ticks in (30, 33, 30):
        state = plant.reset()
        supervisor.reset(state)
        known.append([])
        for _ in range(ticks):
            state = plant.step(supervisor.step(state))
            known[-1].append(supervisor.carrying.loads)
    assert known[0] == known[1][:30] == known[2]


def test_a_load_that_is_dropped_and_handed_over_is_known_in_half_a_second(supervisor, plant):
    plant.hold((1.5, 0.2))
    state = stand(supervisor, plant, 0.5)
    for masses in ((1e-4, 0.2), (1e-4, 1.6), (0.9, 0.9)):
        plant.hold(masses)
        state = stand(supervisor, plant, 0.5, state)
        np.testing.assert_allclose(supervisor.carrying.observer.loads, masses, atol=0.03)


def test_with_realistic_sensors_and_arms_in_motion_loads_are_known_within_200_g(supervisor, plant):
    plant.hold((0.4, 1.1))
    sensors, seen = Sensors(SPEC, REALISTIC, 0.002), []
    step = supervisor.step

    def watched(state, now=None):
        command = step(state, now)
        if state.time > 0.5:
            seen.append(supervisor.carrying.observer.loads.copy())
        return command

    supervisor.step = watched
    policy, config = scripted_policy("lissajous"), EpisodeConfig(settle=0.5, hold=0.0)
    result = run_episode(policy, supervisor, plant, duration=4.0, config=config, sensors=sensors)
    del supervisor.step
    assert result.fall is None
    assert np.abs(np.array(seen) - (0.4, 1.1)).max() < 0.2


def test_without_torques_nothing_is_known_and_plans_keep_a_reserve(supervisor, plant):
    plant.hold((0.4, 1.1))
    stand(supervisor, plant, 0.2, change=lambda s: RobotState(s.time, s.q, s.v))
    assert not supervisor.carrying.observer.known.any()
    assert supervisor.carrying.loads.masses == (0.0, 0.0)
    assert supervisor.carrying.loads.reserve == (0.25, 0.25)
    single = stand(supervisor, plant, 0.1, change=lambda s: RobotState(s.time, s.q, s.v, s.tau.astype(np.float32)))
    assert supervisor.carrying.observer.known.all()
    supervisor.reset(single)
    broken = np.full(SPEC.n_joints, np.nan)
    stand(supervisor, plant, 0.1, change=lambda s: RobotState(s.time, s.q, s.v, broken))
    assert not supervisor.carrying.observer.known.any()


def test_a_hand_that_is_pushed_sideways_carries_nothing(supervisor, plant):
    plant.hold((1e-4, 1e-4))
    state = stand(supervisor, plant, 0.3)
    plant.push("left_hand_palm_link", np.array([0.0, 20.0, 0.0]), start=state.time, duration=0.5)
    most = 0.0
    for _ in range(50):
        state = stand(supervisor, plant, 0.01, state)
        most = max(most, supervisor.carrying.observer.loads[0])
    assert most < 0.2


def test_what_joints_feign_is_no_force_where_it_has_little_of_a_lever(supervisor, plant):
    """A torque that is always there, as of friction, was a touch wherever the arm came to have less of a lever."""
    plant.hold((1e-4, 1e-4))
    robot, observer, tool = supervisor.robot, supervisor.carrying.observer, SPEC.tools[0]
    arm = robot.joint_indices(robot.arm_joints(tool.side))
    seen = []

    def feign(state, place):
        levers, torques = np.linalg.svd(robot.jacobian(tool.palm_frame)[:3, 6 + arm])[1:]
        tau = state.tau.copy()
        tau[arm] += 1.5 * torques[place]
        seen.append((levers[place], np.linalg.norm(observer.wrenches[0, :3]), observer.sizes[0]))
        return replace(state, tau=tau)

    state = stand(supervisor, plant, 2.0, change=lambda state: feign(state, 0))
    stand(supervisor, plant, 0.1, state, change=lambda state: feign(state, 2))
    (lever, *_), (least, force, size) = seen[0], seen[-1]
    assert least < 0.4 * lever
    assert force > ControllerConfig().touch.force_found > 2.0 > size


def test_told_masses_are_counted_on_whatever_is_seen(plant):
    plant.hold((0.4, 1.1))
    config = ControllerConfig(loads=LoadConfig(source="told", left=0.5, right=2.0))
    supervisor = Supervisor(SPEC, config)
    stand(supervisor, plant, 0.1)
    assert supervisor.carrying.loads.masses == supervisor.robot.loads.present == (0.5, 2.0)
    assert supervisor.carrying.loads.reserve == (0.0, 0.0)


def test_a_source_that_does_not_exist_is_refused(supervisor):
    with pytest.raises(ConfigError, match=r"loads.source is 'guessed'; it must be one of observed, told"):
        Carrying(supervisor.controller, replace(ControllerConfig(), loads=LoadConfig(source="guessed")))


def test_an_arm_that_hangs_keeps_the_load_that_was_known(supervisor):
    observer = supervisor.carrying.observer
    observer.reset()
    observer.loads[:], observer.known[:] = (1.0, 0.5), True
    q = stance_q(SPEC, supervisor.robot.model)
    for name, angle in zip(supervisor.robot.joint_names, q[7:], strict=True):
        if any(part in name for part in ("shoulder", "elbow", "wrist")):
            q[7 + supervisor.robot.joint_names.index(name)] = np.pi / 2 if "elbow" in name else 0.0 * angle
    supervisor.controller.carry((1.0, 0.5))
    supervisor.controller.reset(RobotState(0.0, q, np.zeros(len(q) - 1)))
    supervisor.controller.compiled.compute(q, np.zeros(len(q) - 1))
    for tick in range(100):
        observer.look(RobotState(0.002 * tick, q, np.zeros(len(q) - 1), np.zeros(SPEC.n_joints)), np.array([1.0, 0.5]))
    assert observer.errors.min() > 0.2
    np.testing.assert_array_equal(observer.loads, (1.0, 0.5))
