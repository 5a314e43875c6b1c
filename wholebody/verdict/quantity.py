"""Numbers, times and rows as people read them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wholebody.sim.limit_monitor import StepMade
from wholebody.sim.motor_heat import MotorHeat

FOR_PEOPLE = {
    "m": (1e3, " mm"),
    "rad": (np.rad2deg(1.0), " deg"),
    "rad/s": (np.rad2deg(1.0), " deg/s"),
    "rad/s^2": (1.0, " rad/s^2"),
    "rad/s^3": (1.0, " rad/s^3"),
    "m/s": (1.0, " m/s"),
    "m/s^2": (1.0, " m/s^2"),
    "m/s^3": (1.0, " m/s^3"),
    "N m": (1.0, " N m"),
    "N": (1.0, " N"),
    "s": (1.0, " s"),
    "": (1.0, ""),
}
"""Factor and unit in which people read a value, by its SI unit; definition."""

AFTER = 1.5
"""Rows from which on an instant is told as after the last one [no unit]; derived: rounding is half a row."""
NAMED = 4
"""Steps of a run whose places are named, the last ones [no unit]; chosen: a line."""
MOVED_MIN, TURNED_MIN = 1e-4, 1e-3
"""Changes below are not worth a word [m, rad]; chosen: rounding."""


def quantity(value: float, unit: str) -> str:
    """A value in the unit in which people read it; from a metre on, metres."""
    if unit == "m" and abs(value) >= 1.0:
        return f"{value:.2f} m"
    factor, name = FOR_PEOPLE[unit]
    return f"{digits(factor * value, 3 if unit else 4)}{name}"


def digits(value: float, count: int) -> str:
    """A number rounded to so many digits, without an exponent."""
    text = f"{value:.{count}g}"
    return f"{float(text):.4f}".rstrip("0").rstrip(".") if "e" in text else text


def when(time: float | None, row: int | None, fps: float) -> str:
    """Row of an input with its time since row 0 [s], or how long after the last one that is; rows a second [Hz]."""
    if time is None or row is None or fps <= 0.0:
        return "" if time is None else f"{time:.2f} s" if row is None else f"row {row} ({time:.2f} s)"
    late = time - row / fps
    return f"{late:.1f} s after the last row ({row})" if late * fps > AFTER else f"row {row} ({row / fps:.2f} s)"


def at(time: float | None, row: int | None, fps: float) -> str:
    """Row and time as `when` says them, with their preposition behind a space; nothing where there is no time."""
    text = when(time, row, fps)
    return text and (f" {text}" if " after " in text else f" at {text}")


def due(row: int, fps: float) -> str:
    """Row of an input whose last one is held, with its time since row 0 [s]; rows a second [Hz]."""
    return when(row / fps if fps > 0.0 else None, row, fps)


def size_text(slower: float, moved: float, turned: float, lighter: float = 0.0, force: float = 0.0) -> str:
    """Text for a change: factor on its time, how far palms are led away [m], [rad], less load [kg], a force [N]."""
    parts = [f"{slower:.2f} times slower"] if slower > 1.0 else []
    parts += [f"with a hand moved by {quantity(moved, 'm')}"] if moved > MOVED_MIN else []
    parts += [f"with a hand turned by {quantity(turned, 'rad')}"] if turned > TURNED_MIN else []
    parts += [f"with {lighter:.2f} kg less in the hands"] if lighter else []
    parts += [f"with a hand pushing with {int(force)} N"] if force else []
    return " and ".join(parts) or "with its numbers in their range"


def stepped(steps: Sequence[StepMade]) -> str:
    """Number of steps, at least one, the last places, the largest slip and the heaviest landing."""
    places = ", ".join(f"{one.foot} ({one.x:.2f}, {one.y:.2f})" for one in steps[-NAMED:])
    named = f"the last {places}" if len(steps) > NAMED else places
    slip, load = max(one.slip for one in steps), max(one.load for one in steps)
    return f"{len(steps)}: {named}; a sole slid {1e3 * slip:.1f} mm at most, a landing pressed with {load:.0f} N"


def heated(motors: Sequence[MotorHeat]) -> str:
    """Motors with their mean torque, and how much that heats them beside a robot that stands."""
    return "; ".join(map(_heated, motors))


def _heated(one: MotorHeat) -> str:
    name = one.joint.removesuffix("_joint").replace("_", " ")
    beside = "" if one.of_stance is None else f", {digits(one.of_stance, 2)} times the heat of standing"
    return f"{name} {digits(one.torque_rms_nm, 2)} N m RMS, {one.share:.0%} of its most{beside}"
