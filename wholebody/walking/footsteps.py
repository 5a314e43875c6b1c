"""Where the next steps go: on both sides of a base that moves, within what legs can do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from wholebody.walking.gait import Gait
from wholebody.walking.guide import Guide
from wholebody.walking.places import Place

LEFT, RIGHT = 0, 1
"""Numbers of the feet."""
CLOSED = (0.03, 0.06)
"""Distance [m] and angle [rad] from its place beside the base within which a foot need not be moved; by trial: steps of
a realistic robot miss their places by 1 to 2 cm, and it would step for ever with 1. A plan takes the feet as they
stand."""


@dataclass(frozen=True, slots=True)
class Footstep:
    """A foot and where it is set down."""

    foot: int
    sole: Place


def beside(base: Place, foot: int, width: float) -> Place:
    """Sole of a foot that stands beside a base, both soles ``width`` apart [m]."""
    return base.to(0.5j * width if foot == LEFT else -0.5j * width)


def base_of(soles: Sequence[Place]) -> Place:
    """Base midway between two soles, left first."""
    return soles[LEFT].between(soles[RIGHT])


def box(foot: int, gait: Gait, wide: float) -> tuple[complex, complex]:
    """Corners of where a foot may be set down in the axes of the other sole, at most ``wide`` aside [m]."""
    if foot == LEFT:
        return complex(-gait.ahead, gait.narrow), complex(gait.ahead, wide)
    return complex(-gait.ahead, -wide), complex(gait.ahead, -gait.narrow)


def within(stance: Place, foot: int, wanted: Place, gait: Gait) -> Place:
    """The place for a foot nearest to the one wanted that legs can do from a stance sole."""
    low, high = box(foot, gait, gait.apart)
    seen, turn = stance.seen(wanted.point), stance.turn_to(wanted)
    least, most = (-gait.inward, gait.outward) if foot == LEFT else (-gait.outward, gait.inward)
    point = complex(min(max(seen.real, low.real), high.real), min(max(seen.imag, low.imag), high.imag))
    return stance.to(point, min(max(turn, least), most))


def footsteps(
    soles: Sequence[Place], first: int, guide: Guide, width: float, gait: Gait, *, start: float, least: int, most: int
) -> list[Footstep]:
    """The next steps beside a base.

    A foot is half a step ahead of the base when both carry, so that the base is midway between the soles then.

    Args:
        soles: Where both are, left first.
        first: The foot that steps first.
        guide: The base.
        width: Distance of the soles beside it [m].
        gait: Times and lengths.
        start: Time until the first step carries [s].
        least: How many at least; after them none is made once both feet stand beside a base at rest.
        most: How many at most.
    """
    there, steps = list(soles), []
    times = [start + 0.5 * gait.double + 0.5 * gait.step + k * gait.step for k in range(most)]
    for k, (base, rests) in enumerate(guide.foresee(times)):
        foot = first if k % 2 == 0 else 1 - first
        there[foot] = within(there[1 - foot], foot, beside(base, foot, width), gait)
        steps.append(Footstep(foot, there[foot]))
        if k + 1 >= least and rests and closed(there, base, width):
            break
    return steps


def closed(soles: Sequence[Place], base: Place, width: float) -> bool:
    """Whether both feet stand beside a base already."""
    return all(_near(sole, beside(base, foot, width)) for foot, sole in enumerate(soles))


def _near(sole: Place, wanted: Place) -> bool:
    return abs(sole.point - wanted.point) <= CLOSED[0] and abs(sole.turn_to(wanted)) <= CLOSED[1]
