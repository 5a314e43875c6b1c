"""What a verdict tells of the gate, and of the worlds that an input was tried in, as data."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class GateSummary:
    """What a gate made of an input, a chunk counted once, as it was judged last.

    Attributes:
        cleared, repaired, held: Chunks.
        late: Plans, or what the gate said of them, that came too late to be followed.
        reasons: Chunks that were not cleared as given, by the code of what is worst of them.
        slower_max: Largest factor by which one that was repaired is slower; 1 is unslowed.
        moved_max_m, turned_max_rad: Largest distance and angle by which a palm of one of these is led away [m], [rad].
        seconds_max: Longest CPU time that judging took, the plan left out [s].
    """

    cleared: int
    repaired: int
    held: int
    late: int
    reasons: dict[str, int]
    slower_max: float
    moved_max_m: float
    turned_max_rad: float
    seconds_max: float
