"""Strategy: each worked example of `docs/extending.md` is run as a program of its own, and judges itself."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "extending.md").read_text()
EXAMPLES = re.findall(r"^## (.+?)\n.*?```python\n(.*?)```", PAGE, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize(("title", "program"), EXAMPLES, ids=[title for title, _ in EXAMPLES])
def test_the_worked_example_runs(title, program, tmp_path):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, cwd=tmp_path, env=environment
    )
    assert done.returncode == 0, f"{title}: {done.stderr}"


def test_there_is_an_example_of_everything_and_none_touches_a_kernel():
    assert [title for title, _ in EXAMPLES] == ["A policy", "A scene", "A robot", "A QP solver", "A task", "A limit"]
    assert "kernels" not in "".join(program for _, program in EXAMPLES)
