"""Causes of a verdict, single changes that would do and what a tick says, as data."""

from __future__ import annotations

from dataclasses import dataclass, field

from policy.chunk import ActionChunk
from wholebody.planning.judgement.limits import Limit, Margin


@dataclass(frozen=True)
class WouldDo:
    """A single change that makes a chunk feasible, the smallest of its kind that was found.

    Attributes:
        kind: ``slower``, ``moved``, ``turned``, ``combined``: these as far as is needed, and numbers
            brought into their range, ``lighter``, ``softer``, ``start``: begun from its own first row,
            ``steps`` or ``bound``.
        slower: Factor on its time; 1 is unslowed.
        moved, turned: How far a palm is at most from where it was asked to be [m], [rad].
        lighter: Mass less in the hands, both together [kg].
        force: With which the hand that is named would have to be told to push at most [N].
        steps: How many to the ``base``, from where the chunk is feasible; 0 of any other kind.
        base: Midway between the soles x, y [m] and heading [rad] in world; empty of any other kind.
        bound: A bound of the robot, and the value that a plan with all others kept has instead; it need not be the
            least one.
        hand, step, by: Which hand is moved most, at which row of the input, and by what (3,), x forward, y left, z up
            [m].
        chunk: As changed, feasible; None for a bound, a load, a force and steps. Not part of the JSON.
    """

    kind: str
    slower: float = 1.0
    moved: float = 0.0
    turned: float = 0.0
    lighter: float = 0.0
    force: float = 0.0
    steps: int = 0
    base: tuple[float, ...] = ()
    bound: Margin | None = None
    hand: str = ""
    step: int | None = None
    by: tuple[float, ...] = ()
    chunk: ActionChunk | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, kw_only=True)
class Tick:
    """What the tick's program says at one instant.

    Attributes:
        proven: Whether it has no solution, which ``A``, ``lower``, ``upper`` and ``weights`` prove.
        time: Since the first row of the input [s]. step: The row.
        rows: Names of the rows that forbid or, where there is a solution, of those that limit the hands most.
        weights: Of each row: the Farkas vector, or the multipliers.
        A, lower, upper: Of a proof ``lower <= A x <= upper``, x the accelerations of base and joints, then the forces
            at the corners of the soles; infinite sides are None.
    """

    proven: bool
    time: float
    step: int
    rows: list[str]
    weights: list[float]
    A: list[list[float]]
    lower: list[float | None]
    upper: list[float | None]


@dataclass(frozen=True, kw_only=True)
class Why:
    """One cause of a verdict.

    Attributes:
        codes: Kinds of bounds that together forbid the chunk.
        members: Where each is met, at times since the first step of the input.
        time: When the hand of the sentence is there, likewise [s].
        irreducible: Whether no plan is found with them alone, and one without any one of them.
        sentence: The same for a person.
    """

    codes: tuple[Limit, ...]
    members: tuple[Margin, ...]
    time: float
    irreducible: bool
    sentence: str
