"""What a hand feels and may push with, as one row of numbers that tasks and programs share, and what bounds it."""

from __future__ import annotations

import numpy as np

SHARE, FORCE, MOMENT, PUSH_MAX, MOBILITY, TOLD = 0, 1, 4, 7, 8, 9
STIFFNESS, AXIS_MAX, HEADING, TOUCH = 12, 15, 18, 20
"""Where in the row are: how far the hand touches (0 to 1); force [N] and moment [N m] on it at the palm point, in world
axes (3 each); the largest acceleration that it pushes with [m/s^2], one over its apparent mass [1/kg]; the acceleration
with which the hand is told to push, in world axes (3) [m/s^2]; along each axis of the stance (ahead, to the left, up)
its stiffness [1/s^2] and the largest acceleration (3 each) [m/s^2]; cosine and sine of the stance's heading; and the
row's length."""
TOLD_GIVE = 0.2
"""Share by which a hand pushes harder or less than it is told where it is not at its place [no unit]; chosen: a press
of 10 N within 3 N, and friction that is told is overcome."""
TURN_TOUCHING = 20.0
"""Largest proportional angular acceleration of a hand that touches [rad/s^2]; chosen: a third of a free hand's, so that
a palm lies down on what it meets."""
LEAN_MAX = 0.04
"""Distance by which the centre of mass can be leant against any force [m]; derived: half of the way from the middle of
a sole to its edge."""
STRETCHED, STRETCHED_END = 0.95, 0.975
"""Distance of a palm from its shoulder, a share of the way along upper arm and forearm, from which a hand that is drawn
outwards resists more than it may push, and at which it yields no more [no unit]; measured: at 0.97 a hand that yielded
took the body along, and it fell."""
TORQUE_SHARE, TOLD_SHARE = 0.85, 0.9
"""Share of a joint's torque that a push may use, with what the arm's weight takes, and share of the force that tips
with which a hand pushes that is told to [no unit]; chosen: the rest turns the hand, and holds the balance."""


def push_limits(*said: np.ndarray | tuple[float, ...] | float) -> tuple[np.ndarray, np.ndarray]:
    """Limits that hold together: on the size of both hands' pushes (2,), and along each axis of the stance (2, 3) [N].

    Args:
        said: Each a number, one a hand (2,), one an axis (3,), or one a hand and axis (2, 3). Where axes have their
            own, the largest of them bounds the size too.
    """
    size, axes = np.full(2, np.inf), np.full((2, 3), np.inf)
    for limit in map(np.asarray, said):
        by_axis = limit.shape[-1:] == (3,)
        size = np.minimum(size, limit.max(axis=-1) if by_axis else limit)
        axes = np.minimum(axes, limit) if by_axis else axes
    return size, axes


def stance_axes(heading: np.ndarray) -> np.ndarray:
    """Axes of the stance in world, columns of a (3, 3), from cosine and sine of its heading."""
    cos, sin = heading
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def tipping_share(
    pushes: np.ndarray, palms: np.ndarray, com: np.ndarray, weight: float, normals: np.ndarray, offsets: np.ndarray
) -> float:
    """How many times forces on palms may grow until the centre of pressure is at the edge of the support.

    With forces f on palms at p, the weight m g and the centre of mass c over the floor, the centre of pressure is at
    ``(m g c + sum of (p_z f_xy - f_z p_xy)) / (m g - sum of f_z)``, and has to stay inside every edge ``n . x <= b``.

    Args:
        pushes: Forces on the robot, shape (k, 3), [N].
        palms: Where, in world, shape (k, 3), [m].
        com: Centre of mass, shape (3,), [m].
        weight: [N].
        normals: Outward ones of the edges of the support, shape (n, 2).
        offsets: Of the edges along them, shape (n,), [m].

    Returns:
        Infinity where they do not tip it.
    """
    moments = (palms[:, 2:] * pushes[:, :2] - pushes[:, 2:] * palms[:, :2]).sum(axis=0)
    room, lever = weight * (offsets - normals @ com[:2]), normals @ moments + offsets * pushes[:, 2].sum()
    tips = lever > 1e-9
    return float(np.min(np.maximum(room[tips], 0.0) / lever[tips], initial=np.inf))


def arm_force(lever: np.ndarray, spent: np.ndarray, torques: np.ndarray) -> float:
    """Force of a palm along a direction at which a joint of its arm has no torque left [N].

    Args:
        lever: Torque of each joint for a force of 1 along it, shape (n,), [m].
        spent: Torque that each one needs without it, shape (n,), [N m].
        torques: Largest of each, shape (n,), [N m].
    """
    left = np.maximum(TORQUE_SHARE * torques - np.sign(lever) * spent, 0.0)
    return float(np.min(left / np.maximum(np.abs(lever), 1e-6)))


def stretched(shoulder: np.ndarray, elbow: np.ndarray, palm: np.ndarray, force: np.ndarray) -> float:
    """How near an arm is to its end along a force (3,) on its palm: from 1 on it gives no more, up to 0 all of it.

    Args:
        shoulder: Where, shape (3,), [m].
        elbow: Likewise.
        palm: Likewise.
        force: On the palm, of which the direction counts.
    """
    arm = palm - shoulder
    if arm @ force <= 0.0:
        return 0.0
    way = np.linalg.norm(elbow - shoulder) + np.linalg.norm(palm - elbow)
    return float((np.linalg.norm(arm) / way - STRETCHED) / (STRETCHED_END - STRETCHED))
