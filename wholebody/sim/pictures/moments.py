"""Which instants of a run a sheet shows, and why: chosen where something happens, not evenly."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wholebody.sim.pictures.scene import SIDES
from wholebody.sim.record import Record
from wholebody.types import Status

MOMENTS_APART = 0.25
"""Time between instants, below which the more important one is shown, with what is to be said of the other [s]."""
BRIEF = 0.1
"""A status that lasts less is left out, unless balance is at stake [s]."""
WAY_SPACING, STANDING = 0.1, 0.001
"""How often the way of the palms is measured [s], and what standing still counts as [m/s]."""
ERROR_SEEN, MARGIN_SEEN = 0.001, 0.01
"""Error, and margin less than it is most of the time, that are worth a frame [m]."""
GRAVE = (Status.STOP.value, Status.DAMPING.value)


@dataclass(frozen=True)
class Moment:
    """An instant worth a picture.

    Attributes:
        row: Its control period.
        why: What is to be seen.
        begins: Whether that begins here, and lasts.
    """

    row: int
    why: str
    begins: bool = False

    def text(self) -> str:
        """Why, at the instant itself."""
        return f"{self.why} begins" if self.begins else self.why


def moments(record: Record, count: int) -> list[Moment]:
    """Instants of a recording in the order of time, at most so many.

    In the order of importance: the end, the largest palm error, the smallest balance margin, changes of the status, the
    new and the worst first; what is left over shows the motion, half-way where the palms go furthest between two.

    Args:
        record: With `wholebody.sim.pictures.scene.SCENE_COLUMNS` at least.
        count: How many are wanted.
    """
    time, chosen = record["time"], {}
    for moment in (*_extremes(record), *_changes(record)):
        near = [row for row in chosen if abs(time[row] - time[moment.row]) < MOMENTS_APART]
        if near:
            row = min(near, key=lambda row: abs(row - moment.row))
            if moment.begins and not _lasts(record, moment.row, row):
                continue  # a picture says only what is so in it
            when = f"{'since' if moment.begins else 'at'} {time[moment.row]:.2f} s"
            chosen[row].append(moment.text() if row == moment.row else f"{moment.why} {when}")
        elif len(chosen) < count:
            chosen[moment.row] = [moment.text()]
    way = _way(record)
    while len(chosen) < min(count, len(record)):
        chosen[_between(way, sorted(chosen))] = ["on the way"]
    return [Moment(row, "; ".join(chosen[row])) for row in sorted(chosen)]


def _extremes(record: Record) -> list[Moment]:
    """The end, the largest error and the smallest margin."""
    found = [Moment(len(record) - 1, "end")]
    errors = np.nan_to_num(record.palm_errors())
    row, hand = np.unravel_index(errors.argmax(), errors.shape)
    if errors[row, hand] >= ERROR_SEEN:
        found.append(Moment(int(row), f"largest error: {SIDES[hand]} palm {1e3 * errors[row, hand]:.0f} mm"))
    margins = np.nan_to_num(record["pressure_margin"], nan=np.inf)
    margins[0] = np.inf  # before the first step no motor has given anything yet
    row = int(margins.argmin())
    if margins[row] < np.median(margins) - MARGIN_SEEN:
        found.append(Moment(row, f"smallest balance margin: {1e3 * margins[row]:.0f} mm"))
    return found


def _changes(record: Record) -> list[Moment]:
    """Where a status or its reason begins: each for the first time, the worst status first, and then the others."""
    time, status, reason = record["time"], record["status"], record["reason"]
    begins = [0, *(np.flatnonzero((status[1:] != status[:-1]) | (reason[1:] != reason[:-1])) + 1)]
    rank = {member.value: number for number, member in enumerate(reversed(Status))}
    found, known = [], set()
    for begin, end in zip(begins, [*begins[1:], len(record) - 1], strict=True):
        if time[end] - time[begin] < BRIEF and status[begin] not in GRAVE:
            continue
        why = f"{status[begin]} ({reason[begin]})" if reason[begin] else str(status[begin])
        found.append((why in known, rank[str(status[begin])], begin, why))
        known.add(why)
    return [Moment(int(begin), why, begins=True) for _, _, begin, why in sorted(found)]


def _lasts(record: Record, first: int, last: int) -> bool:
    """Whether status and reason stay as they are from one row to a later one."""
    return last >= first and all(len(set(record[name][first : last + 1])) == 1 for name in ("status", "reason"))


def _way(record: Record) -> np.ndarray:
    """How far both palms have come, shape (n,), [m]; increases while they stand, too, but little."""
    time, palms = record["time"], record["T_world_palms_measured"][:, :, :3, 3]
    rows = np.unique([*np.searchsorted(time, np.arange(time[0], time[-1], WAY_SPACING)), len(time) - 1])
    steps = np.linalg.norm(np.diff(palms[rows], axis=0), axis=2).sum(axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    return np.interp(time, time[rows], way) + STANDING * (time - time[0])


def _between(way: np.ndarray, rows: list[int]) -> int:
    """The row half-way on the longest way without a chosen one."""
    last = len(way) - 1
    gaps = [(a, b) for a, b in pairwise([-1, *rows, last + 1]) if b - a > 1]
    a, b = max(gaps, key=lambda gap: way[min(gap[1], last)] - way[max(gap[0], 0)])
    middle = int(np.searchsorted(way, 0.5 * (way[max(a, 0)] + way[min(b, last)])))
    return min(max(middle, a + 1), b - 1)
