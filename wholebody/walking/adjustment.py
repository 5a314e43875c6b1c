r"""Place and time of the step that is being made, from where the capture point is now: five numbers at every tick.

The stance sole carries alone for a time ``t`` more, then both soles do for ``T``, in which the zero-moment point goes
from the stance point ``p`` to the new one ``u``; the DCM is then at ``u + b``, and the next step goes on from there. A
foot that is moved fast throws the body by its reaction, and with it the DCM, by ``e + g (u - p)`` until it lands
(`wholebody.walking.landings`). With ``tau = exp(omega t)``:

    (xi - p) tau + e + g (u - p) = share (u - p) + exp(-omega T) b,      share = (1 - exp(-omega T)) / (omega T)

which for ``T = 0`` and a foot without mass is Khadiv's ``xi_end = u + b``. The cost is
``w_u |u - u_0|^2 + w_t (tau / tau_0 - 1)^2 + w_b |b - b_0|^2``. How far a foot comes depends on when it lands, so each
of some times is tried with the box of places that it reaches by then, in the axes of the stance sole: without ``b``,
each axis has its place in closed form.

Source:
    Khadiv, Herzog, Moosavian and Righetti 2020, "Walking Control Based on Step Timing Adaptation", T-RO 36(3),
    arXiv 1704.01271; double support, the reaction, and a box for each time, are added here.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import exp, inf

PLACE, TIME, OFFSET = 1.0, 0.05, 1000.0
"""Weights of place [1/m^2], time [no unit] and DCM offset [1/m^2]; place and offset as Khadiv's, time chosen: a tenth
of the time costs as much as 2 cm of the place."""
NOTHING = 1e-12
"""Cost below which a step is as planned [no unit]; derived: its place is within a micrometre."""


@dataclass(frozen=True, slots=True)
class Step:
    """A step as planned, or as it is to be made.

    Attributes:
        place: Of its sole, from the stance point in the axes of the stance sole, ``x + iy`` [m].
        time: Until it carries [s].
        offset: DCM at the end of the double support that follows, from that place, likewise [m].
    """

    place: complex
    time: float
    offset: complex


@dataclass(frozen=True, slots=True)
class Landing:
    """Time at which a step may end, where it may then, and what getting there does.

    Attributes:
        time: Until it carries [s].
        low, high: Corners of the box of places, from the stance point in the axes of the stance sole [m].
        thrown: How far the reaction of the foot moves the DCM if it lands at the stance point, likewise [m].
        gain: How much further for each metre to its place [no unit].
    """

    time: float
    low: complex
    high: complex
    thrown: complex = 0j
    gain: float = 0.0


def adjust(dcm: complex, planned: Step, landings: Iterable[Landing], omega: float, double: float) -> Step:
    """The step that leads on best from where the capture point is.

    Args:
        dcm: The capture point, from the stance point in the axes of the stance sole [m].
        planned: What the step would be if nothing had happened.
        landings: When and where it may end, one at least; one as planned ends the search.
        omega: Of the pendulum [1/s].
        double: Duration of the double support that follows [s].
    """
    gone = exp(-omega * double)
    share = (1.0 - gone) / (omega * double) if double > 0.0 else 1.0
    place, offset, tau_0 = planned.place, planned.offset, exp(omega * planned.time)
    best, least = planned, inf
    for landing in landings:
        tau, low, high = exp(omega * landing.time), landing.low, landing.high
        there, rate = (dcm * tau + landing.thrown) / gone, (share - landing.gain) / gone
        asked = OFFSET * rate * rate / (PLACE + OFFSET * rate * rate)
        free = place + asked * ((there - offset) / rate - place)
        point = complex(min(max(free.real, low.real), high.real), min(max(free.imag, low.imag), high.imag))
        left = there - rate * point
        cost = PLACE * abs(point - place) ** 2 + TIME * (tau / tau_0 - 1.0) ** 2 + OFFSET * abs(left - offset) ** 2
        if cost < least:
            best, least = Step(point, landing.time, left), cost
        if cost < NOTHING:
            break
    return best
