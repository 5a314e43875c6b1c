"""Strategy: all classes of the packages are listed: one name is one thing."""

import ast
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("models", "policy", "wholebody", "lerobot_robot_wholebody")
TWICE = {"Guide"}
"""Guides of a walk and of a policy's samples, which nothing uses together."""


def test_no_two_classes_have_one_name():
    """A class that begins with an underscore is its module's own."""
    found = defaultdict(list)
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.parse(path.read_text()).body:
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    found[node.name].append(path.relative_to(ROOT).as_posix())
    assert len(found) > 400
    assert {name: places for name, places in found.items() if len(places) > 1 and name not in TWICE} == {}
