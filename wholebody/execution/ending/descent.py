"""A controlled descent: legs fold and brake, hips hold the trunk up, arms meet the floor slowly and give way.

Tipped over as it stands, a robot of 0.7 m meets the floor with its head at 3 to 10 m/s. Folded in 0.4 s it has little
left to fall: knees, or the pelvis, come down first, and from then on joints brake what is left. Falling aside or back
it turns its chest away, and comes down over hip and shoulder. Nothing is sensed of the floor: it is under the lowest of
soles, knees and pelvis.

Source:
    Fujiwara, Kanehiro, Kajita, Kaneko, Yokoi and Hirukawa 2002, "UKEMI: Falling Motion Control to Minimize Damage to
    Biped Humanoid Robot", IROS: fold first, be soft from the impact on.
    Samy and Kheddar 2015, "Falls Control using Posture Reshaping and Active Compliance", Humanoids: gains lowered at
    the impact, never motors off.
"""

from __future__ import annotations

from cmath import exp, phase
from dataclasses import dataclass
from math import atan2

import numpy as np
import pinocchio as pin

from wholebody.robot.state import Robot
from wholebody.types import JointCommand, RobotState


@dataclass(frozen=True, kw_only=True)
class Fold:
    """Postures of a descent, and how firmly the trunk is held in it.

    Attributes:
        seconds: Time in which legs and waist are folded [s].
        knee, ankle: Angles of the legs [rad].
        apart: Angles of the hips outwards, on the side to which the robot falls and on the other one [rad].
        lean: Angles of the pelvis from the vertical, forwards and to the side to which it falls, which the hips hold
            [rad].
        waist: Angles of the waist: forwards, towards the side to which it falls, and its turn there [rad].
        shoulder, elbow: Angles of the arms, forwards of the shoulder negative [rad].
        spread: Angles of the shoulders outwards, on the side to which it falls and on the other one [rad].
        low: Height of the pelvis over the floor from which on the joints give way [m].
        knee_low, lean_low: The same as above, from then on [rad].
        firm, firm_low: Stiffness with which the hips hold the trunk, before and from then on [N m/rad].
        damped: Damping of legs, and of the trunk by the hips [N m s/rad].
    """

    seconds: float
    knee: float
    ankle: float
    apart: tuple[float, float]
    lean: tuple[float, float]
    waist: tuple[float, float, float]
    shoulder: float
    elbow: float
    spread: tuple[float, float]
    low: float
    knee_low: float
    lean_low: float
    firm: float
    firm_low: float
    damped: tuple[float, float]


