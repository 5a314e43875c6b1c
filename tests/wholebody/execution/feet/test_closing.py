"""Strategy: a robot is pushed in MuJoCo until a step catches it; then it closes its feet, and follows chunks again."""

import numpy as np
import pytest

from models import g1
from policy.scripted.library import scripted_policy
from tests.support.wide import wide
from wholebody.config import ControllerConfig
from wholebody.episode.run import observe, run_episode
from wholebody.execution.states import State
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.fall import detect_fall
from wholebody.sim.plant import MujocoPlant
from wholebody.walking.footsteps import CLOSED

SPEC, CONFIG = g1(), ControllerConfig(steps="recover")


def pushed(angle, impulse):
    """A robot that was pushed so [degrees, N s], once it stands again; how far apart its soles were at most [m]."""
    supervisor, plant = Supervisor(SPEC, CONFIG), MujocoPlant(SPEC)
    state = plant.reset()
    supervisor.reset(state)
    way = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle)), 0.0])
    plant.push("torso_link", 10.0 * impulse * way, start=0.5, duration=0.1)
    apart, stepped = 0.0, False
    while state.time < 8.0 and not (stepped and supervisor.state is not State.RECOVERING):
        state = plant.step(supervisor.step(state))
        assert detect_fall(plant, state, supervisor.status.status) is None
        if supervisor.state is State.RECOVERING:
            stepped, left, right = True, *supervisor._stepping._walker.walk.soles
            apart = max(apart, abs(left.seen(right.point).real))
    assert stepped
    assert supervisor.state in (State.HOLDING, State.FOLLOWING)
    return supervisor, plant, state, apart


@pytest.mark.parametrize(
    ("angle", "impulse"), [(45.0, 17.0), *wide((0.0, 13.0), (0.0, 17.0), (135.0, 17.0), (180.0, 15.0), (180.0, 16.0))]
)
def test_feet_are_closed_after_a_step_that_caught_the_robot(angle, impulse):
    """A shift of 0.6 s, and steps of 0.55 s, were falls where they were 0.4 m apart and more."""
    supervisor, plant, state, apart = pushed(angle, impulse)
    assert apart > 0.2
    left, right = (foot.translation for foot in supervisor._planted.feet.poses)
    heading = supervisor._stepping.base.heading
    ahead = np.array([np.cos(heading), np.sin(heading)]) @ (right - left)[:2]
    assert abs(ahead) < CLOSED[0]
    assert np.linalg.norm((right - left)[:2]) < 0.3

    policy = scripted_policy("reach")
    policy.reset()
    supervisor.accept(policy.infer(observe(SPEC, supervisor, state)))
    while state.time < 11.0:
        state = plant.step(supervisor.step(state))
        assert detect_fall(plant, state, supervisor.status.status) is None
    assert supervisor.state is State.FOLLOWING


@pytest.mark.parametrize("impulse", [15.0, *wide(14.0, 16.0)])
def test_one_that_squats_and_is_pushed_back_catches_itself(impulse):
    """Its trunk and the ankle of the foot in the air were at their ends: the leg that went back threw the body back."""
    supervisor, plant, told = Supervisor(SPEC, CONFIG), MujocoPlant(SPEC), []

    def push(now, end):
        if now >= 2.5 and not told:
            told.append(now)
            plant.push("torso_link", np.array([-10.0 * impulse, 0.0, 0.0]), start=now, duration=0.1)

    result = run_episode(scripted_policy("lissajous"), supervisor, plant, duration=5.0, progress=push)
    assert told
    assert supervisor._stepping._walker.walk.made >= 1
    assert result.fall is None
