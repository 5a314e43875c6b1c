"""The seam: how far a commanded reference jumps where one piece of it is stitched to the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from policy.geometry.rotations import matrix_to_quaternion, rotvec_to_matrix
from wholebody.reference.hand_path import HandPath
from wholebody.reference.layout import DQ_FINGER, Q_FINGER, QUAT, HandMotion, P, V, W
from wholebody.reference.rotation import rotation_angle


@dataclass(frozen=True)
class Seam:
    """Jump of a reference at the stitching instant.

    Attributes:
        distance: |p(t+) - p(t-)| [m].
        angle: Angle between both orientations [rad].
        velocity: |v(t+) - v(t-)| [m/s].
        angular_velocity: |w(t+) - w(t-)| [rad/s].
        acceleration: |a(t+) - a(t-)| [m/s^2].
        finger: Largest jump of a finger joint [rad].
    """

    distance: float
    angle: float
    velocity: float
    angular_velocity: float
    acceleration: float
    finger: float


def seam(before: HandMotion, after: HandMotion, *, since: float = 0.0, until: float = 0.0) -> Seam:
    """Seam between two commanded motions, one row each, both extrapolated to the stitching instant.

    Args:
        before: Last motion of the old piece.
        after: First motion of the new piece.
        since: Time from ``before`` to the stitching instant [s].
        until: Time from the stitching instant to ``after`` [s].
    """
    a, b = extrapolated(before, since), extrapolated(after, -until)
    return Seam(
        distance=float(np.linalg.norm(b.p - a.p)),
        angle=float(rotation_angle(a.quat, b.quat)),
        velocity=float(np.linalg.norm(b.v - a.v)),
        angular_velocity=float(np.linalg.norm(b.w - a.w)),
        acceleration=float(np.linalg.norm(b.a - a.a)),
        finger=float(np.abs(b.q_finger - a.q_finger).max()),
    )


def extrapolated(motion: HandMotion, dt: float) -> HandMotion:
    """A motion, one row, carried on by ``dt`` [s] at constant acceleration, angular acceleration too."""
    row = motion.rows.copy()
    row[P] += dt * motion.v + 0.5 * dt**2 * motion.a
    row[V] += dt * motion.a
    turn = rotvec_to_matrix(dt * motion.w + 0.5 * dt**2 * motion.alpha)
    row[QUAT] = matrix_to_quaternion(turn @ motion.R, "xyzw")
    row[W] += dt * motion.alpha
    row[Q_FINGER] += dt * motion.dq_finger + 0.5 * dt**2 * motion.ddq_finger
    row[DQ_FINGER] += dt * motion.ddq_finger
    return HandMotion(row)


def path_seam(before: HandPath, after: HandPath, s: float) -> Seam:
    """Seam between two paths where one takes over from the other at parameter ``s`` [s]."""
    return seam(before.sample(s), after.sample(s))
