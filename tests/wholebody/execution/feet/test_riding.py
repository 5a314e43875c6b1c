"""Strategy: hands follow chunks that say no base velocity while somebody else tells the robot where to walk, in MuJoCo:
about the robot, or in the room as long as the base is near."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.hostile_walks import edge_walk
from tests.support.walked_chunks import LAYOUTS, ROOM, SPEC, Walks
from tests.support.wide import wide
from wholebody.config import ControllerConfig
from wholebody.episode.run import observe
from wholebody.execution.states import State
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.fall import detect_fall
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Reason, Status

AGE = 0.1
"""How old chunks are when they come [s]: more than one of their steps."""


@pytest.fixture(scope="module")
def supervisor():
    return Supervisor(SPEC, ControllerConfig(steps="reach"))


def ridden(supervisor, layout, goal, seconds, tell=0.6, sway=0.06):
    """Statuses while a walk to a goal is led, and how far the left palm is from the chunk then, a tick each [m]."""
    plant, policy = MujocoPlant(SPEC), Walks(layout, (0.0, 0.0, 0.0), 99.0, sway=sway)
    state, due, coming, told = plant.reset(), 0.2, None, False
    supervisor.reset(state)
    statuses, off = [], []
    while state.time < seconds:
        if state.time >= due and coming is None:
            chunk = policy.infer(observe(SPEC, supervisor, state))
            coming, due = replace(chunk, base_velocity=None), due + 0.3
        if coming is not None and state.time >= coming.t_obs + AGE:
            supervisor.accept(coming, state.time)
            coming = None
        if not told and state.time >= tell:
            assert supervisor.walk_to(goal).reason is Reason.WALKING
            told = True
        state = plant.step(supervisor.step(state))
        assert detect_fall(plant, state, supervisor.status.status) is None
        if supervisor.state is State.WALKING:
            statuses.append(supervisor.status)
            led = supervisor.carried
            if led is not None:
                chunk, k = supervisor.chunk, (state.time - supervisor.chunk.t_obs) * supervisor.chunk.fps
                before, after = (led @ chunk.T_world_lhand[min(int(k) + i, len(chunk) - 1)] for i in (0, 1))
                wanted = before + (k % 1.0) * (after - before)
                palm = wanted[:3, :3] @ SPEC.tool("left").palm_offset + wanted[:3, 3]
                off.append(np.linalg.norm(supervisor.controller.palm_positions()[0] - palm))
    return statuses, np.array(off)


def test_hands_follow_chunks_about_a_robot_that_walks_where_it_is_told(supervisor):
    statuses, off = ridden(supervisor, LAYOUTS["wbc27"], (0.25, 0.0, 0.0), 4.6)
    assert supervisor.state in (State.HOLDING, State.FOLLOWING)
    np.testing.assert_allclose(supervisor.base, (0.25, 0.0, 0.0), atol=0.02)
    begun = [one.status for one in statuses].index(Status.TRACKING)
    assert {one.status for one in statuses[:begun]} == {Status.HOLD}  # while the weight is shifted
    assert {one.status for one in statuses[begun:]} == {Status.TRACKING}
    assert {one.reason for one in statuses} == {Reason.WALKING}
    assert "its hands along the chunk's own paths" in statuses[-1].detail
    assert not supervisor.walks
    assert len(off) > 750
    # The pelvis goes down by 4 cm as it begins to walk, and what is given in it from one chunk to the next.
    assert np.sqrt(np.mean(off**2)) < 2e-2
    assert np.sqrt(np.mean(off[-500:] ** 2)) < 3e-3


def test_hands_in_the_room_stay_there_until_the_base_is_too_far(supervisor):
    statuses, off = ridden(supervisor, ROOM, (-0.25, 0.0, 0.3), 4.6, sway=0.0)
    np.testing.assert_allclose(supervisor.base, (-0.25, 0.0, 0.3), atol=0.02)
    said = [one.status for one in statuses]
    begun = said.index(Status.TRACKING)
    held = begun + said[begun:].index(Status.HOLD)
    assert held - begun > 100
    assert set(said[held:]) == {Status.HOLD}
    assert np.max(off[-50:]) < 5e-3  # they were carried until the first step


@pytest.mark.parametrize("seed", [*wide(0, 1, 2), 3])
def test_hands_at_the_edge_of_what_a_walk_can_have_do_not_make_it_fall(supervisor, seed):
    one = edge_walk(supervisor, MujocoPlant(SPEC), seed, until=4.4, rides=True)
    assert one.fall is None, str(one)
    assert not supervisor.walks
