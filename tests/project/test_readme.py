"""Strategy: what the documents tell a reader to type exists, the links lead somewhere, and the short program runs."""

import json
import re
import runpy
import shlex
from pathlib import Path

import pytest
import typer

from wholebody.cli.main import app
from wholebody.config import ControllerConfig
from wholebody.resources import verdict_schema
from wholebody.types import RENAMED, PalmCause, Reason

ROOT = Path(__file__).resolve().parents[2]
CODE = ("models", "policy", "wholebody", "tests", "benchmarks", "examples")
DOCUMENTS = (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"))


def typed(text, program):
    """Lines of code blocks and code spans that call a program, comments left out."""
    spans = re.findall(r"```sh\n(.*?)```|`([^`\n]+)`", text, re.DOTALL)
    lines = "\n".join(block or span for block, span in spans).splitlines()
    return [shlex.split(line, comments=True) for line in lines if line.startswith(f"{program} ")]


def test_the_ten_line_program_runs_and_the_robot_stands(capsys):
    program = ROOT / "examples" / "compose.py"
    body = program.read_text().split('"""', 2)[2].strip()
    assert body in (ROOT / "README.md").read_text()
    assert len([line for line in body.splitlines() if line]) <= 10
    runpy.run_path(str(program))
    assert "fell: False" in capsys.readouterr().out


def test_the_program_for_two_wrist_poses_runs_and_its_way_leads_there(capsys):
    program = ROOT / "examples" / "two_wrists.py"
    posing = program.read_text().partition("left, right")[2].partition("print(posture)")[0]
    assert posing in (ROOT / "README.md").read_text()
    runpy.run_path(str(program))
    said = capsys.readouterr().out
    assert said.startswith("reached: left wrist")
    assert float(re.search(r"left wrist ([\d.]+) mm off\n$", said)[1]) < 2.0


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_command_and_option_exists(document):
    group = typer.main.get_command(app)
    commands, own = group.commands, {option for parameter in group.params for option in parameter.opts}
    for _, name, *arguments in typed(document.read_text(), "wholebody"):
        if name in own:
            continue
        assert name in commands, f"{document.name}: wholebody {name}"
        command = commands[name]
        if arguments and arguments[0] in getattr(command, "commands", {}):
            command = command.commands[arguments[0]]
        options = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
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


def anchor(heading):
    """What a link to a heading ends with."""
    return re.sub(r"[^\w\- ]", "", re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()).replace(" ", "-")


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_link_into_a_document_leads_to_a_heading(document):
    for target, place in re.findall(r"\]\(([^)#:]*)#([^)]+)\)", document.read_text()):
        text = (document.parent / target).read_text() if target else document.read_text()
        assert place in [anchor(line) for line in re.findall(r"^#+ (.+)$", text, re.MULTILINE)], f"{target}#{place}"


def test_every_answer_is_explained():
    answers = json.loads(verdict_schema().read_text())["$defs"]["verdict"]["properties"]["verdict"]["enum"]
    text = (ROOT / "docs" / "verdict.md").read_text()
    assert [answer for answer in answers if f"| `{answer}` |" not in text] == []


def test_the_tables_of_reason_codes_say_what_the_enum_says():
    text = (ROOT / "docs" / "verdict.md").read_text().partition("## Reason codes")[2].partition("| Cause |")[0]
    rows = re.findall(r"^\| `(\w+)` \| (?:`(\w+)`|–) \| (.+?) \|", text, re.MULTILINE)
    assert rows == [(reason, reason.status.value if reason.status else "", reason.sentence) for reason in Reason]


def test_the_schema_knows_every_reason_code_as_a_violation_and_every_cause():
    known = json.loads(verdict_schema().read_text())["$defs"]["violation"]["properties"]
    assert known["code"]["enum"] == list(Reason)
    assert known["cause"]["enum"] == [None, *PalmCause]


def test_the_tables_of_causes_and_of_old_codes_say_what_the_enums_say():
    text = (ROOT / "docs" / "verdict.md").read_text()
    rows = re.findall(r"^\| `(palm_\w+)` \| `(\w+)` \| (.+?) \| (.+?) \| `(\w+)` \|$", text, re.MULTILINE)
    old = {cause: code for code, cause in RENAMED.items()}
    assert [(*row[:3], row[4]) for row in rows] == [(one.code, one, one.sentence, old[one]) for one in PalmCause]


def test_every_code_of_the_executor_is_a_reason():
    codes = set(re.findall(r'"((?:policy|chunk)_\w+|starved)"', (ROOT / "policy/executor/executor.py").read_text()))
    assert codes >= {"policy_hung", "starved"}
    assert codes <= set(Reason)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_file_and_folder_that_is_named_exists(document):
    text = document.read_text()
    files = re.findall(r"(?<![\w./*<-])((?:[\w-]+/)*\w[\w-]*\.py)\b", text)
    folders = re.findall(rf"`((?:{'|'.join(CODE)})/[\w/]*/)`", text)
    folders += re.findall(r"`([\w./-]*\*[\w.*-]*\.py)`", text)
    named = [name for name in [*files, *folders] if not any(ROOT.glob(name))]
    assert named == [], f"{document.name} names {named}"


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_module_that_is_named_exists(document):
    for name in re.findall(r"`((?:models|policy|wholebody)(?:\.\w+)+)[`(]", document.read_text()):
        assert exists(name), f"{document.name} names {name}"


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_name_that_a_code_block_imports_exists(document):
    line = r"^from ((?:models|policy|wholebody)[\w.]*) import ([\w, ]+)$"
    for module, names in re.findall(line, document.read_text(), re.MULTILINE):
        for name in names.split(", "):
            assert exists(f"{module}.{name}"), f"{document.name}: from {module} import {name}"


@pytest.mark.parametrize("document", sorted((ROOT / "docs").rglob("*.md")), ids=lambda path: path.name)
def test_the_settings_that_are_named_exist_and_have_the_values_that_are_told(document):
    pattern = r"`((?:planner|planning|safety|verdict|body|hands)\.(?!schema)[a-z_.]*[a-z_])`(?: = ([\d.]*\d))?"
    for name, told in re.findall(pattern, document.read_text()):
        value = ControllerConfig()
        for part in name.split("."):
            assert hasattr(value, part), f"{document.name}: {name}"
            value = getattr(value, part)
        assert not told or float(told) == value, f"{document.name}: {name} = {told}"


def exists(name):
    """Whether dots lead to a module, or to a name that stands in one; nothing is imported."""
    parts = name.split(".")
    for end in range(len(parts), 0, -1):
        folder = ROOT.joinpath(*parts[:end])
        for source in (folder.with_suffix(".py"), folder / "__init__.py"):
            if source.is_file():
                return end == len(parts) or re.search(rf"\b{parts[end]}\b", source.read_text()) is not None
    return False
