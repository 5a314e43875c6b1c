"""Strategy: the command at the bottom of a page is read back as typer reads the one that was typed."""

import shlex
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from wholebody.cli.options import Judging, Simulation, VerdictFiles, flat
from wholebody.cli.pages import Pages


def judge(
    *, context: typer.Context, inputs: list[str], simulation: Simulation, judging: Judging, to: VerdictFiles
) -> None:
    """Print what makes the page of each input again."""
    pages = Pages.at(to.report, inputs, context)
    for name in inputs:
        print(pages.command(name), "|", simulation.payload_kg, simulation.realistic, judging.as_given)


@pytest.fixture(scope="module")
def app():
    made = typer.Typer()
    made.command()(flat(judge))
    return made


def test_the_command_of_a_page_makes_that_page_and_nothing_else(app, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["--as-given", "a b.npz", "c.npz", "--no-realistic", "--payload-kg", "0.5", "0.25"]
    said = CliRunner().invoke(app, [*words, "--json", "all.json", "--report", "all.html"]).output.splitlines()
    options = "--no-realistic --payload-kg 0.5 0.25 --as-given --report"
    assert said[0].startswith(f"wholebody check 'a b.npz' {options} all/0000_a_b.html |")
    for line in said:
        again, _, settings = line.partition(" | ")
        once_more = CliRunner().invoke(app, shlex.split(again)[2:]).output.strip()
        assert once_more == f"{again} | {settings}"


def test_a_page_that_is_a_folder_is_refused(app, tmp_path):
    Path(tmp_path / "page.html").mkdir()
    failed = CliRunner().invoke(app, ["a.npz", "--report", str(tmp_path / "page.html")]).exception
    assert "it is a folder" in str(failed)
