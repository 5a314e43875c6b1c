"""Strategy: what every backend promises, asked of each alike."""

import numpy as np
import pytest

from models import g1
from wholebody.backends.registry import BACKENDS, make_controller
from wholebody.bench.reach_script import ReachScript
from wholebody.config import ControllerConfig
from wholebody.control.reference_packet import PackedReference
from wholebody.errors import InputError, StateError
from wholebody.types import RobotState

SPEC = g1()


@pytest.fixture(scope="module", params=[*BACKENDS, "readable"])
def controller(request):
    settings = {"solver": "daqp"} if request.param == "readable" else {"backend": request.param}
    return make_controller(SPEC, ControllerConfig(**settings))


@pytest.fixture(scope="module")
def script():
    return ReachScript(SPEC, ticks=1, dt=0.002)


@pytest.fixture(scope="module")
def state(script):
    return RobotState(0.0, script.q0, np.zeros(script.robot.nv))


def test_a_step_before_the_first_reset_says_so(controller, state, script):
    reference = script.packed(0)
    with pytest.raises(StateError, match="`step` before `reset`"):
        controller.step(state, reference)


@pytest.mark.parametrize(("number", "part"), [(0, "left palm"), (30, "right palm"), (62, "momentum"), (95, "height")])
def test_a_reference_that_is_not_finite_never_becomes_a_command(controller, state, script, number, part):
    controller.reset(state)
    reference = PackedReference(script.packed(0).row.copy())
    reference.row[number] = np.nan
    with pytest.raises(InputError, match=f"the reference of the {part} is nan"):
        controller.step(state, reference)
