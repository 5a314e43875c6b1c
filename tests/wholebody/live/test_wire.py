"""Strategy: messages over a real socket pair: what is sent comes back, the newest counts, nobody waits."""

from dataclasses import replace

import numpy as np
import pytest

from wholebody.live import wire
from wholebody.live.snapshot import REASONS, Snapshot
from wholebody.sim.recorder import Followed
from wholebody.types import JointCommand, Reason, RobotState, Status, StatusReport


@pytest.fixture
def ends():
    here, there = wire.wire()
    yield here, there
    here.close()
    there.close()


def state(time=1.5):
    return RobotState(time, np.arange(50.0), -np.arange(49.0))


def test_a_state_comes_as_it_was_sent(ends):
    assert wire.send(ends[0], *wire.state_message(state()))
    came = wire.state_of(wire.newest(ends[1]), 50, 49)
    assert came.time == 1.5
    np.testing.assert_array_equal(came.q, state().q)
    np.testing.assert_array_equal(came.v, state().v)
    assert came.tau is None


def test_torques_come_with_a_state_that_has_them(ends):
    sent = RobotState(1.5, np.arange(50.0), -np.arange(49.0), np.arange(43.0))
    wire.send(ends[0], *wire.state_message(sent))
    np.testing.assert_array_equal(wire.state_of(wire.newest(ends[1]), 50, 49).tau, sent.tau)


def test_a_command_comes_as_it_was_sent(ends):
    sent = JointCommand(0.25, *(k + np.arange(43.0) for k in range(5)))
    wire.send(ends[0], *wire.command_message(sent))
    came = wire.command_of(wire.newest(ends[1]))
    for name in ("time", "q", "dq", "tau", "kp", "kd"):
        np.testing.assert_array_equal(getattr(came, name), getattr(sent, name))


def test_of_several_messages_the_newest_counts_and_none_is_none(ends):
    for time in (1.0, 2.0, 3.0):
        wire.send(ends[0], *wire.state_message(state(time)))
    assert wire.newest(ends[1])[0] == 3.0
    assert wire.newest(ends[1], timeout=1e-3) is None


def test_a_side_that_does_not_read_never_makes_the_other_wait(ends):
    answers = [wire.send(ends[0], np.zeros(1000)) for _ in range(2000)]
    assert answers[0]
    assert not answers[-1]


def test_a_side_that_is_gone_is_told():
    here, there = wire.wire()
    there.close()
    assert not wire.send(here, 1.0)
    with pytest.raises(EOFError):
        wire.newest(here)
    here.close()


@pytest.mark.parametrize("reason", [None, REASONS[0], Reason.OUT_OF_REACH, REASONS[-1]])
@pytest.mark.parametrize("tau", [None, np.arange(43.0)], ids=["without_torques", "with_torques"])
def test_a_glance_comes_as_it_was_shown(ends, reason, tau):
    palms = np.arange(32.0).reshape(2, 4, 4)
    status = StatusReport(Status.SLOWED, reason)
    seen = replace(state(), tau=tau)
    sent = Snapshot(seen, Followed(palms, 2.0 * palms, status, 0.5, 0.08), np.full(50, np.nan), 1e-3, 3, 4, 2)
    wire.send(ends[0], *sent.message())
    came = Snapshot.of(wire.newest(ends[1]), 50, 49)
    assert (came.followed.status, came.followed.rate, came.followed.planning_time) == (status, 0.5, 0.08)
    assert (came.tick, came.missed, came.late, came.source) == (1e-3, 3, 4, 2)
    np.testing.assert_array_equal(came.followed.commanded, 2.0 * palms)
    assert np.isnan(came.planned).all()
    np.testing.assert_array_equal(came.state.q, seen.q)
    assert came.state.tau is None if tau is None else (came.state.tau == tau).all()


def test_before_the_first_chunk_nothing_is_asked(ends):
    followed = Followed(None, np.zeros((2, 4, 4)), StatusReport(Status.HOLD, Reason.NO_CHUNK))
    wire.send(ends[0], *Snapshot(state(), followed, np.zeros(50), 0.0, 0, 0, 0).message())
    assert Snapshot.of(wire.newest(ends[1]), 50, 49).followed.asked is None
