"""Last stage of the reference: whatever it is asked to follow, what it commands is C2 and inside the limits.

It runs every control tick behind path and clock. A target that is inside the limits is reproduced with no lag; one that
jumps, turns by 180 degrees or is not finite is rejoined by a minimum-jerk move. The step and its sources are in
`wholebody.reference.kernels.smoother`; here is what it starts from.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wholebody.errors import InputError
from wholebody.reference.hand_limits import HandLimits
from wholebody.reference.kernels.smoother_memory import HAND
from wholebody.reference.layout import ALPHA, DDQ_FINGER, Q_FINGER, QUAT, ROW, A, HandMotion, P


class ReferenceSmoother:
    """Third-order tracking filter of one or more hands.

    Args:
        rows: Motions to start from, shape ``(hands, 40)``.
        limits: Limits of every hand, or of each.

    Attributes:
        limits: One record of `smoother_memory.LIMITS` a hand.
        state: Everything the filter remembers, one record of `smoother_memory.HAND` a hand; copy it to come back to it.

    Raises:
        InputError: If shapes do not match or a row is not a finite motion.
    """

    def __init__(self, rows: np.ndarray, limits: HandLimits | Sequence[HandLimits] | None = None) -> None:
        self.state = initial_state(rows)
        hands = len(self.state)
        each = [limits or HandLimits()] * hands if limits is None or isinstance(limits, HandLimits) else list(limits)
        if len(each) != hands:
            raise InputError(f"limits for {len(each)} hands; {hands} are expected, one for each row", field="limits")
        self.limits = np.concatenate([one.record() for one in each])

    def reset(self, rows: np.ndarray) -> None:
        """Start again from other motions, shape ``(hands, 40)``: the one place where the command may jump."""
        state = initial_state(rows)
        if state.shape != self.state.shape:
            raise InputError(f"{len(state)} rows; {len(self.state)} are expected, one for each hand", field="rows")
        self.state[:] = state

    @property
    def motion(self) -> HandMotion:
        """What is being commanded, rows ``(hands, 40)``, a view on the state."""
        return HandMotion(self.state["motion"])


def initial_state(rows: np.ndarray) -> np.ndarray:
    """State of a filter that has followed these motions without error, one record of `smoother_memory.HAND` a hand.

    Raises:
        InputError: If ``rows`` is not ``(hands, 40)`` of finite motions with unit quaternions.
    """
    rows = np.asarray(rows, dtype=float)
    if rows.ndim != 2 or rows.shape[1] != ROW:
        raise InputError(f"rows have shape {rows.shape}; (hands, {ROW}) is expected", field="rows")
    size = np.linalg.norm(rows[:, QUAT], axis=1)
    if not (np.isfinite(rows).all() and np.all(np.abs(size - 1.0) <= 1e-6)):
        raise InputError(
            f"rows must be finite, with quaternions of unit length; the lengths are {size.tolist()}", field="rows"
        )
    state = np.zeros(len(rows), HAND)
    state["motion"] = rows
    state["target_acceleration"] = np.concatenate([rows[:, i] for i in (A, ALPHA, DDQ_FINGER)], axis=1)
    state["held"] = np.concatenate([rows[:, i] for i in (P, QUAT, Q_FINGER)], axis=1)
    return state
