"""Joint acceleration bounds that keep position and velocity limits viable."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class JointLimits(NamedTuple):
    """What joints can do, shape (n,) each; also a table (5, n), as the compiled program has it.

    Attributes:
        q_min, q_max: Position bounds [rad].
        dq_max: Speed bounds [rad/s].
        ddq_max: Acceleration bounds [rad/s^2].
        brake: Deceleration that a joint is trusted to find when it has to stop, at most ddq_max, [rad/s^2]. Less than
            ddq_max, since other joints and the torque limits want their share.
    """

    q_min: np.ndarray
    q_max: np.ndarray
    dq_max: np.ndarray
    ddq_max: np.ndarray
    brake: np.ndarray


def viable_acceleration_bounds(
    q: np.ndarray, dq: np.ndarray, limits: JointLimits, dt: float
) -> tuple[np.ndarray, np.ndarray]:
    r"""Accelerations, constant over ``dt``, after which every limit can still be kept for ever.

    Three conditions a side: the position after ``dt`` is inside, the velocity after ``dt`` is inside, and from the
    state after ``dt`` full braking stops before the bound (viability). A state that is already lost gives the
    strongest braking instead of an empty interval.

    Args:
        q: Positions, shape (n,), [rad].
        dq: Speeds, shape (n,), [rad/s].
        limits: Of the joints.
        dt: Control period [s].

    Returns:
        Lower and upper acceleration bounds, shape (n,), lower <= upper, within +-ddq_max.

    Source:
        Del Prete 2018, "Joint Position and Velocity Bounds in Discrete-Time Acceleration/Torque Control", RA-L.
    """
    q_min, q_max, dq_max, ddq_max, brake = limits
    upper = _upper(q, dq, q_max, dq_max, brake, dt)
    lower = -_upper(-q, -dq, -q_min, dq_max, brake, dt)
    upper = np.clip(upper, -ddq_max, ddq_max)
    lower = np.clip(lower, -ddq_max, ddq_max)
    # Both sides want opposite braking only outside the limits or at a pinched range: the middle is the least harm.
    crossed = lower > upper
    middle = 0.5 * (lower + upper)
    return np.where(crossed, middle, lower), np.where(crossed, middle, upper)


def _upper(
    q: np.ndarray, dq: np.ndarray, q_max: np.ndarray, dq_max: np.ndarray, brake: np.ndarray, dt: float
) -> np.ndarray:
    distance = q_max - q
    by_velocity = (dq_max - dq) / dt
    # Position after dt; if the joint would turn back within dt, the peak in between counts instead.
    by_position = 2.0 * (distance - dt * dq) / dt**2
    turns = (dq > 0.0) & (by_position < -dq / dt)
    peak = -(dq**2) / (2.0 * np.where(distance > 0.0, distance, np.inf))
    by_position = np.where(turns, np.where(distance > 0.0, peak, -brake), by_position)
    # Viability: speed after dt at most sqrt(2 brake (distance left)), a quadratic in the acceleration.
    b = dt * (2.0 * dq + brake * dt)
    c = dq**2 - 2.0 * brake * (distance - dt * dq)
    discriminant = b**2 - 4.0 * dt**2 * c
    root = (-b + np.sqrt(np.maximum(discriminant, 0.0))) / (2.0 * dt**2)
    by_viability = np.where(discriminant >= 0.0, np.maximum(root, -dq / dt), -dq / dt)
    return np.minimum(np.minimum(by_velocity, by_position), by_viability)
