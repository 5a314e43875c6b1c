"""Strategy: the tables of docs/architecture.md that say where things are are held against the files that they name."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
NAMED = re.compile(r"`([\w/]+\.py)`((?: `\w+`,?)+)")
PACKAGES = ("models", "policy", "wholebody", "lerobot_robot_wholebody")


def rows():
    text = (ROOT / "docs/architecture.md").read_text().partition("## Where is …?")[2].partition("\n## ")[0]
    return [line for line in text.splitlines() if line.startswith("| ") and not line.startswith("| What |")]


def test_every_answer_names_a_file_and_what_is_defined_in_it():
    assert len(rows()) >= 60
    for row in rows():
        assert NAMED.findall(row), row
        for file, names in NAMED.findall(row):
            source = (ROOT / file).read_text()
            for name in re.findall(r"`(\w+)`", names):
                assert re.search(rf"^ *(class|def) {name}\b", source, re.MULTILINE), f"{name} is not in {file}"


def test_every_room_says_where_to_begin():
    """Names in the first lines of a room exist: a module, or a class or function of one."""
    named = 0
    for package in PACKAGES[:3]:
        for path in (ROOT / package).rglob("__init__.py"):
            text = ast.get_docstring(ast.parse(path.read_text())) or ""
            for name in re.findall(r"`((?:models|policy|wholebody)\.[\w.]+)`", text.partition("Begin with")[2]):
                module, _, last = name.rpartition(".")
                named += 1
                if not any((ROOT / name.replace(".", "/")).with_suffix(end).exists() for end in ("", ".py")):
                    source = (ROOT / module.replace(".", "/")).with_suffix(".py").read_text()
                    assert re.search(rf"^(class|def) {last}\b", source, re.MULTILINE), f"{path}: {name}"
    assert named > 50


def test_a_file_says_in_one_line_what_it_is():
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            text = ast.get_docstring(ast.parse(path.read_text())) or ""
            assert text.partition("\n")[0].endswith((".", ":", "?")), path
