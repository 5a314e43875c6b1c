"""Strategy: the table of docs/architecture.md that says where things are is held against the files that it names."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
NAMED = re.compile(r"`((?:wholebody|policy|models)/[\w/]+\.py)` `(\w+)`")


def rows():
    text = (ROOT / "docs/architecture.md").read_text().partition("## Where is …?")[2].partition("\n## ")[0]
    return [line for line in text.splitlines() if line.startswith("| ")][1:]


def test_every_answer_names_a_file_and_what_is_defined_in_it():
    assert len(rows()) >= 14
    for row in rows():
        assert NAMED.findall(row), row
        for file, name in NAMED.findall(row):
            source = (ROOT / file).read_text()
            assert re.search(rf"^ *(class|def) {name}\b", source, re.MULTILINE), f"{name} is not in {file}"
