"""Strategy: `docs/api.md` is read as a program and run in one process; its lists are the packages' own."""

import re
import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

import models
import policy
import wholebody

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "api.md").read_text()
ELSEWHERE = {
    "LeRobotPolicy": "tests/policy/lerobot/test_policy_contract.py",
    "guided": "tests/wholebody/guide/test_denoising.py",
    "warm_up": "tests/wholebody/episode/test_warm_up.py",
}
"""Names whose lines need torch or take long, and what runs them."""


def rows(package):
    """Name, sentence and line of each public name of a package."""
    section = PAGE.partition(f"\n## {package}\n")[2].partition("\n## ")[0]
    return re.findall(r"^\| `(\w+)` \| (.+?) \| `(.+)` \|$", section, re.MULTILINE)


@pytest.mark.parametrize("package", [models, policy, wholebody])
def test_the_page_lists_the_public_names_and_no_others(package):
    listed = [name for name, *_ in rows(package.__name__)]
    assert sorted(listed) == sorted(package.__all__)
    assert all(hasattr(package, name) for name in package.__all__ if name not in ELSEWHERE)


@pytest.mark.parametrize("package", [policy, wholebody])
def test_type_checkers_see_the_public_names_in_their_modules(package):
    """A name that `__getattr__` imports has no type but in the stub."""
    stub = Path(package.__file__).with_suffix(".pyi").read_text()
    seen = re.findall(r"^from ([\w.]+) import (\w+) as \2$", stub, re.MULTILINE)
    assert sorted(name for _, name in seen) == sorted(package.__all__)
    for module, name in seen:
        if name not in ELSEWHERE:
            assert getattr(import_module(module), name) is getattr(package, name)


def test_every_line_uses_the_name_beside_it():
    for package in ("models", "policy", "wholebody"):
        assert [name for name, _, line in rows(package) if not re.search(rf"\b{name}\b", line)] == []


def test_the_lines_of_the_page_run_one_after_the_other(tmp_path):
    (begin,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    lines = [
        row[2] for package in ("models", "policy", "wholebody") for row in rows(package) if row[0] not in ELSEWHERE
    ]
    program = "\n".join([begin, *lines])
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, cwd=tmp_path, timeout=280
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("name", "file"), ELSEWHERE.items())
def test_what_is_not_run_here_is_run_elsewhere(name, file):
    assert name in (ROOT / file).read_text()


@pytest.mark.parametrize("package", [models, policy, wholebody])
def test_an_unknown_name_is_an_attribute_error(package):
    with pytest.raises(AttributeError, match="Suprvisor"):
        _ = package.Suprvisor


def test_the_name_of_the_robot_is_the_function_alone():
    """A module of the same name would hide it as soon as something imports that."""
    assert callable(models.g1)
    assert find_spec("models.g1") is None
