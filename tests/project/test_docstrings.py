"""Strategy: the first word of every docstring is looked at: it begins with what something is or does."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
NO_HEADS = (
    "Of",
    "That",
    "Those",
    "By",
    "As",
    "In",
    "From",
    "For",
    "To",
    "With",
    "Until",
    "At",
    "On",
    "When",
    "If",
    "Also",
)
"""Words that begin no noun and no verb: what follows them is said of something that is not there."""


def docstrings():
    """Where each docstring of a function or class is, and its first line."""
    for package in ("models", "policy", "wholebody"):
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.FunctionDef | ast.ClassDef) and (text := ast.get_docstring(node)):
                    yield f"{path.relative_to(ROOT)}:{node.lineno} {node.name}", text.partition("\n")[0]


def test_a_docstring_begins_with_a_noun_or_a_verb():
    found = dict(docstrings())
    assert len(found) > 2000
    assert {
        where: line for where, line in found.items() if line.split()[0] in NO_HEADS or line.startswith("The same")
    } == {}
