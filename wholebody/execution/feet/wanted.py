"""Where a robot is told to go, or how fast, as far as it can; and why not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wholebody.errors import InputError
from wholebody.execution import statuses
from wholebody.types import Reason, StatusReport
from wholebody.walking.places import Place, Velocity

FASTEST = (-0.25, 0.4, 0.2, 0.5)
"""Speeds back, ahead and aside [m/s] and about the vertical [rad/s] beyond which none is followed; measured: those at
which `python -m tests.studies.walks speeds` stands."""
FURTHEST = 10.0
"""Distance of a goal up to which the robot walks there [m]; chosen: by then an estimated state has drifted."""


def goal(base: Sequence[float], here: Place) -> Place | StatusReport:
    """A goal in world: x, y [m] and heading [rad], of a robot that is here; or why it is none.

    Raises:
        InputError: For what is no numbers.
    """
    expected = "finite x, y [m] and heading [rad] in world are expected"
    given = _numbers("base", base, expected)
    if given.shape != (3,) or not np.isfinite(given).all():
        return refused(f"base is {base}; {expected}")
    x, y, heading = given.tolist()
    place = Place(complex(x, y), heading)
    if (way := abs(place.point - here.point)) > FURTHEST:
        return refused(f"the base is {way:.1f} m away; the robot walks {FURTHEST:g} m at most")
    return place


def velocity(told: Sequence[float]) -> Velocity | StatusReport:
    """A velocity ahead, to the left [m/s] and about the vertical [rad/s], within `FASTEST`; or why it is none.

    Raises:
        InputError: For what is no numbers.
    """
    expected = "finite speeds ahead, left [m/s] and turning [rad/s] are expected"
    given = _numbers("velocity", told, expected)
    if given.shape != (3,) or not np.isfinite(given).all():
        return refused(f"velocity is {told}; {expected}")
    x, y, turn = given.tolist()
    share = float(shares_of_fastest(given))
    return Velocity(complex(x, y) / share, turn / share) if share > 1.0 else Velocity(complex(x, y), turn)


def shares_of_fastest(velocities: np.ndarray, fastest: tuple[float, float, float, float] = FASTEST) -> np.ndarray:
    """Shares of the fastest walk that velocities (..., 3) are, whose parts are the half axes of an ellipsoid, (...).

    Measured: with each part up to `FASTEST` by itself 3 of 3 tours fell within 30 s, when steps were planned 0.42 m
    apart; as parts of an ellipsoid and 0.3 m apart 12 of 12 stand (`python -m tests.studies.tour --only own`).
    """
    back, ahead, aside, fast = fastest
    x, y, turn = np.moveaxis(velocities, -1, 0)
    return np.linalg.norm([np.maximum(x / ahead, x / back), y / aside, turn / fast], axis=0)


def in_words(wanted: Place | Velocity, by_chunk: bool) -> str:
    """Where the robot walks, or how fast if its chunk says so."""
    if isinstance(wanted, Place):
        return f"to x {wanted.point.real:.2f} m, y {wanted.point.imag:.2f} m"
    if not by_chunk:
        return "as it is led"
    speed = f"({wanted.way.real:.2f}, {wanted.way.imag:.2f}) m/s, {wanted.turn:.2f} rad/s"
    return f"as its chunk says: {'to a stand' if wanted.is_rest else speed}"


def refused(detail: str) -> StatusReport:
    """No walk is begun or changed."""
    return statuses.refused(Reason.WALK_REFUSED, detail)


def _numbers(name: str, given: Sequence[float], expected: str) -> np.ndarray:
    """What was given as numbers."""
    try:
        return np.asarray(given, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{name} is {given!r:.80}; {expected}") from error
