"""Strategy: the lines of the documents are measured; tables, code and links that cannot be broken are left out."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCUMENTS = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "configs").glob("*.md")]
COLUMNS, LINES = 120, 8


def prose(text):
    """Lines of paragraphs and lists."""
    plain = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    return [line for line in plain.splitlines() if not line.lstrip().startswith(("|", "#", "!", "<", "*!"))]


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_lines_of_prose_can_be_read_side_by_side(document):
    """A line is longer only where a link or a span of code without a space makes it so."""
    long = [line for line in prose(document.read_text()) if len(line) > COLUMNS]
    assert [line for line in long if len(re.sub(r"\]\([^)]*\)|`[^`]*`", "", line)) > COLUMNS] == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_no_paragraph_is_so_long_that_its_beginning_is_forgotten(document):
    plain = re.sub(r"^```.*?^```$", "", document.read_text(), flags=re.MULTILINE | re.DOTALL)
    parts = re.split(r"\n(?:\s*\n|(?=\s*(?:[-*]|\d+\.) ))", plain)
    parts = [[line for line in part.splitlines() if line.strip() and line.strip()[0] not in "|#!<"] for part in parts]
    assert [part[0] for part in parts if len(part) > LINES] == []
