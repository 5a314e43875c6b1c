"""Strategy: the real robot put into leans past its bounds, where no plan begins; it must find back by itself."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from models import g1
from models.pinocchio_model import stance_q
from policy.scripted.library import reach
from policy.scripted.policy import to_chunk
from tests.studies import spent_waist
from tests.support.body_cases import leaning
from wholebody.execution.standing import hands_at_rest
from wholebody.execution.states import Event
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.kernels.pendulum import natural_frequency
from wholebody.robot.state import Robot
from wholebody.sim.fall import detect_fall
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Status


@pytest.fixture(scope="module")
def loop():
    spec = g1()
    return Supervisor(spec), MujocoPlant(spec)


def put(loop, q):
    """Both at rest at a configuration (nq,)."""
    supervisor, plant = loop
    plant.reset()
    plant._conversion.to_mujoco(q, np.zeros(supervisor.robot.nv), plant.data.qpos, plant.data.qvel)
    mujoco.mj_forward(plant.model, plant.data)
    supervisor.reset(plant.state())
    return plant.state()


def chunk_at(time, seq, fps=30.0):
    """Hold both hands in front of the body."""
    return to_chunk(reach(0.40, 0.90).script(np.full(50, 100.0)), "wbc32", seq, time, fps, 50)


def run(loop, state, seconds, chunks=100):
    """Offer chunks, one in 0.8 s; statuses and distances of the capture point from the support's edge, by tick."""
    (supervisor, plant), seq, end, statuses, margins = loop, 0, state.time + seconds, [], []
    support, robot = supervisor.controller.balance.support, supervisor.robot
    while state.time < end:
        if state.time >= 0.8 * seq and seq < chunks:
            supervisor.accept(chunk_at(state.time, seq))
            seq += 1
        state = plant.step(supervisor.step(state))
        assert detect_fall(plant, state, supervisor.status.status) is None
        statuses.append(supervisor.status)
        margins.append(support.margin(robot.com[:2] + robot.com_velocity[:2] / natural_frequency(robot.com[2])))
    return state, statuses, np.array(margins)


@pytest.mark.parametrize(("pelvis", "waist", "roll"), [(0.75, 0.5, 0.0), (0.65, 0.5, 0.3)])
def test_a_robot_that_leans_past_its_bounds_is_on_a_plan_again_within_two_seconds(loop, pelvis, waist, roll):
    """It was refused plan after plan, and stayed there for ever."""
    state = put(loop, leaning(loop[0].robot, pelvis, waist, roll))
    _, statuses, margins = run(loop, state, 2.5)
    reasons = [status.reason for status in statuses]
    assert "off_plan" in reasons
    assert {status.status for status in statuses[1000:]} <= {Status.TRACKING, Status.SLOWED}
    assert margins.min() > 0.04


def test_without_a_chunk_that_can_be_joined_it_goes_back_to_its_stance(loop):
    supervisor, _ = loop
    stance = stance_q(supervisor.spec, supervisor.robot.model)
    state = put(loop, leaning(supervisor.robot, 0.6, 0.5))
    supervisor.accept(chunk_at(0.0, 0, fps=300.0))
    state, statuses, _ = run(loop, state, 4.0, chunks=0)
    assert "slowly to its stance" in statuses[-1].detail
    assert np.abs(state.q[7:] - stance[7:]).max() < 0.05


@pytest.mark.parametrize("case", [14, 34])
def test_where_the_waist_cannot_hold_the_arms_the_robot_does_not_stay(loop, case):
    """It stood there, the torso sank, the arms whirled to hold it up, and the robot fell."""
    q = spent_waist.postures(Robot(loop[0].spec), case + 1)[case]
    assert spent_waist.fall(*loop, q) is None


def test_a_plan_for_a_robot_off_its_plan_begins_with_the_hands_where_the_arms_come_to_rest(loop):
    """It began with the hands where they had been when the robot left its plan, here 39 mm from the body's own."""
    supervisor, plant = loop
    state, robot = plant.reset(), supervisor.robot
    v = state.v.copy()
    v[6 + robot.joint_indices(["left_elbow_joint", "right_elbow_joint"])] = 3.0
    state = replace(state, v=v)
    supervisor.reset(state)
    supervisor.step(state)
    reflex = supervisor._reflex
    supervisor._states.on(Event.TAKEN_OVER)
    reflex.stand(state, state.time)
    start = reflex.foreseen(state, 150)
    of_body = hands_at_rest(robot, start.body.q)
    of_arms = hands_at_rest(robot, state.q)
    assert np.linalg.norm(of_body[:, :3] - of_arms[:, :3], axis=1).min() > 0.03
    assert np.linalg.norm(start.hands.p - of_body[:, :3], axis=1).max() < 1e-3
