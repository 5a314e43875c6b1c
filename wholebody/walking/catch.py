"""Which foot catches a robot that was pushed, and how long its weight is shifted before: a pendulum for each choice.

A foot that is lifted at once leaves the capture point beside the other one, from which it runs away sideways; a shift
of weight before lets it run on ahead meanwhile. The choice with the shortest step that legs can do is made: the stance
that it ends in is left again by a shift of weight, which a long one does not allow.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import exp

from wholebody.walking.footsteps import LEFT, RIGHT, box
from wholebody.walking.gait import Gait
from wholebody.walking.places import Place
from wholebody.walking.pressure import Sole, on

SHIFTS = (0.02, 0.08, 0.16, 0.24)
"""Times for which the weight is shifted that are tried [s]; chosen: beyond, the capture point has run away."""
HARD = 10.0
"""How many times its distance from the sole's middle the zero-moment point is put beyond the capture point [no unit];
chosen: at the edge of the sole."""
ASIDE = 0.2
"""Share of the distance of the soles by which it lands beside the capture point [no unit]; chosen: as walks do."""
BEYOND = 4.0
"""How many times its length counts what of a step lies beyond what legs can do [no unit]; chosen."""
INSIDE = 0.04
"""Distance of a step beyond what legs can do up to which it is made [m]; chosen: an adjusted time makes up for it."""
WORSE = 0.02
"""How much further from the middle of the soles the capture point is taken to be [m]; measured: pushed by 15 N s at 135
degrees it got on so much less in a shift of the weight than a pendulum does, since its trunk leans."""
RECOVERY = {
    "swing": 0.36, "double": 0.1, "ahead": 0.5, "wide": 0.4, "sooner": 0.75, "later": 1.2, "height": 0.64, "lift": 0.05,
}  # fmt: skip
"""What the gait of a step has that catches the robot [units as in `Gait`]; chosen: two thirds of the time of a walk,
and the centre of mass lower, since a long step stretches the leg behind."""


@dataclass(frozen=True, slots=True)
class Catch:
    """A step that catches the robot.

    Attributes:
        foot: That is moved.
        gait: Times and lengths, the time of the shift among them.
        beyond: How far it lies beyond what legs can do [m]; 0 where it does not.
        length: From where the foot stands [m].
    """

    foot: int
    gait: Gait
    beyond: float
    length: float


def choose(dcm: complex, omega: float, soles: tuple[Place, Place], size: Sole, gait: Gait) -> Catch | None:
    """The step that catches a robot best; None where none does.

    Args:
        dcm: Its capture point in world [m].
        omega: Of its pendulum [1/s].
        soles: Where both stand, left first.
        size: What is pressed on of each.
        gait: Of its walk.
    """
    away = dcm - soles[LEFT].between(soles[RIGHT]).point
    dcm += WORSE * away / max(abs(away), WORSE)
    found = [_tried(dcm, omega, soles, size, gait, foot, shift) for foot in (LEFT, RIGHT) for shift in SHIFTS]
    best = min(found, key=lambda one: BEYOND * one.beyond + one.length)
    return best if best.beyond <= INSIDE else None


def _tried(
    dcm: complex, omega: float, soles: tuple[Place, Place], size: Sole, gait: Gait, foot: int, shift: float
) -> Catch:
    """A step of a foot after a shift of the weight [s], by the pendulum."""
    made = replace(gait, shift=shift, **RECOVERY)
    stance, swings = soles[1 - foot], soles[foot]
    for sole, time in ((swings, shift), (stance, made.swing)):
        pressure = on(sole, size, dcm + HARD * (dcm - stance.point))
        dcm = pressure + exp(omega * time) * (dcm - pressure)
    low, high = box(foot, made, made.wide)
    # It lands so that the capture point is over it, and a little towards the other sole.
    beside = stance.seen(swings.point).imag
    seen = stance.seen(dcm)
    place = complex(seen.real, seen.imag + ASIDE * beside)
    x = max(low.real - place.real, place.real - high.real, 0.0)
    # Set down further out than it need be, the other sole is beside the capture point, which is between both then.
    out = 1.0 if foot == LEFT else -1.0
    y = max(out * place.imag - made.wide, -out * seen.imag - size.width, 0.0)
    made_at = complex(min(max(place.real, low.real), high.real), min(max(place.imag, low.imag), high.imag))
    return Catch(foot, made, x + y, abs(made_at - stance.seen(swings.point)))
