"""Strategy: more messages than anybody reads, on a clock that the test sets."""

import logging

import pytest

from policy import sparing_log
from policy.clock import SimulatedClock
from policy.sparing_log import BURST, PERIOD, SparingLog


@pytest.fixture
def clock(monkeypatch):
    clock = SimulatedClock()
    monkeypatch.setattr(sparing_log, "monotonic", clock.now)
    return clock


def test_a_few_messages_come_at_once_then_one_a_period_and_the_rest_is_counted(clock, caplog):
    log = SparingLog(logging.getLogger("policy.a"))
    for k in range(300):
        clock.set(0.01 * k)
        log.warning("message %d", k)
    assert [record.getMessage() for record in caplog.records] == [f"message {k}" for k in range(BURST)]
    caplog.clear()
    clock.set(clock.now() + PERIOD)
    log.error("the next")
    log.error("none")
    assert [record.getMessage() for record in caplog.records] == [
        f"{300 - BURST} messages were left out: they came too fast",
        "the next",
    ]


def test_what_is_no_warning_is_not_counted(clock, caplog):
    caplog.set_level(logging.INFO, "policy.a")
    log = SparingLog(logging.getLogger("policy.a"))
    for _ in range(3 * BURST):
        log.info("said")
    assert len(caplog.records) == 3 * BURST
