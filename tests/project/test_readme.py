"""Strategy: what the documents tell a reader to type exists, the links lead somewhere, and the short program runs."""

import json
import re
import runpy
from pathlib import Path

import pytest
import typer

from wholebody.cli.main import app
from wholebody.resources import verdict_schema

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = (*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"))


def typed(text, program):
    """Lines of code blocks and code spans that call a program, comments left out."""
    spans = re.findall(r"```sh\n(.*?)```|`([^`\n]+)`", text, re.DOTALL)
    lines = "\n".join(block or span for block, span in spans).splitlines()
    return [line.partition("#")[0].split() for line in lines if line.startswith(f"{program} ")]


def test_the_ten_line_program_runs_and_the_robot_stands(capsys):
    program = ROOT / "examples" / "compose.py"
    body = program.read_text().split('"""', 2)[2].strip()
    assert body in (ROOT / "README.md").read_text()
    assert len([line for line in body.splitlines() if line]) <= 10
    runpy.run_path(str(program))
    assert "fell: False" in capsys.readouterr().out


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_command_and_option_exists(document):
    commands = typer.main.get_command(app).commands
    for _, name, *arguments in typed(document.read_text(), "wholebody"):
        assert name in commands, f"{document.name}: wholebody {name}"
        command = commands[name]
        if arguments and arguments[0] in getattr(command, "commands", {}):
            command = command.commands[arguments[0]]
        options = {option for parameter in command.params for option in parameter.opts}
        for argument in arguments:
            if argument.startswith("--"):
                assert argument in options, f"{document.name}: wholebody {name} {argument}"


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_make_target_exists(document):
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    for _, *arguments in typed(document.read_text(), "make"):
        named = [argument.rstrip(",") for argument in arguments if re.fullmatch(r"[a-z-]+,?", argument)]
        assert set(named) <= targets, f"{document.name}: make {named}"


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_link_leads_to_a_file(document):
    for target in re.findall(r"\]\(([^)#:]+)\)", document.read_text()):
        assert (document.parent / target).exists(), f"{document.name} links to {target}"


def test_every_reason_code_and_answer_is_explained():
    schema = json.loads(verdict_schema().read_text())["$defs"]
    codes = schema["violation"]["properties"]["code"]["enum"] + schema["verdict"]["properties"]["verdict"]["enum"]
    text = (ROOT / "docs" / "verdict.md").read_text()
    assert [code for code in codes if f"| `{code}` |" not in text] == []
