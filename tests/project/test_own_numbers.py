"""Strategy: every template of the page of your own numbers is read and judged at the stance; its program runs."""

import re
from pathlib import Path

import numpy as np
import pytest

from policy import ActionSpec, builtin
from policy.action_spec.describe import stance_numbers
from wholebody import judge

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "own_numbers.md").read_text()
TEMPLATES = [ActionSpec.from_json(text) for text in re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)]


@pytest.mark.parametrize("spec", TEMPLATES, ids=lambda spec: spec.name)
def test_a_template_says_the_stance_which_is_feasible(spec):
    assert f"({spec.dim} numbers)" in PAGE
    actions = np.tile(stance_numbers(spec), (20, 1))
    verdict = judge(actions, layout=spec)
    assert (verdict.verdict, verdict.start_m) == ("feasible", pytest.approx(0.0, abs=2e-3))


def test_the_program_of_the_page_runs(tmp_path, monkeypatch, capsys):
    assert len(TEMPLATES) >= 4
    monkeypatch.chdir(tmp_path)
    actions = np.tile(stance_numbers(builtin("wbc32")), (30, 1))
    actions[:, 2] += 0.5 * np.sin(np.linspace(0.0, 1.5, 30)) ** 2
    np.save("mine.npy", actions)
    program = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL)[1]
    exec(compile(program, "own_numbers.md", "exec"), {})
    assert "chunk 0" in capsys.readouterr().out
    assert np.load("repaired.npy").shape[1] == 32
