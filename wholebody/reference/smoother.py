"""Last stage of the reference: whatever it is asked to follow, what it commands is C2 and inside the caps.

It runs every control tick behind path and clock. A target that is inside the caps is reproduced with no lag; a target
that jumps, turns by 180 degrees or is not finite is rejoined by a minimum-jerk move. The arithmetic and its sources are
in `wholebody.reference.kernels.smoother`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from wholebody.errors import InputError
from wholebody.reference.compiled import compiled
from wholebody.reference.hand_limits import HandLimits
from wholebody.reference.kernels import smoother as core
from wholebody.reference.layout import ALPHA, DDQ_FINGER, Q_FINGER, QUAT, ROW, A, HandMotion, P


class ReferenceSmoother:
    """Third-order tracking filter of one or more hands.

    Args:
        rows: Motions to start from, shape ``(hands, 40)``.
        caps: Caps of every hand, or of each.
        interpret: Run the interpreted arithmetic, the specification, instead of the compiled one (tests).

    Attributes:
        caps: Caps of each hand, shape ``(hands, smoother.CAPS)``.
        state: Everything the filter remembers, shape ``(hands, smoother.STATE)``; copy it to come back to it.

    Raises:
        InputError: If shapes do not match or a row is not a finite motion.
    """

    def __init__(
        self, rows: np.ndarray, caps: HandLimits | Sequence[HandLimits] | None = None, *, interpret: bool = False
    ) -> None:
        self.state = initial_state(rows)
        hands = len(self.state)
        each = [caps or HandLimits()] * hands if caps is None or isinstance(caps, HandLimits) else list(caps)
        if len(each) != hands:
            raise InputError(f"caps for {len(each)} hands; {hands} are expected, one for each row", field="caps")
        self.caps = np.array([c.array() for c in each])
        self._step = core.smoother_step if interpret else smoother_step()
        self.rejections = 0
        """How often the target of a hand was not finite, since the start."""

    def reset(self, rows: np.ndarray) -> None:
        """Start again from other motions, shape ``(hands, 40)``: the one place where the command may jump."""
        state = initial_state(rows)
        if state.shape != self.state.shape:
            raise InputError(f"{len(state)} rows; {len(self.state)} are expected, one for each hand", field="rows")
        self.state[:] = state

    def step(self, target: np.ndarray, dt: float) -> HandMotion:
        """Advance by one tick.

        Args:
            target: Where the hands should be at the end of the tick, shape ``(hands, 40)``. A hand whose row is not
                finite brakes to the last pose it was given; `rejected` says so.
            dt: Tick [s].

        Returns:
            What to command at the end of the tick, rows ``(hands, 40)``, a view on the state.

        Raises:
            InputError: If the shape is wrong or the tick is not positive.
        """
        if target.shape != (len(self.state), ROW) or not 0.0 < dt < np.inf:
            raise InputError(
                f"target has shape {target.shape} and dt is {dt} s; {(len(self.state), ROW)} and a positive tick are "
                "expected",
                field="target",
            )
        self._step(self.state, np.ascontiguousarray(target, dtype=float), self.caps, float(dt))
        self.rejections += int(self.state[:, core.REJECTED].sum())
        return self.motion

    @property
    def motion(self) -> HandMotion:
        """What is being commanded, rows ``(hands, 40)``, a view on the state."""
        return HandMotion(self.state[:, :ROW])

    @property
    def rejected(self) -> np.ndarray:
        """Whether the target of the last tick was not finite, by hand (hands,)."""
        return self.state[:, core.REJECTED] > 0.0

    @property
    def limited(self) -> np.ndarray:
        """Whether a cap or a joint limit shaped the last tick, by hand (hands,)."""
        return self.state[:, core.LIMITED] > 0.0

    @property
    def error(self) -> np.ndarray:
        """Distance [m] and angle [rad] from the target of the last tick, by hand (hands, 2)."""
        return self.state[:, core.ERROR_P : core.ERROR_R + 1]


def initial_state(rows: np.ndarray) -> np.ndarray:
    """State of a filter that has followed these motions without error, shape ``(hands, smoother.STATE)``.

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
    state = np.zeros((len(rows), core.STATE))
    state[:, :ROW] = rows
    state[:, core.TARGET_A : core.TIME_TO_GO] = np.concatenate([rows[:, i] for i in (A, ALPHA, DDQ_FINGER)], axis=1)
    state[:, core.HELD : core.REJECTED] = np.concatenate([rows[:, i] for i in (P, QUAT, Q_FINGER)], axis=1)
    return state


@cache
def smoother_step() -> Callable[[np.ndarray, np.ndarray, np.ndarray, float], None]:
    """The compiled `smoother.smoother_step`."""
    return compiled(core, "smoother_step")
