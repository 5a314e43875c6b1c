"""Strategy: the tables of docs/planner.md are read and held against the settings and the bounds of the optimiser."""

import re
from pathlib import Path

from wholebody.config import ControllerConfig
from wholebody.planning.strategies.rows import APART, AT_A_SPEED, BETTER, TURNED
from wholebody.trajopt.weights import BOUNDS

ROOT = Path(__file__).parents[3]


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


TABLES = {"At a speed": AT_A_SPEED, "*Better*": BETTER, "*Turned*": TURNED, "*Apart*": APART}


def shown(row):
    """A row of strategies as the page has it, and those that follow from it."""
    names = {rows: name.lower() for name, rows in TABLES.items()}
    when, kept = row.when.__doc__.rstrip("."), row.keep.__doc__.rstrip(".")
    tried = row.strategy.name.replace("_", " ") if row.strategy else ""
    further = names.get(row.better, "")
    what = ", then ".join(part for part in (tried, further) if part) or (
        "–" if row.reserve is None else "no budget is kept for later"
    )
    kept = kept if row.strategy else "the present one" if row.take else "–"
    yield f"| {when} | {what} | {kept} | {'taken' if row.take else 'next row'} |"
    for one in row.then:
        yield next(shown(one)).replace("| ", "| – if kept: ", 1)


def test_the_rows_of_strategies_are_on_the_planners_page():
    """What is missing there can be pasted from here."""
    text = (ROOT / "docs/planner.md").read_text()
    for name, rows in TABLES.items():
        lines = [
            f"| {name}: when | Tried | Kept | Then |",
            "|---|---|---|---|",
            *(x for row in rows for x in shown(row)),
        ]
        table = "\n".join(lines)
        assert table in text, table
