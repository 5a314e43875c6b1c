"""Hypotheses applied, each when a user says so (``--read-as``): the inverse of what went wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.spec import RobotSpec
from policy.errors import PolicyError, did_you_mean
from policy.suspicion.orders import candidates

AS_NAMED = "as_named"
"""Code to read numbers as they are named, although they look wrong."""
HANDS_ONLY = "hands_only"
"""Leave the legs out, whose steps feet that stay cannot follow."""
ORDERS = ("isaac_order", "motor_order", "finger_order", "pinocchio_order", "left_right", "columns_rolled",
          "columns_rolled_back")  # fmt: skip
ROWS = ("doubled_rows", "rows_rolled", "rows_rolled_back")
UNITS = ("degrees", "mirrored_fingers")
ROOT = ("w_first", "millimetres")
READ_AS = (AS_NAMED, HANDS_ONLY, *ORDERS, *UNITS, *ROWS, *ROOT)
"""Codes that ``--read-as`` takes; those of `ROOT` are for motions."""


class ReadAsError(PolicyError, ValueError):
    """Something to read numbers as that is not known, or does not apply to them."""


@dataclass(frozen=True)
class Table:
    """Columns of numbers by name.

    Attributes:
        names: Canonical name of each column; empty where it is no joint.
        values: Shape (n, D); joints in rad, as far as they are what they are called.
        fps: Rows a second [Hz].
        robot: Whose joints.
    """

    names: tuple[str, ...]
    values: np.ndarray
    fps: float
    robot: RobotSpec


def require_known(read_as: Sequence[str]) -> None:
    """Refuse what cannot be said.

    Raises:
        ReadAsError: With what can.
    """
    for code in read_as:
        if code not in READ_AS:
            raise ReadAsError(
                f"--read-as {code} is unknown; {did_you_mean(code, READ_AS)}possible: {', '.join(READ_AS)}"
            )


def corrected(table: Table, read_as: Sequence[str]) -> Table:
    """A table as the user says that it is to be read; what is for the root of a motion is not looked at.

    Raises:
        ReadAsError: If an order has no meaning for these columns.
    """
    for code in read_as:
        if code in ORDERS:
            table = replace(table, values=_reordered(table, code))
        elif code == "degrees":
            joint = [name in table.robot.joint_names for name in table.names]
            table = replace(table, values=np.where(joint, np.deg2rad(table.values), table.values))
        elif code == "mirrored_fingers":
            fingers = [name for side in ("left", "right") for name in table.robot.tool(side).finger_joints]
            bent = np.array([name in fingers and "_thumb_" not in name for name in table.names])
            table = replace(table, values=np.where(bent, -table.values, table.values))
        elif code == "doubled_rows":
            table = replace(table, values=table.values[::2], fps=0.5 * table.fps)
        elif code in ROWS:
            table = replace(table, values=np.roll(table.values, -1 if code == "rows_rolled" else 1, axis=0))
    return table


def _reordered(table: Table, code: str) -> np.ndarray:
    for known, _, names in candidates(table.names, table.robot):
        if known == code:
            return table.values[:, [names.index(name) for name in table.names]]
    raise ReadAsError(f"--read-as {code} has no meaning for these {len(table.names)} columns, or is how they are named")
