"""How far a hand is trusted by what torque there is left; compiled by `wholebody.jit`."""

from __future__ import annotations

import math

import numpy as np

from wholebody.control.reference_packet import PALM
from wholebody.jit.arrays import Matrix, Vector


def trust(
    tau: Vector, joints: np.ndarray, limits: Vector, often: Matrix, palms: Matrix, row: Vector, keep: float,
    settings: Vector, out: Vector
) -> None:  # fmt: skip
    """One tick; see `wholebody.execution.saturation`.

    Args:
        tau: Torques (n,).
        joints: Of each arm with the waist (2, k).
        limits: Largest torques (n,).
        often: Changed, how often each has been spent, low-passed (2, k).
        palms: Palm points (2, 3).
        row: Packed reference that says where they are commanded to be.
        keep: Share that the filter keeps.
        settings: Share of the time and errors of a palm from which a hand gives way and has, least trust, and the
            share of its torque from which a joint has none left (5,).
        out: Trust (2,).
    """
    for h in range(2):
        most, off = 0.0, 0.0
        for i in range(joints.shape[1]):
            spent = 1.0 if abs(tau[joints[h, i]]) >= settings[4] * limits[joints[h, i]] else 0.0
            often[h, i] = keep * often[h, i] + (1.0 - keep) * spent
            most = max(most, often[h, i])
        for k in range(3):
            off += (palms[h, k] - row[PALM * h + 9 + k]) ** 2
        room = (1.0 - most) / (1.0 - settings[0])
        near = (settings[2] - math.sqrt(off)) / (settings[2] - settings[1])
        out[h] = min(max(room, near, settings[3]), 1.0)
