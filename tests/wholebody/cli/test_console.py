"""What the library logs reaches a person's terminal as one line that says whose it is."""

import logging
import time

import pytest

from wholebody.cli import console
from wholebody.cli.commands.settings import warmup
from wholebody.cli.console import log_to_terminal


@pytest.mark.parametrize(
    ("logger", "line"),
    [
        ("policy.executor.executor", "wholebody: starved"),
        ("wholebody.episode.run", "wholebody: starved"),
        ("another.library", "another.library: starved"),
    ],
)
def test_a_warning_is_one_line_that_names_its_source(monkeypatch, capsys, logger, line):
    monkeypatch.setattr(logging.root, "handlers", [])
    monkeypatch.setattr(logging.root, "level", logging.WARNING)
    log_to_terminal()
    logging.getLogger(logger).warning("%s", "starved")
    logging.getLogger(logger).info("not for people")
    assert capsys.readouterr().err == f"{line}\n"


def test_logging_that_is_configured_already_stays_as_it_is(monkeypatch):
    own = logging.NullHandler()
    monkeypatch.setattr(logging.root, "handlers", [own])
    log_to_terminal()
    assert logging.root.handlers == [own]


@pytest.fixture
def quick(monkeypatch):
    assert console.FIRST_BEAT + console.HEARTBEAT <= 5.0
    monkeypatch.setattr(console, "FIRST_BEAT", 0.02)
    monkeypatch.setattr(console, "HEARTBEAT", 0.02)


def until(said, capsys):
    """Wait for a line on standard error."""
    text, end = "", time.monotonic() + 60.0
    while said not in text:
        assert time.monotonic() < end, text
        time.sleep(0.01)
        text += capsys.readouterr().err
    return text


def test_c6_in_a_pipe_what_takes_long_says_so_in_plain_lines_again_and_again(quick, capsys):
    with console.waiting("loading the robot"):
        for _ in range(2):
            assert set(until("loading", capsys).splitlines()) == {"wholebody: loading the robot (0 s)"}
    time.sleep(0.1)
    capsys.readouterr()
    time.sleep(0.1)
    assert capsys.readouterr().err == ""


def test_c6_in_a_pipe_a_first_run_says_that_it_compiles_and_then_how_far_it_is(quick, capsys):
    with console.progress_bar("wave", quiet=False) as progress:
        text = until("compiling", capsys)
        assert text.startswith("wholebody: wave: 0 s simulated (0 s)\n")
        assert "wholebody: wave: 0 s simulated, compiling if it is the first time (0 s)\n" in text
        progress(1.0, 7.0)
        assert "wholebody: wave: 1.0 of 7.0 s simulated (0 s)\n" in until("7.0 s simulated (0 s)\n", capsys)


def test_nothing_is_said_beside_json_on_standard_output(quick, capsys):
    with console.progress_bar("wave", quiet=True) as progress, console.waiting("loading", quiet=True):
        time.sleep(0.1)
    assert progress is None
    assert capsys.readouterr() == ("", "")


def test_c6_warming_up_says_in_a_pipe_what_it_does(monkeypatch, capsys):
    monkeypatch.setattr("wholebody.episode.warm_up.warm_up", lambda robot, half_way: half_way() or 61.0)
    warmup()
    assert capsys.readouterr().err.splitlines() == [
        "compiling the control tick and the plan: some ten seconds, once",
        "the plan is compiled",
        "ready after 61 s; later runs load what was compiled",
    ]


def test_in_a_pipe_a_drawing_says_how_far_it_is(quick, capsys):
    with console.progress_bar("drawing run.mp4", before_frames="loading the robot") as progress:
        until("wholebody: drawing run.mp4: loading the robot (0 s)\n", capsys)
        progress(12, 180)
        until("wholebody: drawing run.mp4: 12 of 180 frames (0 s)\n", capsys)
