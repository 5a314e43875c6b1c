"""Where the poses of hands are, beside the joints that put them there: another point of the hand, another base."""

from __future__ import annotations

import numpy as np

from policy.findings import Finding
from policy.suspicion.rows import LAG_MAX, ROWS_MIN

TOOL_OFFSET = 0.02
"""Distance of a hand's position from its wrist by the joints from which it is told [m]; chosen: past calibration, and
under the 0.05 m that teleoperation adds."""
STEADY = 0.3
"""Largest deviation of nine rows in ten from the offset, in its length, of one that is constant; chosen: a third."""


def tool_findings(side: str, T_base_hand: np.ndarray, p_base_given: np.ndarray) -> list[Finding]:
    """Hypothesis that a hand's positions are of a point a constant way off its wrist.

    Args:
        side: ``left`` or ``right``.
        T_base_hand: Wrist by the joints of each row, shape (n, 4, 4); up to `LAG_MAX` rows later than the positions.
        p_base_given: What the recording has as its position, shape (n, 3), in the pelvis [m].
    """
    T, given = np.asarray(T_base_hand, dtype=float), np.asarray(p_base_given, dtype=float)
    if len(T) != len(given) or len(T) < ROWS_MIN + LAG_MAX or not np.isfinite(given).all():
        return []
    if np.ptp(given, axis=0).max() < TOOL_OFFSET:
        return []  # anything is constant of a hand that stands still
    best = min((_offset(T[lag:], given[: len(given) - lag], local) for lag in range(LAG_MAX + 1)
                for local in (True, False)), key=lambda found: found[1])  # fmt: skip
    offset, spread, local = best
    length = float(np.linalg.norm(offset))
    if length < TOOL_OFFSET or spread > STEADY * length:
        return []
    x, y, z = np.round(offset, 3) + 0.0  # no -0
    where = f"{side}_wrist_position is {1e2 * length:.1f} cm from the wrist that the joints beside it make"
    steady = f"within {1e3 * spread:.0f} mm of that in nine rows of ten"
    if local:
        return [Finding(
            "tool_offset", "warning",
            f"{where}, at ({x:.3f}, {y:.3f}, {z:.3f}) m in the hand's own frame, {steady}: another point of the hand",
            f'name a layout with "tcp_offset": [{x:.3f}, {y:.3f}, {z:.3f}] there',
        )]  # fmt: skip
    return [Finding(
        "base_offset", "warning",
        f"{where}, at ({x:.3f}, {y:.3f}, {z:.3f}) m along the axes of the pelvis, {steady}: another base",
        "subtract it, or name a layout in the frame that it is in",
    )]  # fmt: skip


def _offset(T: np.ndarray, given: np.ndarray, local: bool) -> tuple[np.ndarray, float, bool]:
    """Median offset (3,), the distance from it that nine rows of ten keep, and in whose axes it is."""
    away = given - T[:, :3, 3]
    if local:
        away = np.einsum("nji,nj->ni", T[:, :3, :3], away)
    middle = np.median(away, axis=0)
    return middle, float(np.quantile(np.linalg.norm(away - middle, axis=1), 0.9)), local
