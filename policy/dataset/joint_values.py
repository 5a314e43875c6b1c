"""Whether the numbers of a recording can be of the joints that its columns are called."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from policy.action_spec.slot import DEX1_OPEN
from policy.dataset.joint_layout import JointLayout
from policy.dataset.naming.meaning import FOREIGN_FINGERS, GRASPS
from policy.errors import DatasetError

DEGREES_FROM = 2.0 * np.pi
"""No joint of the G1 turns a whole circle [rad]; the widest reaches 3.1."""
ORDER_MARGIN = 0.3
"""Commands and encoder offsets overshoot limits by less [rad]; published sets do overshoot (unitree_lerobot #104)."""
ORDER_SHARE = 0.5
"""Share of frames beyond the margin from which a column cannot be the joint it is called."""
FINGER_MARGIN = 0.1
"""How far a closing number may be outside 0 to 1; chosen: what calibration of such hands misses by."""


def check_values(layout: JointLayout, values: np.ndarray, *, feature: str = "action") -> tuple[str, ...]:
    """Refuse joint values that are not finite, no radians, or not of the joints they are called.

    Args:
        layout: Names of the columns.
        values: Shape (n, D), in the layout's unit.
        feature: Name of the feature, for messages.

    Returns:
        Notes about joints that leave their limits a little; nothing is changed.

    Raises:
        DatasetError: Naming the feature, column and first frame.
    """
    values = np.asarray(values, dtype=float)
    if values.ndim != 2 or values.shape[1] != layout.dim:
        raise DatasetError(f"'{feature}' has shape {values.shape}; (frames, {layout.dim}) is expected", feature=feature)
    require_finite(values, layout.given, feature=feature, unless=[not name for name in layout.names])
    return tuple(
        note for column in range(layout.dim) for note in _check_column(layout, values[:, column], column, feature)
    )


def require_finite(
    values: np.ndarray, given: Sequence[str], *, feature: str = "action", unless: Sequence[bool] | None = None
) -> None:
    """Refuse numbers (n, D) that are not finite, in columns that are not left out.

    Raises:
        DatasetError: Naming the feature, column and first frame.
    """
    bad = ~np.isfinite(values) & ~np.array(unless if unless is not None else [False] * values.shape[1])
    if bad.any():
        frame, column = (int(i) for i in np.argwhere(bad)[0])
        raise DatasetError(
            f"'{feature}' column {column} ({given[column]}) is {values[frame, column]} at frame {frame}; "
            f"{int(bad.sum())} of {bad.size} numbers are not finite: leave those episodes out",
            feature=feature,
            frame=frame,
        )


def _check_column(layout: JointLayout, values: np.ndarray, column: int, feature: str) -> list[str]:
    name, spelt = layout.names[column], layout.given[column]
    if not name:
        return []
    if name in FOREIGN_FINGERS:
        return _check_finger(values, column, spelt, feature)
    if name in GRASPS:
        return _check_gripper(values, column, spelt, feature)
    q = np.deg2rad(values) if layout.unit == "deg" else values
    frame = int(np.argmax(np.abs(q)))
    if np.abs(q[frame]) > DEGREES_FROM:
        raise DatasetError(
            f"'{feature}' column {column} ({spelt}) is {values[frame]:.4g} {layout.unit} at frame {frame}; no joint of "
            f"the G1 passes {DEGREES_FROM:.3g} rad: "
            + ("the numbers look like degrees, say --unit deg" if layout.unit == "rad" else "the recording is damaged"),
            feature=feature,
            frame=frame,
        )
    index = layout.robot.index(name)
    low, high = layout.robot.position_min[index], layout.robot.position_max[index]
    excess = np.maximum(low - q, q - high)
    if np.mean(excess > ORDER_MARGIN) > ORDER_SHARE:
        raise DatasetError(
            f"'{feature}' column {column} ({spelt}) is outside the limits [{low:.3g}, {high:.3g}] rad of {name} by "
            f"more than {ORDER_MARGIN} rad in {np.mean(excess > ORDER_MARGIN):.0%} of the frames: the columns are in "
            "another order than their names say (the right Dex3 hand is thumb, index, middle), or have another sign",
            feature=feature,
            frame=int(np.argmax(excess)),
        )
    beyond = excess > 1e-6
    if not beyond.any():
        return []
    return [f"{feature}: {name} is beyond its limits in {int(beyond.sum())} frames, by up to {excess.max():.3g} rad"]


def _check_gripper(values: np.ndarray, column: int, spelt: str, feature: str) -> list[str]:
    frame = int(np.argmax(np.abs(values)))
    if np.abs(values[frame]) > DEGREES_FROM:
        raise DatasetError(
            f"'{feature}' column {column} ({spelt}) is {values[frame]:.4g} at frame {frame}; a Dex1 motor angle is "
            f'between 0 (closed) and {DEX1_OPEN} rad (open); of shares or percent a layout with the unit "closing" is '
            "meant, which `wholebody layouts --from` writes",
            feature=feature,
            frame=frame,
        )
    outside = (values < 0.0) | (values > DEX1_OPEN)
    if not outside.any():
        return []
    return [f"{feature}: {spelt} is outside [0, {DEX1_OPEN}] rad in {int(outside.sum())} frames and was clipped"]


def _check_finger(values: np.ndarray, column: int, spelt: str, feature: str) -> list[str]:
    low, high = float(values.min()), float(values.max())
    if low < -FINGER_MARGIN or high > 1.0 + FINGER_MARGIN:
        raise DatasetError(
            f"'{feature}' column {column} ({spelt}) goes from {low:.4g} to {high:.4g}; fingers of Inspire and BrainCo "
            "hands are closing numbers from 0 to 1: divide what is in radians or in counts by its range",
            feature=feature,
            frame=int(np.argmax(np.abs(values))),
        )
    return []