AHEAD = Fold(
    seconds=0.37, knee=2.12, ankle=-0.83, apart=(0.25, 0.1), lean=(0.45, 0.0), waist=(-0.08, 0.0, 0.0),
    shoulder=-0.87, elbow=0.61, spread=(0.29, 0.3), low=0.4, knee_low=2.23, lean_low=1.01, firm=172.0,
    firm_low=47.0, damped=(6.8, 18.5),
)  # fmt: skip
"""Onto the knees, trunk up, palms ahead of it [units as in `Fold`]; by trial, in simulated falls by pushes of 1.2 to
2.5 times what is stood."""
ROUND = Fold(
    seconds=0.31, knee=2.08, ankle=-0.69, apart=(0.09, 0.33), lean=(0.57, 0.15), waist=(0.47, -0.15, -1.15),
    shoulder=-0.14, elbow=0.58, spread=(0.08, 0.0), low=0.38, knee_low=1.7, lean_low=0.54, firm=200.0, firm_low=47.0,
    damped=(5.4, 4.8),
)  # fmt: skip
"""Over hip and shoulder, bent, the chest turned away from the floor, arms at the body [units as in `Fold`]; by trial,
as `AHEAD`."""
FORWARDS = 1.0
"""Angle of the way of a fall from straight ahead up to which it is one onto knees and palms [rad]; measured: at 45
degrees the head stays up so, at 67 it does not."""
LEG_KP = 150.0
"""Stiffness of legs [N m/rad]; chosen: that of Unitree's own gains."""
WAIST_KP, ANKLE_KP, SMALL_KD = 250.0, 40.0, (5.0, 2.0, 1.0)
"""Stiffness of waist and ankles [N m/rad], damping of waist, ankles and wrists [N m s/rad]; Unitree's own gains but for
the wrists, chosen: what is too light for more shakes."""
LOW_KD, SOFTER = (10.0, 20.0, 17.0), 0.21
"""Damping of knees, hips and waist once the robot is low [N m s/rad], and time in which it is as much [s]; by trial:
with 8, as of a robot that lies, the trunk comes down at 2 to 4 m/s."""
FAR = 0.8
"""Largest angle of the trunk from where it is to be that the hips answer [rad]; chosen: all of their torque."""
ARM_KP, ARM_KD, GIVING_KD = 40.0, 3.0, 11.0
"""Stiffness [N m/rad] and damping of arms, and damping of those that are drawn in [N m s/rad]; by trial."""
SOFT_KP, SOFT_KD = 25.0, 6.0
"""Stiffness [N m/rad] and damping [N m s/rad] of an arm that has met the floor; by trial."""
TOUCH_SPEED, SLOWER, DRAWN = 0.15, 5.8, 12.0
"""Speed with which an arm comes to the floor [m/s], how much faster it may be per height [1/s], and speed of its joints
up to which it is drawn in for that [rad/s]; by trial."""
NEAR = (0.08, 0.06, 0.06)
"""Heights of palm point, wrist and elbow at which they touch the floor [m]; derived from the shapes of hand and
forearm."""
ROUND_OF = 0.07
"""Height of knees and pelvis over the floor that they lie on [m]; derived from their shapes."""
SOLVED, FORESEEN = 0.08, 0.02
"""Regularisation of the speeds by which an arm is drawn in [m^2], and time for which its positions lead them [s];
chosen."""
NEEDED = ("knee", "ankle_pitch", "hip_pitch", "hip_roll", "shoulder_pitch", "shoulder_roll", "elbow")
"""Joints of both sides that a robot has to have to be let down."""
STRAIGHT = ("hip_yaw", "ankle_roll", "shoulder_yaw", "wrist_roll", "wrist_pitch", "wrist_yaw")
"""Joints that are straight in every fold, of those that the robot has."""
WITHIN = 0.05
"""Distance of commanded angles from the ends of joints [rad]; chosen."""


