"""Configurations from YAML: a file names only what it changes, the defaults are those of the dataclasses."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace
from difflib import get_close_matches
from math import isfinite
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_type_hints

import yaml

from policy.errors import printable
from policy.reading import DEPTH_MAX, ReadingError, read_text
from wholebody.config import ControllerConfig
from wholebody.config.bounds import meanings, require_bounds
from wholebody.errors import ConfigError

FILE_MAX = 256 * 2**10
"""Largest file [bytes]; every setting written out has 17 kB."""
# Every value as its text: no dates, no octal numbers, no objects. The compiled parser is thirty times as fast.
_Loader = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
Locate = Callable[[tuple[str, ...]], str]
"""Place of a setting in a file, for messages."""

PUBLISHED = (
    "dt",
    "backend",
    "solver",
    "steps",
    "friction",
    "planner.posture.torque_share",
    "planner.posture.speed_share",
    "planner.posture.com_margin",
    "planner.posture.elbow_max",
    "planner.posture.self_distance",
    "planner.posture.floor_distance",
    "planner.slowdowns",
    "verdict",
    "planning",
    "robot.model",
    "robot.body",
    "robot.linkage_effort",
    "robot.torque",
    "robot.stance",
    "loads",
    "touch",
)
"""Settings, or groups of them, that depend on robot, world or task; the others are the controller's own, can be changed
likewise, and are only shown where all are asked for."""

RENAMED = {
    "turning": "orientation_relaxed",
    "loss_max": "tracking_error_max",
    "error_max": "mean_error_max",
    "excess_max": "violation_max",
    "sweep": "approach_time",
}
"""Settings of the planner by names that they had before, for messages."""


def load_config(path: str | Path) -> ControllerConfig:
    """The controller's configuration with the changes of one file.

    Args:
        path: YAML file, nested like `ControllerConfig`.

    Raises:
        ConfigError: If the file is no YAML mapping, names something unknown, or gives a value of the wrong type or
            outside its bounds; with file and line. Also if it cannot be read: it is no fault of what is judged with it.
    """
    name = printable(path, 300)
    try:
        text = read_text(path, FILE_MAX)
        _require_plain(text)
        changes, root = yaml.load(text, _Loader), yaml.compose(text, _Loader)
    except ReadingError as error:
        raise ConfigError(f"{name} {error}") from error
    except OSError as error:
        text = f"the settings file '{name}' cannot be read: {error.strerror or error}; `wholebody config` prints one"
        raise ConfigError(text) from error
    # A character that YAML does not have is a ValueError of its own.
    except (yaml.YAMLError, ValueError) as error:
        raise ConfigError(f"{name} is not YAML: {printable(' '.join(str(error).split()), 300)}") from error
    return config_from({} if changes in (None, "") else changes, lambda names: f"{name}:{_line(root, names)}")


def _require_plain(text: str) -> None:
    """Refuse what a mapping of settings never needs: deep nesting, and aliases, which can multiply without end.

    Raises:
        ReadingError: If it is there.
    """
    depth = 0
    for event in yaml.parse(text, _Loader):
        if isinstance(event, yaml.AliasEvent):
            raise ReadingError(f"has an alias (*{printable(event.anchor, 40)}); write the value out")
        if getattr(event, "tag", None):
            raise ReadingError(f"is not YAML of plain values: it has the tag {printable(event.tag, 40)}")
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > DEPTH_MAX:
            raise ReadingError(f"is nested deeper than {DEPTH_MAX} levels")


def config_from(changes: object, place: Locate = lambda names: "configuration") -> ControllerConfig:
    """Settings from plain data.

    Args:
        changes: Nested mappings.
        place: Where a setting comes from, by the names that lead to it.

    Raises:
        ConfigError: See `load_config`.
    """
    return _structure(ControllerConfig(), changes, place, ())


def dump_config(config: ControllerConfig, *, everything: bool = True) -> str:
    """A configuration as YAML, each value under what the field means and its unit.

    Args:
        config: Whose values.
        everything: Write out internal settings too, not `PUBLISHED` alone.
    """
    about = "Every setting, the internal ones too" if everything else "Settings; `wholebody config --all` has the rest"
    return "\n".join([f"# {about}. SI units.", *_documented(config, "", "", everything)]) + "\n"


def _structure(owner: Any, changes: object, place: Locate, path: tuple[str, ...]) -> Any:
    """A copy of a dataclass with changes, each field checked by its type."""
    if not isinstance(changes, dict):
        what = ".".join(path) or "the file"
        text = f"{what} must be a mapping of names to values, got {printable(repr(changes), 80)}"
        raise ConfigError(f"{place(path)}: {text}")
    types, names = get_type_hints(type(owner)), [field.name for field in fields(owner)]
    values = {}
    for name, value in changes.items():
        here = (*path, printable(name, 80))
        if name not in names:
            near = get_close_matches(str(name), names, n=1)
            hint = f"did you mean '{near[0]}'? " if near else _about(str(name), owner)
            if RENAMED.get(str(name)) in names:
                hint = f"it is called '{RENAMED[str(name)]}' now; "
            raise ConfigError(
                f"{place(here)}: unknown setting '{'.'.join(here)}'; {hint}known here: {', '.join(names)}",
                setting=".".join(here),
            )
        if is_dataclass(types[name]):
            values[name] = _structure(getattr(owner, name), value, place, here)
        else:
            values[name] = _value(types[name], value, place, here)
            require_bounds(".".join(here), values[name], type(owner), place(here))
    return replace(owner, **values)


def _about(name: str, owner: object) -> str:
    """What the one setting says whose description has a word like an unknown name; nothing if there is not one."""
    kind: type = type(owner)
    found = {one: " ".join(text.split()) for one, text in meanings(kind).items() if name.lower() in text.lower()}
    return "".join(f"'{one}' is about that: {text} " for one, text in found.items()) if len(found) == 1 else ""


def _value(kind: type, value: object, place: Locate, path: tuple[str, ...]) -> object:
    """A value of a setting's type: a number, a name, or a list of numbers."""
    if isinstance(kind, UnionType):
        kind = next(k for k in get_args(kind) if bool(get_args(k)) == isinstance(value, list | tuple))
    entries = get_args(kind)
    try:
        if not entries:
            return _text(value) if kind is str else _number(value)
        if not isinstance(value, list | tuple):
            raise ValueError(f"must be a list of numbers, got {value!r:.80}")
        if Ellipsis not in entries and len(value) != len(entries):
            raise ValueError(f"must be a list of {len(entries)} numbers, got {len(value)}")
        return tuple(_number(entry) for entry in value)
    except ValueError as error:
        name = ".".join(path)
        raise ConfigError(f"{place(path)}: {name} {error}", setting=name) from error


