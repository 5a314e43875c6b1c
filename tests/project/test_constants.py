"""Strategy: the sources of the library are read; every number with a decimal point that a module keeps under a name is
asked what it is: its unit, and where it comes from. Settings have texts and bounds of their own: `test_config_file`."""

import ast
import re
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LEFT_OUT = {"config", "pictures"}
"""Settings have a test of their own; drawings claim nothing."""
SOURCES = [
    path for path in sorted((ROOT / "wholebody").rglob("*.py")) if not LEFT_OUT & set(path.relative_to(ROOT).parts)
]
UNIT = re.compile(r"\[[^\]]+\]|no unit|\b(share|factor|times|ticks|weight|ratio)\b|in terms of", re.IGNORECASE)
SOURCE = re.compile(
    r"Source:|data sheet|URDF|\bderived\b|\bmeasured\b|\bby trial\b|\bchosen\b|\bdefinition\b|(MuJoCo|Unitree)'s own",
    re.IGNORECASE,
)
"""What tells where a number comes from: literature, documents, a derivation, a measurement, trial, or that somebody
chose it, and why."""


def _decimal(node):
    return isinstance(node, ast.Constant) and isinstance(node.value, float)


def _formula(node):
    """Whether it is a table that a module works out for itself, as the powers of a polynomial."""
    target = ast.unparse(node.targets[0])
    numbers = isinstance(node.value, ast.Constant | ast.Tuple | ast.Dict)
    return target.startswith("_") and ("[" in target or not numbers)


def constants(source):
    """Names that a module, or a class in it, gives to numbers, and what is said of each; None if nothing is."""
    tree = ast.parse(source)
    said = re.search(r"The constants\b.*", (ast.get_docstring(tree) or "").replace("\n", " "))
    for scope in [tree, *(node for node in ast.walk(tree) if isinstance(node, ast.ClassDef))]:
        for node, after in pairwise([*scope.body, None]):
            if isinstance(node, ast.Assign) and not _formula(node) and any(map(_decimal, ast.walk(node.value))):
                text = after.value if isinstance(after, ast.Expr) else None
                own = text.value if isinstance(text, ast.Constant) else ""
                yield ast.unparse(node.targets[0]), " ".join(own.split()), said[0] if said else ""


def silent(source):
    """Names whose text does not say the unit, or says no source while the module's docstring says none for all."""
    return [
        name
        for name, own, shared in constants(source)
        if not (own and UNIT.search(own) and (SOURCE.search(own) or SOURCE.search(shared)))
    ]


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_number_that_stands_in_the_code_has_a_unit_and_a_source(path):
    assert silent(path.read_text()) == []


@pytest.mark.parametrize(
    ("source", "names"),
    [
        ("A = 0.3", ["A"]),
        ('A = 0.3\n"""Distance of a palm [m]."""', ["A"]),
        ('A = 0.3\n"""Distance of a palm; chosen: a hand is as wide."""', ["A"]),
        ('A = 0.3\n"""Distance of a palm [m]; chosen: a hand is as wide."""', []),
        ('"""The constants were found by trial on scripts."""\nA = 0.3\n"""Distance [m]."""\nB = 0.1', ["B"]),
        ('class C:\n    a = 0.3\n    b = 2.0\n    """Share; measured."""', ["a"]),
        ("A = 3", []),
        ("_A = np.array([1.0, 2.0]) / 3.0", []),
    ],
)
def test_a_number_without_unit_or_source_is_found(source, names):
    assert silent(source) == names


@pytest.mark.parametrize("path", sorted((ROOT / "wholebody").rglob("kernels/*.py")), ids=lambda path: path.stem)
def test_every_kernel_says_what_it_returns(path):
    functions = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.FunctionDef)]
    assert [function.name for function in functions if function.returns is None] == []
