"""Motion of one hand as a flat row: what paths produce, the smoother filters and compiled code reads.

A row holds the motion of the hand frame (the wrist frame of a tool) and of its finger joints at one instant. There is
room for 7, as a Dex3 hand has; the other entries of a hand that has fewer are 0:

====== ============ =================================================================
0:9    p, v, a      position in world and its derivatives [m, m/s, m/s^2]
9:13   quat         quaternion of ``R_world_hand``, xyzw
13:19  w, alpha     angular velocity and acceleration in world axes [rad/s, rad/s^2]
19:40  q, dq, ddq   finger joints in motor order [rad, rad/s, rad/s^2]
====== ============ =================================================================
"""

from __future__ import annotations

import numpy as np

from policy.geometry.rotations import matrix_to_quaternion, quaternion_to_matrix
from policy.geometry.se3 import make_transform
from wholebody.reference.kernels.smoother_memory import ROW

P, V, A = slice(0, 3), slice(3, 6), slice(6, 9)
QUAT, W, ALPHA = slice(9, 13), slice(13, 16), slice(16, 19)
Q_FINGER, DQ_FINGER, DDQ_FINGER = slice(19, 26), slice(26, 33), slice(33, 40)


class HandMotion:
    """Named views on rows, shape ``(..., 40)``; writing through them changes the rows."""

    __slots__ = ("rows",)

    def __init__(self, rows: np.ndarray) -> None:
        self.rows = rows

    p = property(lambda self: self.rows[..., P], doc="Position in world (..., 3) [m].")
    v = property(lambda self: self.rows[..., V], doc="Velocity (..., 3) [m/s].")
    a = property(lambda self: self.rows[..., A], doc="Acceleration (..., 3) [m/s^2].")
    quat = property(lambda self: self.rows[..., QUAT], doc="Quaternion of R_world_hand, xyzw (..., 4).")
    w = property(lambda self: self.rows[..., W], doc="Angular velocity, world axes (..., 3) [rad/s].")
    alpha = property(lambda self: self.rows[..., ALPHA], doc="Angular acceleration (..., 3) [rad/s^2].")
    q_finger = property(lambda self: self.rows[..., Q_FINGER], doc="Finger joints (..., 7) [rad].")
    dq_finger = property(lambda self: self.rows[..., DQ_FINGER], doc="Finger speeds (..., 7) [rad/s].")
    ddq_finger = property(lambda self: self.rows[..., DDQ_FINGER], doc="Finger accelerations (..., 7) [rad/s^2].")

    @property
    def T_world_hand(self) -> np.ndarray:
        """Pose (..., 4, 4)."""
        return make_transform(quaternion_to_matrix(self.quat, "xyzw"), self.p)


def time_scaled(motion: HandMotion, rate: float | np.ndarray, change: float | np.ndarray) -> HandMotion:
    """A motion's derivatives with respect to time, from those with respect to the path parameter.

    Args:
        motion: Rows ``(..., 40)``.
        rate: ds/dt, scalar or shape ``(...)``.
        change: d2s/dt2 [1/s], scalar or shape ``(...)``.
    """
    rate, change = np.asarray(rate)[..., None], np.asarray(change)[..., None]
    rows = motion.rows.copy()
    for first, second in ((V, A), (W, ALPHA), (DQ_FINGER, DDQ_FINGER)):
        rows[..., second] = motion.rows[..., second] * rate**2 + motion.rows[..., first] * change
        rows[..., first] = motion.rows[..., first] * rate
    return HandMotion(rows)


def rest_row(T_world_hand: np.ndarray, q_finger: np.ndarray | None = None) -> np.ndarray:
    """Row of a hand at rest, shape ``(40,)``.

    Args:
        T_world_hand: Pose, shape ``(4, 4)``.
        q_finger: Finger joints, shape ``(7,)``, or ``(0,)`` of a hand without fingers, [rad]; zero if not given.
    """
    row = np.zeros(ROW)
    row[P], row[QUAT] = T_world_hand[:3, 3], matrix_to_quaternion(T_world_hand[:3, :3], "xyzw")
    if q_finger is not None:
        row[Q_FINGER][: len(q_finger)] = q_finger
    return row
