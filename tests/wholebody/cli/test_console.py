"""What the library logs reaches a person's terminal as one line that says whose it is."""

import logging

import pytest

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
