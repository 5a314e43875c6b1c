"""Strategy: hands that no robot follows, while it is led: in MuJoCo it stands, is not led by them, and says why.

`python -m tests.studies.hostile_walks` has every family of hands in every frame with every velocity.
"""

from dataclasses import replace

import pytest

from policy.action_spec.slot_values import NOT_FOLLOWED
from tests.support.hostile_walks import hostile_walk
from tests.support.walked_chunks import LAYOUTS, SPEC, Walks
from tests.support.wide import wide
from wholebody.config import ControllerConfig
from wholebody.episode.run import observe
from wholebody.execution.feet.led import notes
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant


@pytest.fixture(scope="module")
def supervisor():
    return Supervisor(SPEC, ControllerConfig(steps="reach"))


@pytest.mark.parametrize("seed", [*wide(0), 10, 20])
def test_hostile_hands_do_not_make_a_robot_fall_that_they_lead(supervisor, seed):
    one = hostile_walk(supervisor, MujocoPlant(SPEC), seed, until=3.6)
    assert one.fall is None, str(one)
    assert not supervisor.walks
    assert "hand" in supervisor.not_led


def test_hands_near_the_body_are_walked_with_and_others_are_not_and_why_is_noted(supervisor):
    plant = MujocoPlant(SPEC)
    state = plant.reset()
    supervisor.reset(state)
    policy = Walks(LAYOUTS["wbc27"], (0.2, 0.0, 0.0), 1.0)
    chunk = policy.infer(observe(SPEC, supervisor, state))
    supervisor.accept(chunk)
    assert supervisor.walks
    assert supervisor.not_led is None
    T = chunk.T_world_lhand.copy()
    for axis, way, why in ((0, 0.5, "arm lengths"), (1, -0.17, "middle"), (0, -0.3, "behind")):
        moved = T.copy()
        moved[:, axis, 3] += way
        supervisor.reset(state)
        supervisor.accept(replace(chunk, T_world_lhand=moved))
        assert not supervisor.walks
        assert why in supervisor.not_led
        (note,) = (text for text in notes(chunk, walked=False, not_led=supervisor.not_led) if why in text)
        assert NOT_FOLLOWED in note
