"""Numbers of a dataset read as a user says that they are (``--read-as``)."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from policy.dataset.joint_layout import JointLayout
from policy.dataset.naming.sources import Source
from policy.suspicion.corrections import ROWS, ReadAsError, Table, corrected, require_known


def read_as_corrections(
    source: Source, layout: JointLayout, read_as: Sequence[str], *, rows_too: bool = False
) -> Source:
    """Source whose numbers are read as a user says.

    Args:
        source: Columns of joints.
        layout: What they are called.
        read_as: What they are instead, of `policy.suspicion.corrections.READ_AS`.
        rows_too: Whether other rows may be made of them.

    Raises:
        ReadAsError: If what is said is not known, or would make other rows, while the pictures beside them stay.
    """
    require_known(read_as)
    if not rows_too and (rows := [code for code in read_as if code in ROWS]):
        raise ReadAsError(f"--read-as {rows[0]} makes other rows, and the pictures beside them would stay: edit them")

    def correct(values: np.ndarray) -> np.ndarray:
        return corrected(Table(layout.names, values, 1.0, layout.robot), read_as).values

    return dataclasses.replace(source, correct=correct) if read_as else source
