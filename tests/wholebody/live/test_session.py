"""Strategy: a session on a robot that is handed to it, in the test's own process: it is started, told to go, commanded
and closed, and what it says at its end is handed on.
"""

from concurrent.futures import ThreadPoolExecutor
from time import monotonic

import numpy as np
import pytest

from models import g1
from models.pinocchio_model import load_pinocchio, stance_q
from policy.executor.executor import ExecutorConfig
from policy.scripted.library import scripted_policy
from wholebody.config import ControllerConfig
from wholebody.errors import StateError
from wholebody.live.loop import StaticRobot
from wholebody.live.session import Session, SessionConfig
from wholebody.types import Reason, RobotState

SPEC = g1()


class Watched(StaticRobot):
    """A robot that stands like a statue and takes note of what is done with it."""

    def __init__(self):
        model = load_pinocchio(SPEC)
        super().__init__(RobotState(0.0, stance_q(SPEC, model), np.zeros(model.nv)))
        self.told, self.commands = [], []

    def start(self, page=None):
        self.told.append("start")
        self.origin = monotonic()
        return self._state

    def go(self, origin):
        self.told.append("go")
        self.origin = origin

    def send(self, command):
        self.commands.append(command)

    def order(self, order):
        self.told.append(order.what)

    def close(self):
        self.told.append("close")
        return {"fall": ""}


@pytest.mark.alone
def test_a_session_runs_the_robot_that_it_is_given(monkeypatch):
    # What keeps time collects garbage and changes the scheduling of the whole process: here that is the tests' own.
    monkeypatch.setattr("wholebody.live.pacing.keep_time", list)
    robot = Watched()
    session = Session(ControllerConfig(), robot, SessionConfig(duration=0.5, settle=0.2, hold=0.1))
    assert robot.told == ["start"]
    session.run({"wave": scripted_policy("wave")}, lambda now: None, ExecutorConfig())
    assert session.close() == {"fall": ""}
    assert robot.told == ["start", "go", "close"]
    assert len(robot.commands) > 200
    assert all(np.isfinite(command.tau).all() for command in robot.commands)
    assert session.summary()["chunks"]["accepted"] >= 1


@pytest.mark.alone
def test_a_session_is_told_to_walk_from_another_thread(monkeypatch):
    monkeypatch.setattr("wholebody.live.pacing.keep_time", list)
    session = Session(ControllerConfig(), Watched(), SessionConfig(duration=0.1, settle=0.1, hold=0.1))
    with ThreadPoolExecutor(1) as other:
        told = other.submit(session.walk_to, (0.3, 0.0, 0.0))
        bad = session.walk_to("here")
        session.run({"wave": scripted_policy("wave")}, lambda now: None, ExecutorConfig())
        answer = told.result().result(timeout=0.0)
    late = session.walk_to((0.3, 0.0, 0.0))
    session.close()
    assert answer.reason is Reason.WALK_REFUSED
    assert "steps: reach" in answer.detail
    assert bad.result(timeout=0.0).reason is Reason.WALK_REFUSED
    assert "is over" in str(late.exception(timeout=0.0))


@pytest.mark.alone
def test_who_asks_for_a_walk_is_answered_though_the_run_ends_before_and_may_take_it_back(monkeypatch):
    """The future stayed open for ever, and one that was cancelled ended the control loop."""
    monkeypatch.setattr("wholebody.live.pacing.keep_time", list)
    session, asked = Session(ControllerConfig(), Watched(), SessionConfig(duration=0.1, settle=0.1, hold=0.1)), []

    def tell(now):
        asked.append(session.walk_to((0.3, 0.0, 0.0)))
        if len(asked) == 1:
            assert asked[0].cancel()

    session.run({"wave": scripted_policy("wave")}, tell, ExecutorConfig())
    session.close()
    assert all(one.done() for one in asked)
    assert asked[1].result(timeout=0.0).reason is Reason.WALK_REFUSED
    assert isinstance(asked[-1].exception(timeout=0.0), StateError)


def test_a_session_that_never_ran_answers_at_its_end():
    session = Session(ControllerConfig(), Watched(), SessionConfig())
    asked = session.walk_to((0.3, 0.0, 0.0))
    session.close()
    assert isinstance(asked.exception(timeout=0.0), StateError)
