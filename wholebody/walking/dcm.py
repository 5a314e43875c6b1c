r"""Plan of the divergent component of motion (DCM, the capture point) through soles that carry one after the other.

The centre of mass ``c`` at a constant height is a pendulum ``ddc = omega^2 (c - p)`` on the zero-moment point ``p``.
Its divergent part ``xi = c + dc / omega`` runs away from it, ``dxi = omega (xi - p)``: of all motions through a given
``p(t)`` one stays bounded, and that is found from the end backwards. While a sole carries alone, ``p`` is at its
middle; while both do, it goes from one to the other at a constant speed. On such a piece of duration T, with
``p = p_0 + s t``:

    xi(0) = p_0 + s / omega + exp(-omega T) (xi(T) - p_1 - s / omega)

Source:
    Englsberger, Ott and Albu-Schaeffer 2015, "Three-Dimensional Bipedal Walking Control Based on Divergent Component of
    Motion", T-RO 31(2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp

SHORTEST = 1e-6
"""Duration below which a piece is over [s]; derived: far below a control period."""


@dataclass(frozen=True, slots=True)
class Piece:
    """A stretch of time in which the zero-moment point moves at a constant speed.

    Attributes:
        duration: [s]
        start, end: Where it is at the beginning and at the end, ``x + iy`` in world [m].
    """

    duration: float
    start: complex
    end: complex

    def before(self, last: complex, omega: float) -> complex:
        """DCM at the beginning of the piece that has ``last`` at its end [m], for a pendulum of ``omega`` [1/s]."""
        if self.duration < SHORTEST:
            return last
        lead = (self.end - self.start) / self.duration / omega
        return self.start + lead + exp(-omega * self.duration) * (last - self.end - lead)

    def after(self, first: complex, omega: float, time: float | None = None) -> complex:
        """DCM at a time of the piece, its end if not given, that has ``first`` at its beginning [m]."""
        time = self.duration if time is None else time
        speed = 0.0 if self.duration < SHORTEST else (self.end - self.start) / self.duration
        lead = speed / omega
        return self.start + speed * time + lead + exp(omega * time) * (first - self.start - lead)

    def left(self, time: float) -> Piece:
        """What of it is left after a time [s]."""
        share = min(time / self.duration, 1.0) if self.duration > 0.0 else 1.0
        return Piece(max(self.duration - time, 0.0), self.start + share * (self.end - self.start), self.end)


def bounded(pieces: Sequence[Piece], omega: float) -> complex:
    """DCM at the beginning of pieces, from which it comes to rest over the end of the last one [m]."""
    dcm = pieces[-1].end
    for piece in reversed(pieces):
        dcm = piece.before(dcm, omega)
    return dcm


def start_for(first: complex, piece: Piece, last: complex, omega: float) -> complex:
    """Where the zero-moment point of a piece has to start to lead the DCM from ``first`` to ``last`` [m].

    The dead-beat of a shift of weight: the first moment of a shift pushes away from the foot that is to carry.
    """
    gone = exp(-omega * piece.duration)
    share = (1.0 - gone) / (omega * piece.duration)
    return (first - share * piece.end - gone * (last - piece.end)) / (1.0 - share)
