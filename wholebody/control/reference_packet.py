"""What the controller follows at one tick."""

from __future__ import annotations

from bisect import bisect
from dataclasses import dataclass
from math import isfinite

import numpy as np
import pinocchio as pin

from wholebody.errors import InputError
from wholebody.robot.contact_schedule import Contacts

PALM, COM, MOMENTUM, PELVIS, TORSO, HEIGHT, POSTURE = 24, 48, 57, 63, 78, 93, 96
"""Indices at which the parts of a packed reference begin, after the left palm; `ReferenceMemory` says what they are."""


def row_length(n_joints: int) -> int:
    """Numbers of a packed reference."""
    return POSTURE + 3 * n_joints


@dataclass(frozen=True, kw_only=True)
class PalmReference:
    """Reference of one palm point: pose, twist and acceleration in world axes [m, rad; per s; per s^2]."""

    T_world: pin.SE3
    twist: np.ndarray
    acceleration: np.ndarray


@dataclass(frozen=True, kw_only=True)
class BodyReference:
    """Everything the controller follows at one tick.

    Attributes:
        palms: Left and right palm.
        q: Planned configuration, shape (nq,), Pinocchio convention; the finger entries are the finger references.
        dq, ddq: Joint speeds and accelerations of it, shape (n_joints,), Pinocchio order.
        pelvis, torso: Planned orientation (3, 3), angular rate (3,) and acceleration (3,), world axes.
        height: Planned height of the pelvis, its rate and acceleration [m, m/s, m/s^2].
        com: Planned centre of mass, its velocity and acceleration, shape (3,) each.
        momentum: Planned angular momentum about the centre of mass and its rate, shape (3,) each [N m s, N m].
        contacts: Which feet stand, where, and what they may carry from this tick on; as before if None.
        swing: Pose, twist and acceleration of both feet for the one that is up: rotation (9), position (3), twist (6)
            and acceleration (6) in world axes, shape (2, 24); a foot that is up moves as suits the rest if None.
    """

    palms: tuple[PalmReference, PalmReference]
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    pelvis: tuple[np.ndarray, np.ndarray, np.ndarray]
    torso: tuple[np.ndarray, np.ndarray, np.ndarray]
    height: tuple[float, float, float]
    com: tuple[np.ndarray, np.ndarray, np.ndarray]
    momentum: tuple[np.ndarray, np.ndarray]
    contacts: Contacts | None = None
    swing: np.ndarray | None = None

    def pack(self, out: np.ndarray | None = None) -> np.ndarray:
        """All of it in one row, as `ReferenceMemory` lays it out, shape (row_length,)."""
        left, right = self.palms
        # One call for all: each assignment to a slice would take as long as all of the copying.
        return np.concatenate(
            (
                left.T_world.rotation.reshape(9), left.T_world.translation, left.twist, left.acceleration,
                right.T_world.rotation.reshape(9), right.T_world.translation, right.twist, right.acceleration,
                *self.com, *self.momentum,
                self.pelvis[0].reshape(9), self.pelvis[1], self.pelvis[2],
                self.torso[0].reshape(9), self.torso[1], self.torso[2], self.height,
                self.q[7:], self.dq, self.ddq,
            ),
            out=out,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class PackedReference:
    """Body reference as one row, for a source that computes many at once; see `BodyReference`."""

    row: np.ndarray
    contacts: Contacts | None = None
    swing: np.ndarray | None = None

    def pack(self, out: np.ndarray) -> np.ndarray:
        """Copy the row."""
        out[:] = self.row
        return out


class ReferenceMemory:
    """A packed reference by its parts, which share its memory.

    Attributes:
        row: All of it, shape (row_length,).
        palms: Rotation (9), position (3), twist (6) and acceleration (6) of both palms, shape (24,) each.
        com: Position, velocity and acceleration, shape (9,).
        momentum: Angular momentum and its rate, shape (6,).
        pelvis, torso: Rotation (9), rate (3) and acceleration (3), shape (15,).
        height: Height, rate and acceleration, shape (3,).
        posture: Joint positions, speeds and accelerations, shape (3, n_joints).
    """

    def __init__(self, row: np.ndarray) -> None:
        self.row = row
        self.palms = row[:PALM], row[PALM:COM]
        self.com, self.momentum = row[COM:MOMENTUM], row[MOMENTUM:PELVIS]
        self.pelvis, self.torso, self.height = row[PELVIS:TORSO], row[TORSO:HEIGHT], row[HEIGHT:POSTURE]
        self.posture = row[POSTURE:].reshape(3, -1)

    def take(self, reference: BodyReference | PackedReference) -> None:
        """Copy a reference.

        Raises:
            InputError: If a number of it is not finite.
        """
        row = reference.pack(self.row)
        # A sum of squares is finite only if all of its terms are.
        if not isfinite(row.dot(row)) and not np.isfinite(row).all():
            i = int(np.flatnonzero(~np.isfinite(row))[0])
            names = ("left palm", "right palm", "com", "momentum", "pelvis", "torso", "height", "posture")
            part = names[bisect((PALM, COM, MOMENTUM, PELVIS, TORSO, HEIGHT, POSTURE), i)]
            raise InputError(f"the reference of the {part} is {row[i]}; every number must be finite", field=part)
