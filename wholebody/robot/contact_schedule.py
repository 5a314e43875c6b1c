"""Which feet stand where, and from when on: what plan, reference, program, estimator and judge read."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from math import isfinite

from wholebody.errors import InputError
from wholebody.robot.feet import Feet


@dataclass(frozen=True)
class Contacts:
    """Contacts of both feet with the floor for a while.

    Attributes:
        feet: Where both feet are; a foot that is up, where it was or will be set down.
        load: Share of the bounds on its normal force that each foot has, left first, 0 to 1 [no unit]. A foot with 0
            is up: it carries nothing and may move. Shares between relieve a foot before it is lifted.

    Raises:
        InputError: If a share is not between 0 and 1, or no foot stands.
    """

    feet: Feet
    load: tuple[float, float] = (1.0, 1.0)

    def __post_init__(self) -> None:
        if not all(0.0 <= share <= 1.0 for share in self.load) or not any(self.load):
            raise InputError(f"load is {self.load}; one share of 0 to 1 a foot, not all of them 0, is expected")

    @property
    def stands(self) -> tuple[bool, bool]:
        """Whether each foot stands, left first."""
        left, right = self.load
        return left > 0.0, right > 0.0

    def same(self, other: Contacts) -> bool:
        """Whether others are the same to the bit."""
        return self.load == other.load and self.feet.same(other.feet)


@dataclass(frozen=True)
class ContactSchedule:
    """Contacts that follow each other.

    Attributes:
        contacts: In the order of time, at least one.
        times: When the second and each later one begins, rising, one fewer than ``contacts`` [s].

    Raises:
        InputError: If their numbers do not fit, or the times do not rise.

    Source:
        The event times and modes of ocs2's `ModeSchedule`.
    """

    contacts: tuple[Contacts, ...]
    times: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        rising = all(a < b for a, b in zip(self.times, self.times[1:], strict=False))
        if len(self.contacts) != len(self.times) + 1 or not rising or not all(map(isfinite, self.times)):
            raise InputError(
                f"{len(self.contacts)} contacts with times {self.times}; each but the first needs the finite time at "
                "which it begins, and these must rise"
            )

    @classmethod
    def standing(cls, feet: Feet) -> ContactSchedule:
        """Both feet stand there for ever."""
        return cls((Contacts(feet),))

    def at(self, time: float) -> Contacts:
        """Contacts at a time [s]."""
        return self.contacts[bisect_right(self.times, time)]

    def feet(self) -> Feet:
        """Where both feet stand for ever; `InputError` for a schedule in which one is lifted or set down."""
        if self.times or not all(self.contacts[0].stands):
            raise InputError(
                "a plan is asked for on feet that step; both must stand from its beginning to its end: ask for it once "
                "they do"
            )
        return self.contacts[0].feet

    def same(self, other: ContactSchedule) -> bool:
        """Whether another one is the same to the bit."""
        alike = zip(self.contacts, other.contacts, strict=False)
        return self.times == other.times and all(a.same(b) for a, b in alike)
