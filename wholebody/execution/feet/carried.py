"""What was planned for a stand, carried along by the base of a walk: palms and trunk with its motion."""

from __future__ import annotations

from cmath import exp

import numpy as np
import pinocchio as pin

from policy.geometry.rotations import matrix_to_quaternion
from wholebody.control.reference_packet import ReferenceMemory
from wholebody.reference import HandMotion, rest_row
from wholebody.walking.guide import Guide
from wholebody.walking.places import Place


def about_z(angle: float) -> np.ndarray:
    """Rotation about the vertical, shape (3, 3)."""
    turn = exp(1j * angle)
    c, s = turn.real, turn.imag
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def leaning(slope: complex) -> np.ndarray:
    """Rotation of level axes onto a floor of a slope ``x + iy`` [m/m] by the shortest way, shape (3, 3)."""
    if slope == 0j:
        return np.eye(3)
    up = np.array([0.0, 0.0, 1.0])
    return pin.Quaternion.FromTwoVectors(up, up - np.array([slope.real, slope.imag, 0.0])).toRotationMatrix()


def carry(planned: ReferenceMemory, begin: Place, guide: Guide, out: ReferenceMemory, *, palms: bool = True) -> None:
    """Palms, trunk and posture as they are planned about a base, about where that base is now and with its motion.

    Args:
        planned: As planned, in world.
        begin: The base that it is planned about.
        guide: Where that base is now, and how it moves.
        out: Overwritten.
        palms: Whether palms are carried, too; otherwise they stay as they are planned in world.
    """
    angle, rate, change = guide.place.heading - begin.heading, guide.velocity.turn, guide.change[1]
    axes, turn, (velocity, acceleration) = exp(1j * angle), about_z(angle), guide.motion()
    for source, row in zip(planned.palms, out.palms, strict=True):
        if not palms:
            row[:] = source
            continue
        x, y, z, vx, vy, vz, wx, wy, wz, ax, ay, az, bx, by, bz = source[9:].tolist()
        arm, v, w = (complex(x, y) - begin.point) * axes, complex(vx, vy) * axes, complex(wx, wy) * axes
        point, fast = guide.place.point + arm, velocity + 1j * rate * arm + v
        a = acceleration + (1j * change - rate * rate) * arm + 2j * rate * v + complex(ax, ay) * axes
        b = complex(bx, by) * axes + 1j * rate * w
        row[:9] = (turn @ source[:9].reshape(3, 3)).ravel()
        row[9:] = (
            point.real, point.imag, z, fast.real, fast.imag, vz, w.real, w.imag, wz + rate,
            a.real, a.imag, az, b.real, b.imag, bz + change,
        )  # fmt: skip
    for source, row in ((planned.pelvis, out.pelvis), (planned.torso, out.torso)):
        row[:9] = (turn @ source[:9].reshape(3, 3)).ravel()
        row[9:12], row[12:15] = turn @ source[9:12], turn @ source[12:15]
        row[11] += rate
        row[14] += change
    out.posture[:] = planned.posture


def hands_carried(rows: np.ndarray, begin: Place, end: Place) -> np.ndarray:
    """Motions of hands, rows (2, 40), where a base that went from one place to another, and rests, has taken them."""
    turn, motion = about_z(end.heading - begin.heading), HandMotion(rows.copy())
    for i, T in enumerate(motion.T_world_hand):
        point = end.world(begin.seen(complex(*T[:2, 3])))
        motion.p[i, :2] = point.real, point.imag
        motion.quat[i] = matrix_to_quaternion(turn @ T[:3, :3], "xyzw")
    for part in (motion.v, motion.a, motion.w, motion.alpha):
        part[:] = part @ turn.T
    return motion.rows


def at_rest(rows: np.ndarray) -> np.ndarray:
    """Motions of hands, rows (2, 40), that stay where these are."""
    motion = HandMotion(rows)
    return np.stack([rest_row(T, q) for T, q in zip(motion.T_world_hand, motion.q_finger, strict=True)])
