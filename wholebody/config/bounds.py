"""Bounds of every setting: by the unit of its type, and closer ones by name where physics or time ask for it."""

from __future__ import annotations

import ast
import inspect
from dataclasses import fields, is_dataclass
from functools import cache
from itertools import pairwise
from typing import get_type_hints

from models.unitree_g1 import ARM
from wholebody.config import ControllerConfig
from wholebody.errors import ConfigError, InputError

Bounds = tuple[float, float]

OF_UNIT: dict[str, Bounds] = {
    "": (0.0, 1e4),
    "m": (0.0, 10.0),
    "rad": (0.0, 10.0),
    "s": (0.0, 10.0),
    "m/s": (0.0, 100.0),
    "rad/s": (0.0, 100.0),
    "m/s^2": (0.0, 1e3),
    "rad/s^2": (0.0, 1e4),
    "1/s": (0.0, 1e4),
    "1/s^2": (0.0, 1e6),
    "N": (0.0, 1e4),
    "N/m": (10.0, 1e4),
    "kg": (0.0, 5.0),
    "N m": (0.0, 1e4),
    "N m/rad": (0.0, 2000.0),
    "N m s/rad": (0.0, 100.0),
}
"""Bounds of a unit; weights, in one over a unit squared, have `OF_WEIGHTS`."""
OF_WEIGHTS: Bounds = (0.0, 1e6)
OF_NAME: dict[str, Bounds] = {
    "dt": (5e-4, 0.02),
    "friction": (0.05, 2.0),
    "force_min": (0.0, 50.0),
    "force_max": (100.0, 1e4),
    "leak": (0.01, 10.0),
    "planner.slowdowns": (1.0, 10.0),
    "planner.settle": (0.0, 5.0),
    "robot.linkage_effort": (10.0, 60.0),
    "robot.torque": (0.0, 1.0),
    "robot.stance.knee": (0.2, 1.6),
    "robot.stance.feet_apart": (0.16, 0.5),
    **{f"robot.stance.{name}": (-3.2, 3.2) for name in ARM},
    "touch.force_found": (1.0, 1e4),
    "touch.tipping_share": (0.0, 1.0),
    "touch.mass": (0.5, 10.0),
    "planning.budget": (20.0, 1e4),
}
"""Closer bounds of settings, by their full name."""
OF_LAST_NAME: dict[str, Bounds] = {
    "dt": (0.01, 0.5),
    "speed_share": (0.01, 1.0),
    "friction_share": (0.01, 1.0),
    "torque_share": (0.01, 1.0),
    "capture_time": (0.005, 10.0),
    "joint_horizon": (1e-3, 1.0),
}
"""Closer bounds of settings that several groups have, by their last name; scales are divided by and have `OF_SCALE`."""
OF_SCALE: Bounds = (1e-6, 1e6)
OF_RUN: dict[str, tuple[float, float, str]] = {
    "duration": (0.0, 21_600.0, "s"),
    "settle": (0.0, 60.0, "s"),
    "lead_in": (0.0, 10.0, "s"),
    "hold": (0.0, 3600.0, "s"),
    "payload_kg": (0.0, 50.0, "kg"),
    "payload_known": (0.0, 5.0, "kg"),
    "planning_ms": (0.0, 10_000.0, "ms"),
    "planning_times": (0.0, 1000.0, ""),
    "replace_every": (1, 1000, "steps"),
    "imu_bias": (0.0, 1.0, "rad"),
    "imu_noise": (0.0, 1.0, "rad"),
    "gyro_noise": (0.0, 100.0, "rad/s"),
    "encoder_offset": (0.0, 1.0, "rad"),
    "encoder_noise": (0.0, 1.0, "rad"),
    "speed_noise": (0.0, 100.0, "rad/s"),
    "velocity_cutoff": (0.0, 1e4, "Hz"),
    "gyro_bias": (0.0, 1.0, "rad/s"),
    "acc_noise": (0.0, 50.0, "m/s^2"),
    "acc_bias": (0.0, 10.0, "m/s^2"),
    "yaw_drift": (0.0, 1.0, "rad/s"),
    "lost": (0.0, 0.9, ""),
    "joint_friction": (0.0, 10.0, ""),
    "torque_lag": (0.0, 0.1, "s"),
    "motor_bandwidth": (0.0, 1000.0, "Hz"),
    "motor_damping": (0.05, 5.0, ""),
    "command_delay": (0.0, 0.1, "s"),
    "feed_forward": (0.0, 2.0, ""),
    "delivered": (0.0, 2.0, ""),
    "loss_told": (False, True, ""),
    "mass_error": (0.0, 0.5, ""),
    "torso_error": (0.0, 0.2, "m"),
    "payload_max": (0.0, 50.0, "kg"),
    "floor_friction": (0.01, 10.0, ""),
    "delay": (0.0, 1.0, "s"),
    "delay_misjudged": (-0.1, 0.1, "s"),
    "seed": (0, 2**63 - 1, ""),
}
"""Bounds and units of what a simulated run can be told: times, loads, errors of sensors."""
_ENTRIES_MAX = 16
"""Most entries of a list."""


