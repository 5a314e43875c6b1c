"""Strategy: where the body waits, and each tick of the way there, against the soles and what a body can do."""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from wholebody.errors import InputError
from wholebody.execution.ahead import ready
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant

DT = 0.002


@pytest.fixture(scope="module")
def supervisor():
    supervisor, plant = Supervisor(g1()), MujocoPlant(g1())
    state = plant.reset()
    supervisor.reset(state)
    supervisor.step(state)
    return supervisor


def body(supervisor):
    return ready.ReadyBody(supervisor.controller, supervisor._planted)


def test_the_body_goes_low_over_its_soles_from_where_it_is_no_faster_than_it_can(supervisor):
    one, robot, support = body(supervisor), supervisor.robot, supervisor.controller.support
    palms = supervisor.controller.palm_positions()
    assert one.begin(palms)
    assert one.reaches(palms)
    assert not one.begin(palms + np.array([0.0, 0.0, 0.6])), "over the head"
    assert one.begin(palms)
    rows = [one.row]
    while not one.is_over:
        rows.append(one.advance(DT))
    assert np.allclose(rows[0].q[0], robot.q)
    assert len(rows) == pytest.approx(ready.WAY_DOWN / DT, abs=2)
    heights = np.array([row.height[0, 0] for row in rows])
    assert heights[0] - heights[-1] > 0.15
    assert np.abs(np.diff(heights, 2)).max() / DT**2 < 5.0
    assert min(support.margin(row.com[0, 0, :2]) for row in rows) > 0.045
    last = rows[-1].q[0]
    assert support.margin(pin.centerOfMass(robot.model, robot.scratch, last)[:2]) > 0.06


def test_a_body_whose_crouch_is_not_known_does_not_wait(supervisor, monkeypatch):
    def unknown(*_):
        raise InputError("no crouch is known")

    monkeypatch.setattr(ready, "crouch", unknown)
    assert not body(supervisor).begin(supervisor.controller.palm_positions())
