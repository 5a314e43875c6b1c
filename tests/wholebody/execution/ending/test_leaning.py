"""Strategy: the words for a robot that was put into a lean; then what a supervisor says of a start in one."""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import stance_q
from policy.scripted.library import reach
from policy.scripted.policy import to_chunk
from wholebody.execution.ending.leaning import words
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.feet import Feet
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Reason, RobotState

SPEC, MARGIN = g1(), 0.045


@pytest.fixture(scope="module")
def supervisor():
    return Supervisor(SPEC)


def leaning(model, part, angle):
    """At rest on flat soles, turned by an angle about the ankles' pitch (ahead) or roll (to the right)."""
    q, data = stance_q(SPEC, model), model.createData()
    feet = Feet.at(SPEC, model, q)
    for side in ("left", "right"):
        q[model.joints[model.getJointId(f"{side}_ankle_{part}_joint")].idx_q] -= angle
    axis = np.array([0.0, 1.0, 0.0]) if part == "pitch" else np.array([1.0, 0.0, 0.0])
    q[3:7] = pin.Quaternion(pin.exp3(angle * axis)).coeffs()
    q[:3] += (feet.p - Feet.at(SPEC, model, q, data).p).mean(axis=0)
    return RobotState(0.0, q, np.zeros(model.nv))


@pytest.mark.parametrize(
    ("part", "angle", "said"),
    [("pitch", 0.10, "edge of its soles ahead"), ("pitch", -0.12, "edge of its soles behind"), ("pitch", 0.0, None)],
)
def test_words_say_which_way_it_leans(supervisor, part, angle, said):
    supervisor.reset(leaning(supervisor.robot.model, part, angle))
    found = words(supervisor.controller, MARGIN)
    assert said in found if said else found == ""


def test_a_start_outside_of_the_soles_is_said_to_be_outside(supervisor):
    supervisor.reset(leaning(supervisor.robot.model, "pitch", 0.2))
    assert "mm outside the edge" in words(supervisor.controller, MARGIN)


def test_what_is_wrong_with_a_leaning_start_is_said_within_a_second(supervisor):
    plant = MujocoPlant(SPEC)
    state = plant.reset(leaning(supervisor.robot.model, "pitch", np.deg2rad(7.0)))
    supervisor.reset(state)
    supervisor.accept(to_chunk(reach(0.40, 0.90).script(np.full(50, 100.0)), "wbc32", 0, 0.0, 30.0, 50))
    told = []
    while state.time < 1.0:
        state = plant.step(supervisor.step(state))
        told.append(supervisor.status)
    assert any(one.reason is Reason.OFF_PLAN and "it leans" in one.detail for one in told)
