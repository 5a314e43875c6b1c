"""Strategy: what a page of the documents begins with is looked at, and that the README leads to every page."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted(path for path in (ROOT / "docs").glob("*.md") if not path.name.endswith(".zh.md"))
FIRST = 60


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_a_page_begins_with_what_can_be_typed_and_a_table_of_answers(page):
    """A command or a program, or a diagram; `wholebody` in a table counts as well."""
    lines = page.read_text().splitlines()[:FIRST]
    typed = any(re.match(r"```(sh|bash|python|mermaid)?$", line) or "`wholebody " in line for line in lines)
    assert typed, "no command, program or diagram"
    assert any(line.startswith("|") for line in lines), "no table"


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_what_was_measured_comes_last(page):
    headings = re.findall(r"^## (.*)$", page.read_text(), re.MULTILINE)
    assert "Measured" not in headings[:-1]


@pytest.mark.parametrize("readme", ["README.md", "README.zh.md"])
def test_the_readme_leads_to_every_page(readme):
    text = (ROOT / readme).read_text()
    assert [page.name for page in PAGES if f"(docs/{page.name}" not in text] == []


def test_a_page_of_measurements_belongs_to_a_page():
    for page in (ROOT / "docs/measured").glob("*.md"):
        claims = re.search(r"\]\(\.\./(\w+\.md)", page.read_text())
        assert claims is not None, page.name
        assert (ROOT / "docs" / claims[1]).is_file(), page.name
