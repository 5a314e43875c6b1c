r"""Place and time of the step that is being made, from where the capture point is now: five numbers at every tick.

The stance sole carries alone for a time ``t`` more, then both soles do for ``T``, in which the zero-moment point goes
from the stance point ``p`` to the new one ``u``; the DCM is then at ``u + b``, and the next step goes on from there.
With ``tau = exp(omega t)`` in place of the time this is linear in all that can be chosen, ``u`` (2), ``tau`` and ``b``
(2):

    (xi - p) tau = share (u - p) + exp(-omega T) b,      share = (1 - exp(-omega T)) / (omega T)

which for ``T = 0`` is Khadiv's ``xi_end = u + b``. The cost is
``w_u |u - u_0|^2 + w_t (tau / tau_0 - 1)^2 + w_b |b - b_0|^2``; ``u`` stays in a box in the axes of the stance sole,
``tau`` between bounds. Without ``b`` two numbers for each axis are left; for a given ``tau`` each axis has its answer
in closed form, and the derivative of the cost by ``tau`` is a line between the times at which a place comes to its
bound: the root on it is exact.

Source:
    Khadiv, Herzog, Moosavian and Righetti 2020, "Walking Control Based on Step Timing Adaptation", T-RO 36(3),
    arXiv 1704.01271; double support is added here.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log

PLACE, TIME, OFFSET = 1.0, 0.05, 1000.0
"""Weights of place [1/m^2], time [no unit] and DCM offset [1/m^2]; place and offset as Khadiv's, time chosen: a tenth
of the time costs as much as 2 cm of the place."""


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
class Room:
    """Where and when a step may end.

    Attributes:
        low, high: Corners of the box of places, from the stance point in the axes of the stance sole [m].
        soonest, latest: Time until it carries [s].
    """

    low: complex
    high: complex
    soonest: float
    latest: float


def adjust(dcm: complex, planned: Step, room: Room, omega: float, double: float) -> Step:
    """The step that leads on from where the capture point is.

    Args:
        dcm: The capture point, from the stance point in the axes of the stance sole [m].
        planned: What the step would be if nothing had happened.
        room: Where and when it may end.
        omega: Of the pendulum [1/s].
        double: Duration of the double support that follows [s].
    """
    gone = exp(-omega * double)
    share = (1.0 - gone) / (omega * double) if double > 0.0 else 1.0
    tau_0, low, high = (exp(omega * time) for time in (planned.time, room.soonest, room.latest))
    axes = [
        _Axis(x, u_0, b_0, *bounds, share, gone)
        for x, u_0, b_0, bounds in (
            (dcm.real, planned.place.real, planned.offset.real, (room.low.real, room.high.real)),
            (dcm.imag, planned.place.imag, planned.offset.imag, (room.low.imag, room.high.imag)),
        )
    ]

    def slope(tau: float) -> float:
        return TIME * (tau / tau_0 - 1.0) / tau_0 + sum(axis.slope(tau) for axis in axes)

    turns = sorted(min(max(tau, low), high) for axis in axes for tau in axis.turns())
    tau = _root(slope, [low, *turns, high])
    return Step(
        complex(*(axis.place(tau) for axis in axes)), log(tau) / omega, complex(*(axis.offset(tau) for axis in axes))
    )


def _root(slope, points: list[float]) -> float:
    """Where a rising function that is straight between points is zero; the end next to it where it is nowhere."""
    left, value = points[0], slope(points[0])
    if value >= 0.0:
        return left
    for right in points[1:]:
        following = slope(right)
        if following >= 0.0:
            return left if following == value else left - value * (right - left) / (following - value)
        left, value = right, following
    return left


class _Axis:
    """One axis of the program: the place that is best for a given ``tau``, and what a change of it would cost."""

    __slots__ = ("b_0", "constant", "gain", "gone", "high", "low", "share", "x")

    def __init__(self, x: float, u_0: float, b_0: float, low: float, high: float, share: float, gone: float) -> None:
        self.x, self.b_0, self.low, self.high, self.share, self.gone = x, b_0, low, high, share, gone
        ratio = share / gone
        weight = PLACE + OFFSET * ratio * ratio
        self.constant, self.gain = (PLACE * u_0 - OFFSET * ratio * b_0) / weight, OFFSET * ratio * x / gone / weight

    def turns(self) -> tuple[float, ...]:
        """Values of ``tau`` at which the place comes to a bound."""
        if self.gain == 0.0:
            return ()
        return (self.low - self.constant) / self.gain, (self.high - self.constant) / self.gain

    def place(self, tau: float) -> float:
        return min(max(self.constant + self.gain * tau, self.low), self.high)

    def offset(self, tau: float) -> float:
        return (self.x * tau - self.share * self.place(tau)) / self.gone

    def slope(self, tau: float) -> float:
        return OFFSET * (self.offset(tau) - self.b_0) * self.x / self.gone
