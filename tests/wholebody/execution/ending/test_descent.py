"""Strategy: a robot is pushed in MuJoCo by twice of what it stands, and watched until it lies and is damped."""

import numpy as np
import pytest

from models import g1
from models.talos import talos
from tests.studies.descents import pushed, stood
from tests.support.wide import wide
from wholebody.execution.ending.descent import Descent
from wholebody.execution.states import State
from wholebody.robot.state import Robot
from wholebody.types import Reason, Status

SPEC = g1()
BEFORE = {0.0: (3.4, 3.6), 90.0: (2.9, 3.8), 180.0: (2.0, 5.0)}
"""Speeds with which the torso, or the head, and hands met the floor where joints were only damped [m/s], by the angle
of the push, or less."""


@pytest.mark.parametrize("angle", [0.0, 90.0, 180.0, *wide(270.0)])
def test_a_robot_that_is_lost_comes_down_with_its_head_up_or_slow(angle):
    seen = []

    def look(supervisor, plant, state):
        assert np.isfinite(state.q).all()
        assert (np.abs(plant.torque) <= SPEC.effort_max).all()
        if supervisor.state in (State.DESCENDING, State.FALLEN):
            seen.append((supervisor.state, supervisor.status.status, supervisor.status.reason))
        if supervisor.state is State.DESCENDING:
            command = supervisor._falling._descent.command(state)
            assert (command.q >= SPEC.position_min).all()
            assert (command.q <= SPEC.position_max).all()
            assert not command.tau.any()

    landings, end, let_down = pushed("never", angle, 2.0 * stood("never", angle), look=look)
    torso, hands = BEFORE[min(angle, 360.0 - angle)]
    assert let_down
    assert landings.speed.get("head", 0.0) < min(1.5, torso)
    assert landings.speed.get("hands", 0.0) < min(2.0, hands)
    assert end is State.FALLEN
    assert list(dict.fromkeys(seen)) == [
        (State.DESCENDING, Status.STOP, Reason.DESCENDING),
        (State.FALLEN, Status.DAMPING, Reason.STANDING_LOST),
    ]


def test_what_is_stood_begins_no_descent():
    landings, end, let_down = pushed("never", 0.0, 9.5)
    assert not let_down
    assert not landings.speed
    assert end is State.HOLDING


def test_only_a_robot_with_the_joints_of_the_folds_is_let_down():
    assert Descent(Robot(SPEC)).known
    assert Descent(Robot(g1(locked=("waist_.*_joint", ".*_wrist_(pitch|yaw)_joint")))).known
    assert not Descent(Robot(talos())).known
