"""States of a gait as a table, and the numbers that it has."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Phase(Enum):
    """States of a gait."""

    STAND = "stand"
    """Both feet stay: plans are followed as ever."""
    SHIFT = "shift"
    """The weight goes over the foot that is to carry."""
    SWING = "swing"
    """One foot carries, the other one swings; place and time of its landing are adjusted."""
    LAND = "land"
    """Both carry: the weight goes on from the old foot to the new one."""
    SETTLE = "settle"
    """The weight goes between both feet, which stay."""
    RECOVER = "recover"
    """Both feet stay, apart, after a step that caught the robot, until it has come to rest."""


@dataclass(frozen=True, slots=True)
class PhaseRow:
    """A row of the table.

    Attributes:
        both: Whether both feet carry.
        lasts: Name of its duration in `Gait`; empty for one that nothing but a command ends.
        then: What follows while there are steps to make.
        done: What follows where there are none.
        rests: Whether it lasts, beyond its duration, until the capture point is at rest.
    """

    both: bool
    lasts: str
    then: Phase
    done: Phase
    rests: bool = False


TABLE: dict[Phase, PhaseRow] = {
    Phase.STAND: PhaseRow(True, "", then=Phase.SHIFT, done=Phase.STAND),
    Phase.SHIFT: PhaseRow(True, "shift", then=Phase.SWING, done=Phase.SETTLE),
    Phase.SWING: PhaseRow(False, "swing", then=Phase.LAND, done=Phase.SETTLE),
    Phase.LAND: PhaseRow(True, "double", then=Phase.SWING, done=Phase.SWING),
    Phase.SETTLE: PhaseRow(True, "settle", then=Phase.SHIFT, done=Phase.STAND, rests=True),
    Phase.RECOVER: PhaseRow(True, "pause", then=Phase.SHIFT, done=Phase.SETTLE, rests=True),
}
"""What follows what. A swing whose step is the last one ends in `Phase.SETTLE`, or in `Phase.RECOVER` if it caught the
robot."""


@dataclass(frozen=True, kw_only=True)
class Gait:
    """Times and lengths of a gait."""

    swing: float = 0.55
    """Time for which one foot carries [s]."""
    double: float = 0.15
    """Time for which both do between two swings [s]."""
    shift: float = 0.6
    """Time in which the weight goes over the first foot [s]."""
    settle: float = 0.6
    """Time in which it goes between both again, at least [s]."""
    pause: float = 0.7
    """Time for which the feet stay after a step that caught the robot, at least [s]."""
    lift: float = 0.04
    """Height of the sole in the middle of a swing [m]; measured: with 0.05 one of 3 realistic robots fell at 0.4 m/s,
    and none of 6 with this."""
    height: float = 0.66
    """Height of the centre of mass over the soles [m]."""
    ahead: float = 0.4
    """Largest step ahead or back, from the stance foot [m]."""
    narrow: float = 0.15
    """Least distance of the soles to the side [m]."""
    wide: float = 0.42
    """Largest distance of the soles to the side [m]."""
    apart: float = 0.3
    """The same that is planned [m]; measured: the ankle of a foot that is left further aside comes to its end while the
    weight goes off it, and tilts the trunk: by 2 degrees from 0.32 m, 10 from 0.39."""
    inward: float = 0.25
    """Largest turn of a sole towards the other one [rad]."""
    outward: float = 0.45
    """Largest turn of a sole away from the other one [rad]."""
    sooner: float = 0.5
    """Share of the swing's time that it lasts at least; measured: with 0.65 a push of 10 N s aside was a fall."""
    later: float = 1.3
    """The same at most."""

    @property
    def step(self) -> float:
        """Time from one step to the next [s]."""
        return self.swing + self.double
