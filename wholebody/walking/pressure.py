"""Where the zero-moment point can be: on one sole, or between both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from wholebody.walking.places import Place


@dataclass(frozen=True, slots=True)
class Sole:
    """The part of a sole that is pressed on, about its middle.

    Attributes:
        length: Half of its length [m].
        width: Half of its width [m].
    """

    length: float
    width: float


def on(sole: Place, size: Sole, point: complex) -> complex:
    """The point of a sole that is nearest to one in world [m]."""
    seen = sole.seen(point)
    return sole.world(complex(_within(seen.real, size.length), _within(seen.imag, size.width)))


def between(soles: Sequence[Place], size: Sole, point: complex) -> complex:
    """A point of the hull of both soles near one in world [m]: on a sole as far along the line between both."""
    left, right = soles
    way = right.point - left.point
    length = abs(way) ** 2
    share = ((point - left.point) * way.conjugate()).real / length if length > 0.0 else 0.5
    return on(left.between(right, min(max(share, 0.0), 1.0)), size, point)


def _within(x: float, most: float) -> float:
    return min(max(x, -most), most)
