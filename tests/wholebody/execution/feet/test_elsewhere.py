"""Strategy: palms that are out of reach are walked to in MuJoCo, and what may keep a robot from it.

Arms go towards the posture that reaches them, as far as a walk can have hands there.
"""

from copy import copy
from types import SimpleNamespace

import numpy as np
import pytest

from models import g1
from tests.support.steps import held, is_in, run
from wholebody.config import ControllerConfig
from wholebody.execution import statuses
from wholebody.execution.feet import elsewhere
from wholebody.execution.feet.hands_of_walks import LOWERED, STRETCHED, HandsOfWalks
from wholebody.execution.states import State
from wholebody.execution.supervisor import Supervisor
from wholebody.planning.reachability.standing_place import stand_for
from wholebody.robot.state import Robot
from wholebody.sim.plant import MujocoPlant

SPEC, CONFIG = g1(), ControllerConfig(steps="reach")


@pytest.fixture(scope="module")
def supervisor():
    return Supervisor(SPEC, CONFIG)


@pytest.fixture
def plant(supervisor):
    plant = MujocoPlant(SPEC)
    supervisor.reset(plant.reset())
    return plant


def test_a_chunk_out_of_reach_is_walked_to_and_reached(supervisor, plant):
    chunk = held(0.8, 0.8, 0.0)
    assert supervisor.accept(chunk).reason is None
    run(supervisor, plant, is_in(supervisor, State.WALKING), 0.5)
    run(supervisor, plant, is_in(supervisor, State.HOLDING), 8.0)
    supervisor.accept(held(0.8, 0.8, plant.state().time, 1))
    end = plant.state().time + 3.0
    run(supervisor, plant, lambda: plant.state().time > end, 11.0)
    assert supervisor.chunk.seq == 1
    robot, state = supervisor.robot, plant.state()
    robot.place(state.q, state.v)
    for tool, y in zip(SPEC.tools, (0.16, -0.16), strict=True):
        assert np.linalg.norm(robot.pose(tool.palm_frame).translation - (0.8, y, 0.8)) < 2e-3


def test_arms_are_on_their_way_once_the_robot_stands_there(supervisor, plant):
    """Hands were held as they were in the stance, and went all of the way from there."""
    stance = supervisor._planted.stance
    supervisor.accept(held(1.0, 1.2, 0.0))
    run(supervisor, plant, lambda: not supervisor._stepping.begins and supervisor._stepping.active, 1.5)
    supervisor.accept(held(1.0, 1.2, plant.state().time, 1))
    run(supervisor, plant, is_in(supervisor, State.HOLDING), 8.0)
    robot, q = supervisor.robot, plant.state().q
    robot.place(q, plant.state().v)
    ahead = [robot.pose(SPEC.base_body).actInv(robot.pose(tool.wrist_frame)).translation[0] for tool in SPEC.tools]
    robot.place(stance, np.zeros(robot.model.nv))
    rest = [robot.pose(SPEC.base_body).actInv(robot.pose(tool.wrist_frame)).translation[0] for tool in SPEC.tools]
    assert np.subtract(ahead, rest).min() > 0.04


@pytest.mark.parametrize(("x", "z"), [(0.9, 0.4), (1.2, 0.8), (0.8, 1.3)])
def test_arms_go_no_further_towards_a_posture_than_a_walk_can_have_them(supervisor, x, z):
    robot, stance = Robot(SPEC), supervisor._planted.stance
    hands, chunk = HandsOfWalks(robot, stance), held(x, z, 0.0)
    place = stand_for(*elsewhere.ends(chunk), config=CONFIG, spare=elsewhere.SPARE)
    T, still = hands.towards(place.posture.q), hands.towards(stance)
    assert np.abs(T - still).max() > 0.03
    for low in (0.0, LOWERED):
        pelvis = np.eye(4)
        pelvis[2, 3] = -low
        assert hands.why_not_there(T[:, None, :3, 3], pelvis, STRETCHED) is None


def test_a_chunk_out_of_reach_from_everywhere_is_looked_for_once(supervisor, plant, monkeypatch):
    asked = []

    def nowhere(*args, **_):
        asked.append(args)
        return SimpleNamespace(reached=False, steps=3, base=(0.0, 0.0, 0.0))

    monkeypatch.setattr(elsewhere, "stand_for", nowhere)
    for seq in range(2):
        supervisor.accept(held(0.6, 2.2, plant.state().time, seq))
        end = plant.state().time + 0.3
        run(supervisor, plant, lambda: plant.state().time > end, 1.0)  # noqa: B023
    assert len(asked) == 1
    assert supervisor.state is State.FOLLOWING
    assert supervisor.chunk.seq == 1


def test_where_to_stand_survives_the_way_from_the_planners_process():
    """Made anew from its arguments, as a pickle of it is."""
    place = SimpleNamespace(base=(0.4, -0.1, 0.2))
    error = copy(elsewhere.StandElsewhereError(place))
    assert error.place is place
    assert "(0.40, -0.10)" in str(error)


def test_a_plan_that_says_where_to_stand_is_never_late(supervisor, plant):
    supervisor.accept(held(0.8, 0.8, 0.0))
    supervisor.handover._planner._done += 0.3
    run(supervisor, plant, is_in(supervisor, State.WALKING), 1.0)
    assert supervisor.handover.late == 0


def test_what_a_gate_does_not_see_is_not_walked_to(plant):
    one, asked = Supervisor(SPEC, CONFIG, gate=lambda request, plan: asked.append(request) or statuses.GATE_LATE), []
    one.reset(plant.reset())
    one.accept(held(0.8, 0.8, 0.0))
    run(one, plant, lambda: plant.state().time > 1.0, 1.1)
    assert asked
    assert one.state is not State.WALKING


def test_a_chunk_that_no_walk_may_begin_for_is_planned_from_here(supervisor, plant, monkeypatch):
    far = SimpleNamespace(reached=True, steps=30, base=(50.0, 0.0, 0.0), posture=SimpleNamespace(q=None))
    monkeypatch.setattr(elsewhere, "stand_for", lambda *_, **__: far)
    supervisor.accept(held(0.8, 0.8, 0.0))
    run(supervisor, plant, lambda: supervisor.chunk is not None, 1.0)
    assert supervisor.state is State.FOLLOWING
