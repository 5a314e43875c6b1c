"""Names in the source of a kernel: how often one is set, and whether its value is used later."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from enum import Enum


class Use(Enum):
    """What a statement does first with a name."""

    READ, SET, NOTHING = range(3)


def times_set(node: ast.FunctionDef) -> dict[str, int]:
    """How often each name is set; twice for one that is set in a loop or a branch."""
    count: dict[str, int] = {}
    for statement in node.body:
        for name in _found(statement, ast.Store):
            count[name] = count.get(name, 0) + (1 if isinstance(statement, ast.Assign) else 2)
    return count


def sets(statements: Iterable[ast.stmt], name: str) -> bool:
    """Whether any of the statements sets a name."""
    return any(name in _found(statement, ast.Store) for statement in statements)


def is_read(following: Iterable[Iterable[ast.stmt]], name: str) -> bool:
    """Whether a name may be read before it is set, in blocks that follow each other."""
    for block in following:
        use = _first_of(block, name)
        if use is not Use.NOTHING:
            return use is Use.READ
    return False


def _first_of(block: Iterable[ast.stmt], name: str) -> Use:
    for statement in block:
        use = _first(statement, name)
        if use is not Use.NOTHING:
            return use
    return Use.NOTHING


def _first(node: ast.stmt, name: str) -> Use:
    """First use of a name; nothing, where it may be set or not."""
    if isinstance(node, ast.If | ast.While):
        if name in _found(node.test, ast.Load):
            return Use.READ
        both = {_first_of(node.body, name), _first_of(node.orelse, name)}
        return Use.READ if Use.READ in both else Use.SET if both == {Use.SET} else Use.NOTHING
    if isinstance(node, ast.For):
        if name in _found(node.iter, ast.Load):
            return Use.READ
        inside = name not in _found(node.target, ast.Store) and _first_of(node.body, name) is Use.READ
        return Use.READ if inside else Use.NOTHING
    augmented = isinstance(node, ast.AugAssign) and name in _found(node.target, ast.Store)
    if augmented or name in _found(node, ast.Load):
        return Use.READ
    return Use.SET if name in _found(node, ast.Store) else Use.NOTHING


def _found(node: ast.AST, context: type[ast.expr_context]) -> list[str]:
    """Names in a context; kept with the node, which is asked often."""
    kept = node.__dict__.setdefault("_names", {})
    if context not in kept:
        kept[context] = [one.id for one in ast.walk(node) if isinstance(one, ast.Name) and isinstance(one.ctx, context)]
    return kept[context]
