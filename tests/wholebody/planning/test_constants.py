"""Strategy: the sources of planning/ and the tables of docs/planner.md are read, and held against each other."""

import ast
import re
from itertools import pairwise
from pathlib import Path

import pytest

from wholebody.config import ControllerConfig
from wholebody.planning.trajopt.weights import BOUNDS

ROOT = Path(__file__).parents[3]
SOURCES = sorted((ROOT / "wholebody/planning").rglob("*.py"))


def constants(tree):
    """Names that a module gives to numbers, and the text below each."""
    body = [*tree.body, None]
    for node, after in pairwise(body):
        if isinstance(node, ast.Assign):
            numbers = [x for x in ast.walk(node.value) if isinstance(x, ast.Constant) and isinstance(x.value, float)]
            text = after.value if isinstance(after, ast.Expr) else None
            if numbers:
                yield ast.unparse(node.targets[0]), text.value if isinstance(text, ast.Constant) else ""


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.stem)
def test_every_number_that_stands_in_the_code_says_what_it_is(path):
    assert [name for name, text in constants(ast.parse(path.read_text())) if len(text) < 20] == []


def test_a_number_without_a_word_is_found():
    assert dict(constants(ast.parse('A = 0.3\nB = 0.1\n"""Distance of a palm [m]."""'))).get("A") == ""


def rows():
    """Lines of the tables as lists of cells."""
    lines = (ROOT / "docs/planner.md").read_text().splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("| ")]


def test_the_scales_of_the_planners_page_are_the_settings():
    posture, seen = ControllerConfig().planner.posture, 0
    for cells in rows():
        setting = cells[1].strip("`") if len(cells) == 3 else ""
        if hasattr(posture, setting):
            seen += 1
            assert float(cells[2].split()[0]) == getattr(posture, setting), setting
    assert seen == 13


def test_the_bounds_of_the_planners_page_are_those_of_the_optimiser():
    posture = ControllerConfig().planner.posture
    table = {cells[0]: cells for cells in rows() if len(cells) == 5}
    for bound in BOUNDS:
        _, settings, values, scale, tolerance = table[bound.name]
        assert (float(scale), float(tolerance.split()[0])) == (bound.scale, bound.tolerance)
        names = re.findall(r"`(\w+)`", settings)
        numbers = [float(x) for x in re.findall(r"\d+\.\d+", values)]
        assert [getattr(posture, name) for name in names] == numbers, bound.name


def test_settings_named_on_the_planners_page_have_the_values_given_there():
    planner, text = ControllerConfig().planner, (ROOT / "docs/planner.md").read_text()
    found = re.findall(r"`planner\.(\w+)` = (\d+\.\d+)", text.replace("\n  ", " "))
    assert len(found) >= 6
    for name, value in found:
        assert getattr(planner, name) == float(value), name
