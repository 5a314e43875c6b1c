"""Strategy: scripts that are run by their path are read; some packages install a `tests` of their own, which comes
first unless the script says where this project is.
"""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted(
    path
    for folder in ("benchmarks", "tests/support")
    for path in (ROOT / folder).glob("*.py")
    if '__name__ == "__main__"' in path.read_text()
)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_finds_this_projects_tests_first(script):
    text = script.read_text()
    depth = len(script.relative_to(ROOT).parts) - 1
    here = re.search(rf"sys\.path\.insert\(0, str\(Path\(__file__\).*parents\[{depth}\]\)\)", text)
    assert "from tests." not in text or (here is not None and here.start() < text.index("from tests."))


def test_there_are_scripts():
    assert len(SCRIPTS) > 10
