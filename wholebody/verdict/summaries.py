"""What a verdict tells of the gate, and of the worlds that an input was tried in, as data."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class GateSummary:
    """What a gate made of an input, a chunk counted once, as it was judged last.

    Attributes:
        cleared, repaired, rejected: Chunks.
        late: Plans, or what the gate said of them, that came too late to be followed.
        reasons: Chunks that were not cleared as given, by the code of what is worst of them.
        slower_max: Largest factor by which one that was repaired is slower; 1 is unslowed.
        moved_max_m, turned_max_rad: Largest distance and angle by which a palm of one of these is led away [m], [rad].
        seconds_max: Longest CPU time that judging took, the plan left out [s].
    """

    cleared: int
    repaired: int
    rejected: int
    late: int
    reasons: dict[str, int]
    slower_max: float
    moved_max_m: float
    turned_max_rad: float
    seconds_max: float


@dataclass(frozen=True, kw_only=True)
class Worlds:
    """What became of an input in realistic worlds: robots with errors, drawn from seeds, as with ``--realistic``.

    Attributes:
        seeds: Of each world.
        verdicts: Of each world, in words.
        fell: Seeds with which the robot fell.
        held: In how many worlds it held: feasible, or after repair.
        share: The same as a share.
        low, high: Shares between which that of all such worlds lies, by Clopper and Pearson.
        level: Confidence of that.
        max_m: Largest palm error in any of them [m].
    """

    seeds: tuple[int, ...]
    verdicts: tuple[str, ...]
    fell: tuple[int, ...]
    held: int
    share: float
    low: float
    high: float
    level: float
    max_m: float
