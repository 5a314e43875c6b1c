"""Strategy: the feet that are counted on, state by state; then a reach on a slope."""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from models.pinocchio_model import stance_q
from policy.scripted.library import reach
from tests.support.grounds import Ground
from wholebody.config import ControllerConfig
from wholebody.control.controller import WholeBodyController
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.estimation.state_estimator import StateEstimator
from wholebody.execution.planted_feet import ANGLE, SETTLED_TIME, PlantedFeet
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.sensors import REALISTIC_READINGS, Sensors
from wholebody.types import RobotState

SPEC, FRICTION = g1(), ControllerConfig.friction


@pytest.fixture(scope="module")
def planted():
    return PlantedFeet(WholeBodyController(SPEC))


def standing(planted, pitch=0.0, time=0.0):
    """A state with both ankles turned, so that the soles slope by as much [rad]."""
    robot = planted._controller.robot
    q = stance_q(SPEC, robot.model)
    ankles = [f"{side}_ankle_pitch_joint" for side in ("left", "right")]
    q[7 + robot.joint_indices(ankles)] += pitch
    return RobotState(time, q, np.zeros(robot.nv))


def begun(planted, state):
    planted._controller.reset(state)
    planted.reset(state)


def test_feet_that_are_nearly_where_the_stance_has_them_are_taken_to_be_there(planted):
    begun(planted, standing(planted))
    nominal = planted.feet
    begun(planted, standing(planted, 0.5 * ANGLE))
    assert planted.feet.same(nominal)


def test_an_episode_begins_on_the_feet_as_they_are(planted):
    begun(planted, standing(planted, 0.05))
    foot = planted._controller.feet[0]
    assert planted.feet.floor(SPEC).slope == pytest.approx(0.05, abs=1e-6)
    assert np.allclose(foot.T_world_ref.rotation, planted.feet.R[0])
    assert foot.friction < FRICTION
    begun(planted, standing(planted))
    assert (planted.feet.floor(SPEC).slope, foot.friction) == (0.0, FRICTION)


def test_a_foot_that_moved_counts_once_it_has_stayed_there(planted):
    begun(planted, standing(planted))
    moved, before = standing(planted, 0.05, 1.0), planted.contacts
    assert planted.planned(moved) is before
    assert planted.planned(replace(moved, time=1.0 + 0.5 * SETTLED_TIME)) is before
    assert planted.planned(replace(moved, time=1.0 + SETTLED_TIME)) is not before
    assert planted.feet.floor(SPEC).slope == pytest.approx(0.05, abs=1e-6)


def test_a_foot_in_the_air_is_not_taken_for_one_that_moved(planted):
    begun(planted, standing(planted))
    lifted, before = replace(standing(planted, 0.05, 1.0), stands=(True, False)), planted.contacts
    planted.planned(lifted)
    assert planted.planned(replace(lifted, time=1.0 + 2.0 * SETTLED_TIME)) is before


def test_a_level_floor_is_level_for_twenty_robots_with_errors_of_imu_and_encoders(planted):
    state = MujocoPlant(SPEC).reset()
    for seed in range(20):
        sensors = Sensors(SPEC, replace(REALISTIC_READINGS, seed=seed), 0.002, StateEstimator(SPEC))
        begun(planted, sensors.measure(state))
        assert planted.feet.floor(SPEC).slope == 0.0


def test_no_floor_is_as_steep_as_the_soles_of_a_robot_that_falls(planted):
    begun(planted, standing(planted, 0.5))
    assert planted.feet.floor(SPEC).slope == 0.0


def test_a_reach_on_a_slope_arrives():
    plant, supervisor = Ground(SPEC, slope=np.deg2rad(5.0), direction=0.25 * np.pi), Supervisor(SPEC)
    config = EpisodeConfig(settle=0.2, hold=1.0)
    result = run_episode(reach(0.45, 0.60), supervisor, plant, duration=4.0, config=config)
    assert result.fall is None
    assert result.errors[-1].max() < 0.005