class Descent:
    """Lets a robot down that falls, tick by tick.

    Args:
        robot: Its model.

    Attributes:
        known: Whether the folds are for a robot with such joints; no other is let down.
    """

    def __init__(self, robot: Robot) -> None:
        spec = self._spec = robot.spec
        self._robot = robot
        self._both = {part: self._pair(part) for part in (*NEEDED, *STRAIGHT)}
        self.known = all(len(self._both[part]) == len(spec.tools) for part in NEEDED)
        self._low, self._high = spec.position_min + WITHIN, spec.position_max - WITHIN
        self._arms = [spec.limbs[f"{tool.side}_arm"] for tool in spec.tools]
        elbows = [next((spec.joint_names[i] for i in arm if spec.joints[i].part == "elbow"), "") for arm in self._arms]
        if self.known:
            knees = [robot.frame_id(spec.joint_names[i]) for i in self._both["knee"]]
            self._rounds = [(one, np.array([0.0, 0.0, -ROUND_OF])) for one in (*knees, robot.frame_id(spec.base_body))]
            self._soles = [(robot.frame_id(foot.frame), point) for foot in spec.feet for point in foot.points]
            ends = zip(spec.tools, elbows, strict=True)
            self._guarded = [
                [robot.frame_id(name) for name in (tool.palm_frame, tool.wrist_frame, elbow)] for tool, elbow in ends
            ]

    def begin(self, state: RobotState, way: complex) -> None:
        """Begin with a state, in the direction to which the robot falls, ``x + iy`` in world."""
        robot = self._robot
        R = pin.Quaternion(state.q[3:7]).matrix()
        angle = phase(way * exp(-1j * atan2(R[1, 0], R[0, 0])))
        self._fold, self._side = AHEAD if abs(angle) < FORWARDS else ROUND, 1.0 if angle >= 0.0 else -1.0
        self._time, self._low_since = state.time, None
        self._begin = np.clip(state.q[7:][robot.pin_to_motor], self._low, self._high)
        self._given: list[np.ndarray | None] = [None] * len(self._arms)
        self._goal = self._folded()

    def _pair(self, part: str) -> list[int]:
        """Positions of the left and the right joint of that name in motor order, of those that the robot has."""
        names = [f"{tool.side}_{part}_joint" for tool in self._spec.tools]
        return [self._spec.joint_names.index(name) for name in names if name in self._spec.joint_names]

    def _folded(self) -> np.ndarray:
        """Angles of all joints in the fold, motor order; those of the hips' pitch are whatever holds the trunk."""
        fold, q = self._fold, self._begin.copy()
        for part, angle in (("knee", fold.knee), ("ankle_pitch", fold.ankle), ("shoulder_pitch", fold.shoulder)):
            q[self._both[part]] = angle
        q[self._both["elbow"]] = fold.elbow
        q[[i for part in STRAIGHT for i in self._both[part]]] = 0.0
        for part, (near, far) in (("hip_roll", fold.apart), ("shoulder_roll", fold.spread)):
            q[self._both[part]] = (near, -far) if self._side > 0.0 else (far, -near)
        bent, aside, turned = fold.waist
        waist = {"pitch": bent, "roll": -self._side * aside, "yaw": self._side * turned}
        for i in self._spec.limbs["waist"]:
            q[i] = waist.get(self._spec.joint_names[i].split("_")[-2], q[i])
        if self._spec.hand_closed:
            q[self._spec.is_finger] = self._spec.hand_closed
        return np.clip(q, self._low, self._high)

    def command(self, state: RobotState) -> JointCommand:
        """Command for one control period: positions, speeds and gains, no torques."""
        spec, order, fold = self._spec, self._robot.pin_to_motor, self._fold
        angles, rates, elapsed = state.q[7:][order], state.v[6:][order], state.time - self._time
        self._look_under(state)
        if self._low_since is None and state.q[2] - self._floor < fold.low:
            self._low_since = elapsed
        low = 0.0 if self._low_since is None else _smooth((elapsed - self._low_since) / SOFTER)
        n, q = spec.n_joints, self._begin + _smooth(elapsed / fold.seconds) * (self._goal - self._begin)
        told = _Told(q, np.zeros(n), np.full(n, LEG_KP), np.full(n, fold.damped[0]))
        knees, ankles = self._both["knee"], self._both["ankle_pitch"] + self._both["ankle_roll"]
        told.q[knees] += low * (fold.knee_low - q[knees])
        told.kd[knees] += low * (LOW_KD[0] - fold.damped[0])
        told.kp[ankles], told.kd[ankles] = ANKLE_KP, SMALL_KD[1]
        waist, fingers = spec.limbs["waist"], spec.is_finger
        told.kp[waist], told.kd[waist] = WAIST_KP, SMALL_KD[0] + low * (LOW_KD[2] - SMALL_KD[0])
        told.kp[fingers], told.kd[fingers] = spec.kp[fingers], spec.kd[fingers]
        self._hold_trunk(state, low, angles, told)
        self._lead_arms(state, angles, rates, told)
        return JointCommand(state.time, np.clip(told.q, self._low, self._high), told.v, np.zeros(n), told.kp, told.kd)

    def _look_under(self, state: RobotState) -> None:
        """Take the lowest of soles, knees and pelvis to be on the floor, at rest.

        The estimator of a real robot takes the soles to stand, and loses its height where they tip.
        """
        robot, data = self._robot, self._robot.scratch
        pin.computeJointJacobians(robot.model, data, state.q)
        pin.updateFramePlacements(robot.model, data)
        arms = [data.oMf[frame].rotation @ point for frame, point in self._soles]
        points = [*zip((frame for frame, _ in self._soles), arms, strict=True), *self._rounds]
        frame, arm = min(points, key=lambda one: data.oMf[one[0]].translation[2] + one[1][2])
        v = pin.getFrameJacobian(robot.model, data, frame, pin.LOCAL_WORLD_ALIGNED) @ state.v
        self._floor = float(data.oMf[frame].translation[2] + arm[2])
        self._rises = float(v[2] + v[3] * arm[1] - v[4] * arm[0])

    def _hold_trunk(self, state: RobotState, low: float, angles: np.ndarray, told: _Told) -> None:
        """Hold the pelvis at its lean by the hips, whatever the legs do."""
        fold = self._fold
        x, y, z, w = state.q[3:7].tolist()
        up = 2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)
        lean = fold.lean[0] + low * (fold.lean_low - fold.lean[0])
        firm = fold.firm + low * (fold.firm_low - fold.firm)
        damped = fold.damped[0] + low * LOW_KD[1]
        pitch = float(np.clip(atan2(-up[0], up[2]) - lean, -FAR, FAR))
        roll = float(np.clip(atan2(up[1], up[2]) + self._side * fold.lean[1], -FAR, FAR))
        pitches, rolls = self._both["hip_pitch"], self._both["hip_roll"]
        told.q[pitches], told.kp[pitches] = angles[pitches] + pitch, firm
        told.q[rolls] += 0.5 * firm * roll / LEG_KP
        told.kd[pitches] = told.kd[rolls] = damped
        told.v[pitches] = fold.damped[1] * state.v[4] / damped
        told.v[rolls] = 0.5 * fold.damped[1] * state.v[3] / damped

    def _lead_arms(self, state: RobotState, angles: np.ndarray, rates: np.ndarray, told: _Told) -> None:
        """Draw arms in so that they come to the floor slowly; let them give way once they are there."""
        robot, data = self._robot, self._robot.scratch
        for k, (arm, frames) in enumerate(zip(self._arms, self._guarded, strict=True)):
            told.kp[arm], told.kd[arm] = ARM_KP, ARM_KD
            rows, lacking, down = [], [], False
            for frame, near in zip(frames, NEAR, strict=True):
                J = pin.getFrameJacobian(robot.model, data, frame, pin.LOCAL_WORLD_ALIGNED)[2]
                row = J[6:][robot.pin_to_motor][arm]
                height = max(float(data.oMf[frame].translation[2]) - self._floor - near, 0.0)
                slower = -(TOUCH_SPEED + SLOWER * height) - float(J @ state.v - row @ rates[arm] - self._rises)
                down = down or height == 0.0
                if slower > 0.0:
                    rows.append(row)
                    lacking.append(slower)
            if rows:
                A = np.array(rows)
                drawn = A.T @ np.linalg.solve(A @ A.T + SOLVED * np.eye(len(A)), np.array(lacking))
                told.v[arm] = np.clip(drawn, -DRAWN, DRAWN)
                self._given[k] = np.clip(angles[arm] + FORESEEN * told.v[arm], self._low[arm], self._high[arm])
                told.kd[arm] = GIVING_KD
            if self._given[k] is not None:
                told.q[arm] = self._given[k]
                if down and not rows:
                    told.kp[arm], told.kd[arm] = SOFT_KP, SOFT_KD
        wrists = self._spec.parts("wrist")
        told.kd[wrists] = SMALL_KD[2]


@dataclass(slots=True)
class _Told:
    """Positions, speeds and gains of a command that is being made, motor order, shape (n_joints,) each."""

    q: np.ndarray
    v: np.ndarray
    kp: np.ndarray
    kd: np.ndarray


def _smooth(share: float) -> float:
    """Share of a way, 0 to 1, at rest at both ends."""
    share = min(max(share, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)
