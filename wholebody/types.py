"""Data that flows between controller, plant and reports."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, StrEnum
from math import hypot, isfinite

import numpy as np

from wholebody.errors import InputError

_FLOAT = np.dtype(float)
QUATERNION_TOLERANCE = 1e-3
"""Largest deviation of a base quaternion's norm from 1 [no unit]; chosen: above the rounding of float32 logs, below any
real fault."""


@dataclass(frozen=True, slots=True)
class RobotState:
    """State of the robot in Pinocchio's convention and joint order. Not validated: see `check_state`.

    Attributes:
        time: [s]
        q: Configuration (7 + n,): base position in world [m], base quaternion xyzw, joint positions [rad].
        v: Velocity (6 + n,): base linear [m/s] and angular [rad/s] velocity in the base frame, joint speeds [rad/s].
        tau: Torques that the joints had until then, (n,), [N m]; None if they are not known. What hands carry is found
            from them; `check_state` does not look at them.
        covariance: Of orientation [rad], velocity [m/s] and position [m] in world of the IMU in the pelvis, (9, 9), as
            measured: what noise makes, not errors that stay, of encoders and the IMU's tilt. None if it is not known.
        stands: Whether the left and the right foot carries weight; None if it is not known.
    """

    time: float
    q: np.ndarray
    v: np.ndarray
    tau: np.ndarray | None = None
    covariance: np.ndarray | None = None
    stands: tuple[bool, bool] | None = None

    def age(self, now: float) -> float:
        """Time that has passed since it was measured, at a present time on the same clock [s]."""
        return now - self.time


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


class Reason(StrEnum):
    """Why: every stable reason code of statuses, refusals and verdicts. A member is its code, also in JSON.

    Attributes:
        status: What the controller does for this reason; None for what is found around it or after the run.
        sentence: What it says; ``docs/verdict.md`` has the same one.
    """

    status: Status | None
    sentence: str

    def __new__(cls, code: str, status: Status | None, sentence: str) -> Reason:
        """A member with its status and sentence."""
        reason = str.__new__(cls, code)
        reason._value_, reason.status, reason.sentence = code, status, sentence
        return reason

    @classmethod
    def _missing_(cls, value: object) -> Reason | None:
        """Reason that a code of an older version, as a recording has it, is called today."""
        return RENAMED[value].code if isinstance(value, str) and value in RENAMED else None

    # Violations of a verdict, from what ends a motion to what only marks it.
    FALL = "fall", None, "a body other than the feet is on the floor, the pelvis tilted or low, or the joints damped"
    REFUSED = "refused", None, "a chunk was not executed: its reason code, how often, and the first one's sentence"
    OUT_OF_REACH = "out_of_reach", Status.SLOWED, "how far the target of a hand was moved to where the plan gets"
    PALM_MOVED = "palm_moved", None, "how far a palm was commanded from what was asked, for no reason of its own"
    HAND_FORCE = "hand_force", None, "a hand is told to push harder than balance, its arm or its limit allow"
    TOO_FAST_FOR_BALANCE = "too_fast_for_balance", Status.SLOWED, "how many times slower a chunk was planned"
    FAR_START = "far_start", Status.SLOWED, "a chunk begins far from the hands, which go there within their limits"
    START_OFFSET = "start_offset", None, "the first step is a little off the hands, which go there within their limits"
    FINGER_LIMIT = "finger_limit", None, "a finger was asked past its range: the end of the range is commanded"
    BALANCE_EDGE = "balance_edge", None, "the centre of pressure came to the edge of the soles"
    TORQUE_LIMIT = (
        "torque_limit",
        None,
        "a motor was asked for more than its limit for over 0.05 s, or hardly holds where a chunk begins",
    )
    JOINT_LIMIT = "joint_limit", None, "a joint passed its position limit by more than 2 mrad"
    SELF_CONTACT = "self_contact", None, "two bodies of the robot touched"
    SCENE_CONTACT = "scene_contact", None, "the robot touched something else, its feet on the floor left out"
    CHUNK_NOTE = "chunk_note", None, "what decoding changed in a chunk or found odd, how often, and the first one"
    CHANGED_NUMBERS = "changed_numbers", None, "numbers of a chunk were clipped, or are not followed: the first ones"
    HANDS_ONLY = "hands_only", None, "root and legs of a motion are not followed: its hands are, where it stands"

    # A chunk is followed, but not as it was given.
    STEPS_JUMP = "steps_jump", Status.SLOWED, "steps jump: the nearest that a hand can do is followed"
    POSTURE_INFEASIBLE = "posture_infeasible", Status.SLOWED, "no plan is balanced: the robot stays near where it is"
    INTO_FLOOR = "into_floor", Status.SLOWED, "targets below the floor were lifted"
    NOISY_CHUNK = "noisy_chunk", Status.SLOWED, "steps scatter: the curve through them is followed"
    TOUCHING = "touching", Status.SLOWED, "a hand touches something: it pushes no harder than balance allows"
    PALM_MISSED = "palm_missed", Status.SLOWED, "the robot is off its command, late, or so slow that its plan waits"

    # There is nothing to follow, or it cannot be used.
    NO_CHUNK = "no_chunk", Status.HOLD, "no chunk has come yet: the stance is held"
    STARVED = "starved", Status.HOLD, "the chunk is over and there is no new one: its end is held"
    STATE_INVALID = "state_invalid", Status.HOLD, "the measured state is not finite: it is predicted along the plan"
    STATE_STALE = "state_stale", Status.HOLD, "no new state has come: it is predicted along the plan"
    STATE_FROZEN = "state_frozen", Status.HOLD, "a moving state repeats itself: it is predicted along the plan"
    STATE_JUMPED = "state_jumped", Status.HOLD, "the measured state jumps: it is predicted along the plan"
    STATE_OUT_OF_ORDER = "state_out_of_order", Status.HOLD, "an older state came later: it is predicted along the plan"
    STATE_FROM_FUTURE = "state_from_future", Status.HOLD, "a state is stamped ahead of the present: it is predicted"
    CLOCK_STEPPED = "clock_stepped", Status.HOLD, "a clock or the stamps of the states stepped: time goes on as before"
    CLOCK_INVALID = "clock_invalid", Status.HOLD, "the present time is not finite: that of the states goes on"
    LOWERING = "lowering", Status.HOLD, "the robot goes into its crouch, as it was asked to"
    LOWERED = "lowered", Status.HOLD, "the robot crouches on stiff legs: the last command may be kept, for ever"
    RAISING = "raising", Status.HOLD, "the robot stands up from its crouch, as it was asked to"
    WALKING = "walking", Status.HOLD, "the robot walks, as told: hands follow a chunk that a walk can, others wait"
    WALK_REFUSED = "walk_refused", Status.HOLD, "the robot was told to walk, and does not: what would do is said"
    CHUNK_INVALID = "chunk_invalid", Status.HOLD, "a chunk is malformed, not finite, or comes out of order"
    CHUNK_STALE = "chunk_stale", Status.HOLD, "a chunk was over, or its observation too old, when it came"
    CHUNK_FROM_FUTURE = "chunk_from_future", Status.HOLD, "a chunk's observation is later than the present"
    PLANNING_FAILED = "planning_failed", Status.HOLD, "no plan could be computed for a chunk"
    NOT_JOINED = "not_joined", Status.HOLD, "no balanced motion leads to the chunk yet: the one before is followed on"
    NOT_CLEARED = "not_cleared", Status.HOLD, "the gate holds a chunk: what could be done of it is another motion"
    GATE_LATE = "gate_late", Status.HOLD, "a plan and what the gate says of it came too late: neither is followed"

    # Balance needs everything, or is lost.
    OFF_PLAN = (
        "off_plan",
        Status.STOP,
        "the robot left its plan: it stands, hands let go of, until one from there comes",
    )
    RECOVERING = "recovering", Status.STOP, "the robot was pushed and takes a step: hands are let go of until it rests"
    DESCENDING = "descending", Status.STOP, "nothing keeps the robot from falling: it folds and is let down"
    HANDS_DROPPED = "hands_dropped", Status.STOP, "the whole-body program has a solution only without the hands"
    QP_FAILED = "qp_failed", Status.STOP, "the whole-body program has no solution: the last torques are held"
    STANDING_LOST = "standing_lost", Status.DAMPING, "the pelvis is tilted or low: the joints are damped"

    # The policy beside the loop; the chunk before is followed on.
    POLICY_RAISED = "policy_raised", None, "the policy raised an error"
    POLICY_HUNG = "policy_hung", None, "the policy has not answered in time"
    POLICY_DEAD = "policy_dead", None, "the process of the policy ended"
    CHUNK_FROM_BEFORE_RESET = "chunk_from_before_reset", None, "a chunk answers an observation of the episode before"
    CHUNK_WRONG_SPEC = "chunk_wrong_spec", None, "a chunk has another layout than the policy declared"
    CHUNK_WRONG_TIME = "chunk_wrong_time", None, "a chunk does not begin at the time of its observation"
    CHUNK_OUT_OF_ORDER = "chunk_out_of_order", None, "a chunk's time or number does not increase"


@dataclass(frozen=True, slots=True)
class StatusReport:
    """A status with its reason.

    Attributes:
        status: What the controller is doing.
        reason: Why; None when all is well.
        detail: One sentence for a person: what, value and unit, bound.
    """

    status: Status
    reason: Reason | None = None
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
    if not abs(norm - 1.0) <= QUATERNION_TOLERANCE:
        raise InputError(
            f"state.q[3:7], the base quaternion xyzw, has norm {norm:.6g}; "
            f"it must be 1 within {QUATERNION_TOLERANCE:g}",
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
        i = int(gains.argmin())
        if gains[i] < 0.0:
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


class PalmCause(StrEnum):
    """Why a palm was not where it was asked to be: what violations of one code differ in.

    Attributes:
        code: Reason code of violations with it.
        sentence: What it says; ``docs/verdict.md`` has the same one.
    """

    code: Reason
    sentence: str

    def __new__(cls, name: str, code: Reason, sentence: str) -> PalmCause:
        """A member with its reason code and sentence."""
        cause = str.__new__(cls, name)
        cause._value_, cause.code, cause.sentence = name, code, sentence
        return cause

    POSITION = "position", Reason.PALM_MOVED, "it was commanded elsewhere"
    ORIENTATION = "orientation", Reason.PALM_MOVED, "it was commanded turned away"
    LOST = "lost", Reason.PALM_MISSED, "it left where it was commanded to be"
    LATE = "late", Reason.PALM_MISSED, "it was not where it was asked to be at the time of the step"
    WAITING = "waiting", Reason.PALM_MISSED, "the robot lags behind its plan, which waits for it"


RENAMED = {
    "moved": PalmCause.POSITION,
    "turned": PalmCause.ORIENTATION,
    "not_followed": PalmCause.LOST,
    "tracking_error": PalmCause.LATE,
    "tracking": PalmCause.WAITING,
}
"""Reason codes before version 2 of the verdict's JSON, and what violations that had them have as their cause."""
