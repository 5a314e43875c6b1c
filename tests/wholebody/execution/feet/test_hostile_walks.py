"""Strategy: hands that no robot follows, while it is led: in MuJoCo it walks, or comes to a stand, and says why.

`python -m tests.studies.hostile_walks` has every family of hands in every frame with every velocity.
"""

import pytest

from tests.support.hostile_walks import hostile_walk
from tests.support.walked_chunks import SPEC
from wholebody.config import ControllerConfig
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Reason

SAID = {Reason.OUT_OF_REACH, Reason.HANDS_DROPPED, Reason.STEPS_JUMP, Reason.INTO_FLOOR, Reason.NOISY_CHUNK}


@pytest.fixture(scope="module")
def supervisor():
    return Supervisor(SPEC, ControllerConfig(steps="reach"))


@pytest.mark.parametrize("seed", [0, 10, 20])
def test_hostile_hands_do_not_make_a_robot_fall_that_they_lead(supervisor, seed):
    one = hostile_walk(supervisor, MujocoPlant(SPEC), seed, until=3.6)
    assert one.fall is None, str(one)
    assert one.walked > 1.5
    assert SAID & set(one.reasons), str(one)
