"""What the loop shows of an instant, and what a person at the page wants: messages of numbers."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from wholebody.live import wire
from wholebody.sim.recorder import Followed
from wholebody.types import Reason, RobotState, Status, StatusReport

STATUSES, REASONS = tuple(Status), tuple(Reason)
"""Statuses and reasons in the order of their numbers on the wire; a reason's number 0 is none."""
HANDS = "hands"
"""Name of the source that a person drags."""


class UserCommand(IntEnum):
    """What a person wants, with the numbers that come with it."""

    TARGETS = 0
    """Palm poses, 2 x 16."""
    PUSH = 1
    """Force x, y, z [N], duration [s]."""
    PAYLOAD = 2
    """Left and right mass [kg]."""
    FRICTION = 3
    """Coefficient."""
    LATENCY = 4
    """Latency of the policy [s]."""
    SOURCE = 5
    """Which of the sources."""
    PAUSE = 6
    """1 to pause, 0 to go on."""
    RESET = 7
    CLOSING = 8
    """How far the left and the right hand are closed: 0 open to 1 closed."""
    WALK = 9
    """Where to go from where the robot stands: ahead and to the left [m], and turned by [rad]; zeros: stay."""


@dataclass(frozen=True)
class Snapshot:
    """What the loop shows of an instant.

    Attributes:
        state: Measured.
        followed: What the supervisor follows; of its status only code and reason get to the page.
        planned: Configuration at the end of the present plan (nq,); NaN without one.
        tick: Time that the last tick took [s].
        missed, late: Ticks and plans.
        source: Which of the sources runs.
    """

    state: RobotState
    followed: Followed
    planned: np.ndarray
    tick: float
    missed: int
    late: int
    source: int

    def message(self) -> tuple[np.ndarray | float, ...]:
        """Parts of the message."""
        followed, status = self.followed, self.followed.status
        reason = 0 if not status.reason else 1 + REASONS.index(status.reason)
        asked = np.full((2, 4, 4), np.nan) if followed.asked is None else followed.asked
        numbers = (STATUSES.index(status.status), reason, followed.rate, followed.planning_time)
        counts = (self.tick, self.missed, self.late, self.source)
        return asked, followed.commanded, self.planned, numbers, counts, *wire.state_message(self.state)

    @classmethod
    def of(cls, message: np.ndarray, nq: int, nv: int) -> Snapshot:
        """Snapshot in a message."""
        asked, commanded, planned, numbers, state = np.split(message, np.cumsum([32, 32, nq, 8]))
        status, reason, rate, planning, tick, missed, late, source = numbers.tolist()
        followed = Followed(
            asked=asked.reshape(2, 4, 4) if np.isfinite(asked).all() else None,
            commanded=commanded.reshape(2, 4, 4),
            status=StatusReport(STATUSES[int(status)], REASONS[int(reason) - 1] if reason else None),
            rate=rate,
            planning_time=planning,
        )
        return cls(wire.state_of(state, nq, nv), followed, planned, tick, int(missed), int(late), int(source))