def _number(value: object) -> float:
    """A finite number, or the text of one."""
    try:
        number = float(value) if isinstance(value, int | float | str) and not isinstance(value, bool) else float("nan")
    except (ValueError, OverflowError):
        number = float("nan")
    if not isfinite(number):
        raise ValueError(f"must be a finite number in SI units, got {value!r:.80}")
    return number


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise ValueError(f"must be a name, got {value!r:.80}")
    return value


def _line(node: yaml.Node | None, names: tuple[str, ...]) -> int:
    """Line of a setting, counted from 1; that of the deepest mapping found on the way to it."""
    line = 1
    for name in names:
        keys = node.value if isinstance(node, yaml.MappingNode) else []
        found = [(key, value) for key, value in keys if key.value == name]
        if not found:
            return line
        key, node = found[0]
        line = key.start_mark.line + 1
    return line


def _documented(owner: Any, path: str, indent: str, everything: bool) -> Iterator[str]:
    kind: type = type(owner)
    texts = meanings(kind)
    for field in fields(owner):
        value, name = getattr(owner, field.name), f"{path}{field.name}"
        inside = any(one.startswith(f"{name}.") for one in PUBLISHED)
        if not (everything or inside or _published(name)):
            continue
        for line in texts.get(field.name, "").splitlines():
            yield f"{indent}# {line.strip()}"
        if is_dataclass(value):
            yield f"{indent}{field.name}:"
            yield from _documented(value, f"{name}.", indent + "  ", everything)
        else:
            plain = list(value) if isinstance(value, tuple) else value
            text = yaml.safe_dump(plain, default_flow_style=True).removesuffix("\n...\n").strip()
            yield f"{indent}{field.name}: {text}"


def _published(name: str) -> bool:
    return any(name == one or name.startswith(f"{one}.") for one in PUBLISHED)
