"""Configurations from YAML: a file names only what it changes, the defaults are those of the dataclasses."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from difflib import get_close_matches
from math import isfinite
from pathlib import Path

import cattrs
import yaml

from wholebody.config import ControllerConfig
from wholebody.errors import ConfigError


def load_config(path: str | Path) -> ControllerConfig:
    """The controller's configuration with the changes of one file.

    Args:
        path: YAML file, nested like `ControllerConfig`.

    Raises:
        ConfigError: If the file is no YAML mapping, names something unknown, or gives a value of the wrong type.
        OSError: If the file cannot be read.
    """
    try:
        changes = yaml.safe_load(Path(path).read_text())
    except yaml.YAMLError as error:
        raise ConfigError(f"{path} is not YAML: {error}") from error
    return config_from(changes or {}, source=str(path))


def config_from(changes: object, source: str = "configuration") -> ControllerConfig:
    """The same from plain data."""
    _check(ControllerConfig, changes, source, "")
    converter = cattrs.Converter(forbid_extra_keys=True)
    converter.register_structure_hook(float, _number)
    converter.register_structure_hook(int, _whole)
    try:
        return converter.structure(changes, ControllerConfig)
    except Exception as error:
        reasons = "; ".join(cattrs.transform_error(error, format_exception=lambda reason, _: str(reason)))
        raise ConfigError(f"{source}: {reasons}") from error


def dump_config(config: ControllerConfig) -> str:
    """A configuration as YAML, every value written out."""
    data = cattrs.Converter().unstructure(config)
    return yaml.safe_dump(data, sort_keys=False)


def _check(owner: type, data: object, source: str, where: str) -> None:
    """Unknown names first: their cure is a better name."""
    if not isinstance(data, dict):
        raise ConfigError(f"{source}: {where or 'the file'} must be a mapping of names to values, got {data!r}")
    known = {field.name: field.default_factory for field in fields(owner)}
    for name, value in data.items():
        path = f"{where}.{name}" if where else str(name)
        if name not in known:
            near = get_close_matches(str(name), known, n=1)
            hint = f"did you mean '{near[0]}'? " if near else ""
            raise ConfigError(f"{source}: unknown setting '{path}'; {hint}known here: {', '.join(known)}")
        if is_dataclass(known[name]):
            _check(known[name], value, source, path)


def _number(value: object, _: type) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise ValueError(f"must be a finite number, got {value!r}")
    return float(value)


def _whole(value: object, _: type) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError(f"must be a whole number, got {value!r}")
    return value
