"""What the rows of a recording tell: doubled ones, a start at the end, a state that is the action."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from policy.findings import Finding

ROWS_MIN = 8
"""Fewest rows that tell; chosen."""
DOUBLED = 0.9
"""Share of every second step that must stand still, while the others move, of doubled rows; chosen."""
ROLLED_JUMP = 1.3
"""How many times the largest other step the step next to a rolled row must be at least; measured: as
`policy.suspicion.joint_table.GAIN`."""
ROLLED_NEAR = 1.5
"""Largest distance of a rolled row from the other end, in the largest other step; chosen: one step more."""
EQUAL, COMPLEMENT = 1e-7, 0.02
"""Difference of numbers that are the same but for single precision, and of grippers that are complements, in their
range; chosen."""
CONSTANT_OFFSET, LAG_MAX = 0.05, 5
"""Constant difference of state and action that is told [rad], chosen: past what gravity bends; most steps of delay that
are looked for."""


def row_findings(values: np.ndarray) -> list[Finding]:
    """Hypotheses about the rows of numbers (n, D)."""
    values = np.asarray(values, dtype=float)
    if len(values) < ROWS_MIN or not np.ptp(values, axis=0).any():
        return []
    return [*_doubled(values), *_rolled(values)]


def _doubled(values: np.ndarray) -> Iterator[Finding]:
    still = (np.abs(np.diff(values, axis=0)) <= EQUAL).all(axis=1)
    for first in (0, 1):
        same, others = still[first::2], still[1 - first :: 2]
        if same.mean() >= DOUBLED and others.mean() <= 1.0 - DOUBLED + 0.4 and not others.all():
            yield Finding(
                "doubled_rows", "warning",
                f"every second row is the same as the one before ({int(same.sum())} of {len(same)}): recorded at half "
                "the rate and written twice",
                "--read-as doubled_rows keeps one of each two and passes at half the rate",
            )  # fmt: skip
            return


def _rolled(values: np.ndarray) -> Iterator[Finding]:
    steps = np.linalg.norm(np.diff(values, axis=0), axis=1)
    for code, at, others, place in (
        ("rows_rolled", steps[0], steps[1:], "first"),
        ("rows_rolled_back", steps[-1], steps[:-1], "last"),
    ):
        gap = np.linalg.norm(values[0] - values[-1])
        if at > ROLLED_JUMP * others.max() and gap <= ROLLED_NEAR * others.max() and at > EQUAL:
            yield Finding(
                code, "warning",
                f"the {place} row is {at:.3g} from the one beside it, {at / max(others.max(), 1e-12):.0f} times any "
                f"other step, and {gap:.3g} from the other end: the rows are rolled by one",
                f"--read-as {code} reads them so",
            )  # fmt: skip
            return


def state_findings(state: np.ndarray, action: np.ndarray, names: Sequence[str]) -> list[Finding]:
    """Hypotheses about states and actions of the same columns.

    Args:
        state: Shape (n, D).
        action: The same shape, in the same units.
        names: Of the columns.

    Returns:
        That the state is the action, at once or some rows late, or does not move, that grippers are complements, that
        a joint has a constant offset, and by how many rows states follow actions where they do.
    """
    state, action = np.asarray(state, dtype=float), np.asarray(action, dtype=float)
    if state.shape != action.shape or len(state) < ROWS_MIN or not np.ptp(action, axis=0).any():
        return []
    if np.ptp(state, axis=0).max() <= EQUAL and np.ptp(action, axis=0).max() > CONSTANT_OFFSET:
        return [_copied("the state is the same in every row, and the action moves")]
    for lag in range(LAG_MAX + 1):
        if np.abs(state[lag:] - action[: len(action) - lag]).max() <= EQUAL:
            before = ("", " of the row before")[lag] if lag < 2 else f" of {lag} rows before"
            return [_copied(f"the state is the action{before}, to the last digit, in every row")]
    return [*_complements(state, action, names), *_offsets(state, action, names)]


def _copied(text: str) -> Finding:
    return Finding(
        "state_is_action", "warning", f"{text}: nothing was measured",
        "record observation.state from the motors; a policy trained on this does not see where the robot is",
    )  # fmt: skip


def _complements(state: np.ndarray, action: np.ndarray, names: Sequence[str]) -> Iterator[Finding]:
    for i, name in enumerate(names):
        if not name.endswith("_grasp"):
            continue
        span = np.ptp(action[:, i])
        whole = state[:, i] + action[:, i]
        if span > 0 and np.ptp(whole) <= COMPLEMENT * span and np.abs(state[:, i] - action[:, i]).max() > 0.5 * span:
            yield Finding(
                "gripper_complement", "warning",
                f"state and action of {name} add up to {whole.mean():.3g} in every row: one is the other's complement, "
                "open where it is closed",
                "turn one of them round before training",
            )  # fmt: skip


def _offsets(state: np.ndarray, action: np.ndarray, names: Sequence[str]) -> Iterator[Finding]:
    lag = min(range(LAG_MAX + 1), key=lambda k: float(np.mean((state[k:] - action[: len(action) - k]) ** 2)))
    gaps = state[lag:] - action[: len(action) - lag]
    middle, spread = np.median(gaps, axis=0), gaps.std(axis=0)
    off = [i for i in range(len(names)) if abs(middle[i]) > CONSTANT_OFFSET and spread[i] < 0.2 * abs(middle[i])]
    if off:
        i = max(off, key=lambda i: abs(middle[i]))
        yield Finding(
            "state_offset", "warning",
            f"columns of the state that are a constant away from the action: {len(off)}, most of all {names[i] or i} "
            f"by {middle[i]:.3g}, {lag} rows later",
            "an encoder's zero, or another unit: compare both at rest",
        )  # fmt: skip
