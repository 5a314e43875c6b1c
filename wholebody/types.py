"""Data that flows between controller, plant and reports."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import hypot, isfinite

import numpy as np

from wholebody.errors import InputError

_FLOAT = np.dtype(float)
_QUATERNION_TOLERANCE = 1e-3
"""Largest deviation of a base quaternion's norm from 1: above the rounding of float32 logs, below any real fault."""


@dataclass(frozen=True, slots=True)
class RobotState:
    """State of the robot in Pinocchio's convention and joint order. Not validated: see `check_state`.

    Attributes:
        time: [s]
        q: Configuration (7 + n,): base position in world [m], base quaternion xyzw, joint positions [rad].
        v: Velocity (6 + n,): base linear [m/s] and angular [rad/s] velocity in the base frame, joint speeds [rad/s].
    """

    time: float
    q: np.ndarray
    v: np.ndarray


@dataclass(frozen=True, slots=True)
class JointCommand:
    """What the motors are asked for, arrays (n,) in motor order. Not validated: see `check_command`.

    The actuator applies ``clip(tau + kp (q - q_meas) + kd (dq - dq_meas), -effort, effort)``.

    Attributes:
        time: Of the state that the command answers [s].
        q: Position [rad].
        dq: Velocity [rad/s].
        tau: Feed-forward torque [N m].
        kp: Stiffness [N m/rad].
        kd: Damping [N m s/rad].
    """

    time: float
    q: np.ndarray
    dq: np.ndarray
    tau: np.ndarray
    kp: np.ndarray
    kd: np.ndarray


class Status(Enum):
    """What the controller is doing, from best to worst."""

    TRACKING = "tracking"
    """Follows the chunk at its own speed."""
    SLOWED = "slowed"
    """Follows it as far, or as fast, as is safe."""
    HOLD = "hold"
    """Holds the last reference."""
    STOP = "stop"
    """Comes to a balanced stop."""
    DAMPING = "damping"
    """Standing is lost: joints only damped."""


@dataclass(frozen=True, slots=True)
class StatusReport:
    """A status with its reason.

    Attributes:
        status: What the controller is doing.
        reason: Stable reason code such as ``"out_of_reach"``; empty when all is well.
        detail: One sentence for a person: what, value and unit, bound.
    """

    status: Status
    reason: str = ""
    detail: str = ""


def check_state(state: RobotState, n_joints: int) -> RobotState:
    """Return the state unchanged, or say what is wrong with it.

    Args:
        state: The state.
        n_joints: Number of joints of the robot, 43 with hands and 29 without.

    Raises:
        InputError: If a shape is wrong, a value is not finite, or the base quaternion is not of unit length.
    """
    if not _is_sound(state, n_joints):
        _check_time("state", state.time)
        _check_array("state.q", state.q, 7 + n_joints)
        _check_array("state.v", state.v, 6 + n_joints)
    norm = hypot(*state.q[3:7].tolist())
    if not abs(norm - 1.0) <= _QUATERNION_TOLERANCE:
        raise InputError(
            f"state.q[3:7], the base quaternion xyzw, has norm {norm:.6g}; "
            f"it must be 1 within {_QUATERNION_TOLERANCE:g}",
            field="state.q",
            value=norm,
        )
    return state


def _is_sound(state: RobotState, n_joints: int) -> bool:
    """Whether a state is of the usual kind, in the least time: this is asked every tick."""
    q, v = state.q, state.v
    if type(q) is not np.ndarray or type(v) is not np.ndarray or q.dtype is not _FLOAT or v.dtype is not _FLOAT:
        return False
    # A sum of squares is finite only if all of its terms are.
    return q.shape == (7 + n_joints,) and v.shape == (6 + n_joints,) and isfinite(state.time + q.dot(q) + v.dot(v))


def check_command(command: JointCommand, n_joints: int) -> JointCommand:
    """Return the command unchanged, or say what is wrong with it.

    Args:
        command: The command.
        n_joints: Number of motors of the robot, 43 with hands and 29 without.

    Raises:
        InputError: If a shape is wrong, a value is not finite, or a gain is negative.
    """
    _check_time("command", command.time)
    for name in ("q", "dq", "tau", "kp", "kd"):
        _check_array(f"command.{name}", getattr(command, name), n_joints)
    for name in ("kp", "kd"):
        gains = getattr(command, name)
        if gains.min(initial=0.0) < 0.0:
            i = int(gains.argmin())
            raise InputError(
                f"command.{name}[{i}] is {gains[i]:g}; gains must be >= 0", field=f"command.{name}", index=i
            )
    return command


def _check_time(owner: str, time: float) -> None:
    if not isfinite(time):
        raise InputError(f"{owner}.time is {time}; it must be a finite time [s]", field=f"{owner}.time")


def _check_array(name: str, value: np.ndarray, size: int) -> None:
    if not isinstance(value, np.ndarray) or value.shape != (size,):
        shape = getattr(value, "shape", type(value).__name__)
        raise InputError(f"{name} has shape {shape}; expected ({size},)", field=name)
    if value.dtype.kind not in "fiu":
        raise InputError(f"{name} has dtype {value.dtype}; expected a real number type", field=name)
    # A sum of squares is finite only if all of its terms are, and takes a third of the time of looking at each.
    if not isfinite(value.dot(value)) and not np.isfinite(value).all():
        i = int(np.flatnonzero(~np.isfinite(value))[0])
        raise InputError(f"{name}[{i}] is {value[i]}; every entry must be finite", field=name, index=i)