def bounds_of(path: str, owner: type) -> Bounds:
    """Least and largest value of a setting.

    Args:
        path: Its full name, as in ``safety.balance_gain``.
        owner: Class that it is a field of.
    """
    name = path.rpartition(".")[2]
    if path in OF_NAME:
        return OF_NAME[path]
    if name in OF_LAST_NAME:
        return OF_LAST_NAME[name]
    if "weight" in name:
        return OF_WEIGHTS
    if "scale" in _annotations(owner, name):
        return OF_SCALE
    return OF_UNIT[unit_of(owner, name).partition(",")[0]]


def unit_of(owner: type, name: str) -> str:
    """Unit of a field, which its type is annotated with; empty for a number without one."""
    return next(iter(_annotations(owner, name)), "")


@cache
def _annotations(owner: type, name: str) -> tuple[str, ...]:
    """Unit of a field, and ``scale`` if it is one that is divided by; nothing for a number without a unit."""
    return getattr(get_type_hints(owner, include_extras=True)[name], "__metadata__", ())


def require_bounds(path: str, value: object, owner: type, where: str) -> None:
    """Refuse a number, or a list with a number, outside its bounds; names have none.

    Args:
        path: Full name of the setting.
        value: What it is set to, of the right type.
        owner: Class that it is a field of.
        where: Where it comes from, for the message.

    Raises:
        ConfigError: Naming value, bounds and unit.
    """
    numbers = value if isinstance(value, tuple) else (value,)
    if isinstance(value, tuple) and not 1 <= len(value) <= _ENTRIES_MAX:
        text = f"{where}: {path} has {len(value)} numbers; 1 to {_ENTRIES_MAX} are expected"
        raise ConfigError(text, setting=path)
    for number in numbers:
        if isinstance(number, bool) or not isinstance(number, int | float):
            continue
        (least, most), unit = bounds_of(path, owner), unit_of(owner, path.rpartition(".")[2])
        if not least <= number <= most:
            sentence = f"{least:g} to {most:g}{f' {unit}' if unit else ''} is expected"
            raise ConfigError(f"{where}: {path} is {number:.6g}; {sentence}", setting=path)


def require_run(name: str, value: float, says: str = "") -> None:
    """Refuse a number of a simulated run outside `OF_RUN`, NaN too.

    Args:
        name: Which it is.
        value: What it is set to.
        says: What to call it, if not its name.

    Raises:
        InputError: Naming value, bounds and unit.
    """
    least, most, unit = OF_RUN[name]
    if not least <= value <= most:
        space = " " if unit else ""
        text = (
            f"{says or name} is {value:g}{space}{unit}; it must be at least {least:g} and at most {most:g}{space}{unit}"
        )
        raise InputError(text, field=name)


def require_all(owner: object) -> None:
    """`require_run` for every field of a dataclass that is in `OF_RUN`.

    Raises:
        InputError: As `require_run`.
    """
    for name, value in vars(owner).items():
        if name in OF_RUN:
            require_run(name, value)


def check_config(config: ControllerConfig, where: str = "configuration") -> None:
    """Refuse a configuration with a number outside its bounds.

    Raises:
        ConfigError: Naming setting, value, bounds and unit.
    """
    _check(config, (), where)


def _check(owner: object, path: tuple[str, ...], where: str) -> None:
    for field in fields(owner):
        value, here = getattr(owner, field.name), (*path, field.name)
        if is_dataclass(value):
            _check(value, here, where)
        else:
            require_bounds(".".join(here), value, type(owner), where)


@cache
def meanings(owner: type) -> dict[str, str]:
    """The text below each field of a configuration class, and its unit."""
    (definition,) = ast.parse(inspect.getsource(owner)).body
    found = {}
    for field, text in pairwise(definition.body):
        if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
            name, meaning = field.target.id, str(text.value.value)
            unit = unit_of(owner, name)
            found[name] = f"{meaning.removesuffix('.')} [{unit}]." if unit else meaning
    return found
