"""What numbers that are called joints may be instead: another order, another unit, differences, a quaternion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from models.spec import RobotSpec
from policy.findings import Finding
from policy.suspicion.orders import candidates, misfit

CIRCLE = 2.0 * np.pi
"""No joint of the G1 turns a whole circle [rad]; the widest reaches 3.1."""
GAIN = 0.08
"""Advantage that an order must have over the names, in the mean of `misfit` over the columns that it moves, to be a
hypothesis; measured: `docs/your_dataset.md`."""
FIT = 1.8
"""Largest mean misfit of an order that is believed; measured: as `GAIN`."""
STILL = 1e-6
"""Difference between rows below which a column stands still [rad]."""
CENTRED = 0.6
"""Largest median over the columns of mean over deviation, from which numbers are differences; measured: as `GAIN`."""
WIGGLE = 0.08
"""Least median over the columns of the deviation of steps over that of the numbers, of differences; measured: as
`GAIN`."""
ROWS_MIN = 12
"""Fewest rows that say anything about an order or about differences; chosen: 0.4 s at 30 Hz."""
NORM = 2e-3
"""How far the norm of four columns may be from 1 in every row of a quaternion; chosen: four printed digits."""
OUT_OF_RANGE = 0.2
"""How far out of its range a joint that stands still cannot be [rad]; chosen: past what calibration misses by."""
SIGN_SHARE = 0.5
"""Share of the rows in which fingers bend the wrong way, from which their sign is another one; chosen."""


def joint_findings(names: Sequence[str], values: np.ndarray, robot: RobotSpec) -> list[Finding]:
    """Hypotheses about joint columns.

    Args:
        names: Canonical name of each column; empty where it is no joint.
        values: Finite, shape (n, D), [rad].
        robot: The robot.

    Returns:
        The likeliest first; none where the numbers fit the names.
    """
    values = np.asarray(values, dtype=float)
    joints = [i for i, name in enumerate(names) if name in robot.joint_names]
    if not joints:
        return []
    found = list(_differences(names, values[:, joints]))
    if not found:
        found += _degrees(names, values, joints, robot)
    if not found:
        found += _quaternions(names, values)
    if not found and len(values) >= ROWS_MIN:
        found += _likeliest(tuple(names), values, robot)
    # Of numbers in another unit it says nothing that these are out of their ranges.
    return found if found and found[0].check == "degrees" else found + list(_constant(names, values, joints, robot))


def _degrees(names: Sequence[str], values: np.ndarray, joints: list[int], robot: RobotSpec) -> Iterator[Finding]:
    large = [i for i in joints if np.abs(values[:, i]).max() > CIRCLE]
    if not large:
        return

    def inside(i: int) -> bool:
        index, q = robot.index(names[i]), np.deg2rad(values[:, i])
        return bool((q > robot.position_min[index] - 0.3).all() and (q < robot.position_max[index] + 0.3).all())

    fitting = [i for i in large if inside(i)]
    if 2 * len(fitting) < len(large) or len(fitting) < 2:
        return
    i = max(fitting, key=lambda i: np.abs(values[:, i]).max())
    text = (
        f"{len(large)} of {len(joints)} joints pass a whole circle ({names[i]} {np.abs(values[:, i]).max():.4g}), and "
    )
    text += f"{len(fitting)} of these are in range as degrees"
    half = [i for i in joints if i not in large and np.ptp(values[:, i]) > STILL]
    if half:
        text += f"; {len(half)} others do not tell"
    yield Finding("degrees", "error", f"the numbers look like degrees: {text}", "--read-as degrees reads them so")


def _quaternions(names: Sequence[str], values: np.ndarray) -> Iterator[Finding]:
    if len(values) < 3:
        return
    for start in range(len(names) - 3):
        if not all(names[start : start + 4]):
            continue
        four = values[:, start : start + 4]
        if np.abs(np.linalg.norm(four, axis=1) - 1.0).max() < NORM:
            yield Finding(
                "quaternion", "warning",
                f"columns {start} to {start + 3} have norm 1 in every row, as quaternions have and joints do not "
                f"({names[start]} to {names[start + 3]})",
                "name a layout with poses, such as decoupled_wbc_eef14 (`wholebody layouts` has all)",
            )  # fmt: skip
            return


def _differences(names: Sequence[str], values: np.ndarray) -> Iterator[Finding]:
    moving = values[:, np.ptp(values, axis=0) > STILL]
    if len(values) < ROWS_MIN or moving.shape[1] < 6:
        return
    spread = moving.std(axis=0)
    centred = float(np.median(np.abs(moving.mean(axis=0)) / spread))
    wiggle = float(np.median(np.diff(moving, axis=0).std(axis=0) / spread))
    if centred < CENTRED and wiggle > WIGGLE:
        yield Finding(
            "differences", "warning",
            f"the numbers look like velocities or differences: of {moving.shape[1]} moving columns the median mean is "
            f"{centred:.2f} of its deviation, and that of the steps is {wiggle:.2f}",
            "name a layout whose slots have the mode delta or relative_add",
        )  # fmt: skip


def _likeliest(names: tuple[str, ...], values: np.ndarray, robot: RobotSpec) -> Iterator[Finding]:
    """The other order, or the other sign of fingers, that fits best, if one is a hypothesis."""
    before, best = misfit(names, values, robot), (0.0, None)
    for mirrored in _mirrored_fingers(names, values, robot):
        bent = [name for side in ("left", "right") for name in robot.tool(side).finger_joints if "_thumb_" not in name]
        after = misfit(names, np.where([name in bent for name in names], -values, values), robot)
        best = float((before - after).sum()), mirrored
    for code, text, other in candidates(names, robot):
        moved = [i for i in range(len(names)) if other[i] != names[i]]
        if code == "left_right":  # hands alone may have the other sign, too
            moved = [i for i in moved if "_hand_" not in names[i]] or moved
        after = misfit(other, values, robot)
        gain, fit = float((before - after)[moved].mean()), float(after[moved].mean())
        whole = float((before - after).sum())
        if gain > GAIN and fit < FIT and whole > best[0]:
            sentence = (
                f"it looks as if {text}: the {len(moved)} columns that this moves fit their joints by {fit:.2f} then, "
            )
            sentence += f"and by {before[moved].mean():.2f} as they are named (0 fits, {FIT:g} is doubtful)"
            best = whole, Finding(code, "warning", sentence, f"--read-as {code} reads them so")
    if best[1] is not None:
        yield best[1]


def _mirrored_fingers(names: Sequence[str], values: np.ndarray, robot: RobotSpec) -> Iterator[Finding]:
    wrong = []
    for side in ("left", "right"):
        columns = [
            i for i, name in enumerate(names) if name in robot.tool(side).finger_joints and "_thumb_" not in name
        ]
        bent = [i for i in columns if np.median(np.abs(values[:, i])) > 0.1]
        outside = [i for i in bent if _outside(names[i], values[:, i], robot) > SIGN_SHARE
                   and _outside(names[i], -values[:, i], robot) == 0.0]  # fmt: skip
        if bent and 2 * len(outside) > len(bent):
            wrong.append((side, len(outside), len(bent)))
    if wrong:
        text = ", ".join(f"{count} of {total} of the {side} hand" for side, count, total in wrong)
        yield Finding(
            "mirrored_fingers", "error", f"fingers bend the wrong way: {text} are in range with the other sign",
            "--read-as mirrored_fingers reads them so",
        )  # fmt: skip


def _constant(names: Sequence[str], values: np.ndarray, joints: list[int], robot: RobotSpec) -> Iterator[Finding]:
    if len(values) < 2:
        return
    for i in joints:
        if np.ptp(values[:, i]) <= STILL and _outside(names[i], values[:, i], robot) == 1.0:
            index = robot.index(names[i])
            low, high = robot.position_min[index], robot.position_max[index]
            far = max(low - values[0, i], values[0, i] - high) > OUT_OF_RANGE
            yield Finding(
                "constant_out_of_range", "error" if far else "warning",
                f"{names[i]} is {values[0, i]:.4g} rad in every row, out of its range of {low:.3g} to {high:.3g} rad",
                "the column is another joint, or was not recorded: give it the kind ignored in a layout of your own; "
                "--read-as as_named takes it as it is",
            )  # fmt: skip
            return


def _outside(name: str, q: np.ndarray, robot: RobotSpec) -> float:
    """Share of the rows in which a joint is out of its range."""
    index = robot.index(name)
    return float(np.mean((q < robot.position_min[index] - 0.05) | (q > robot.position_max[index] + 0.05)))
