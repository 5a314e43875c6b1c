"""The reach script of the tick benchmark: two wrists on slow sines, fingers closing and opening, perfect integration.

The same robot, posture, frequencies and amplitudes for every controller that is timed on it, so that times and errors
compare; written for numpy and Pinocchio alone.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from wholebody.control.reference_packet import BodyReference, PackedReference, PalmReference
from wholebody.robot.state import Robot
from wholebody.robot.support_polygon import convex_polygon

POSTURE = {
    "hip_pitch": -0.25,
    "knee": 0.5,
    "ankle_pitch": -0.25,
    "shoulder_pitch": 0.1,
    "shoulder_roll": 0.25,
    "elbow": 0.4,
}
"""Joint angles of the start, both sides; rolls of the right side are negative [rad]; definition of the script."""
FINGER_MARGIN = 0.1
"""Distance of the fingers from their limits at the start [rad]; definition of the script."""
ANKLE_HEIGHT = 0.035
"""Height of the ankle frame above the sole [m]; from the URDF."""
COM_AHEAD = 0.035
"""Distance of the middle of the soles ahead of the ankles [m]; from the URDF."""
AXIS = np.array([0.4, 0.7, 0.6])
"""Axis about which the left wrist turns, in wrist axes, normalised where it is used [no unit]; the right one's is
mirrored in y; definition of the script."""


def start_configuration(robot: Robot) -> np.ndarray:
    """Where the script begins, shape (nq,)."""
    model = robot.model
    q = pin.neutral(model)
    for j, name in enumerate(robot.joint_names):
        if "_hand_" in name:
            low, high = model.lowerPositionLimit[7 + j], model.upperPositionLimit[7 + j]
            q[7 + j] = np.clip(0.0, low + FINGER_MARGIN, high - FINGER_MARGIN)
            continue
        part = name.removeprefix("left_").removeprefix("right_").removesuffix("_joint")
        sign = -1.0 if part.endswith("_roll") and name.startswith("right") else 1.0
        q[7 + j] = sign * POSTURE.get(part, 0.0)
    robot.update(q, np.zeros(model.nv))
    q[2] -= robot.pose(robot.spec.feet[0].frame).translation[2] - ANKLE_HEIGHT
    return q


class ReachScript:
    """Targets of every tick, computed before the clock starts.

    Args:
        spec: The robot.
        ticks: Number of ticks.
        dt: Control period [s].
        shift: How far forward, outward and up both hands are brought from the start, in the first second [m].

    Attributes:
        q0: Start, shape (nq,).
        wrists: Positions (2, ticks, 3) and rotations (2, ticks, 3, 3) of the wrists in world.
    """

    def __init__(
        self, spec: RobotSpec, ticks: int, dt: float, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> None:
        self.spec, self.robot, self.dt = spec, Robot(spec), dt
        robot = self.robot
        self.q0 = start_configuration(robot)
        robot.update(self.q0, np.zeros(robot.nv))
        t = dt * np.arange(ticks + 2)
        s = np.clip(t, 0.0, 1.0)
        self._blend = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
        self._com = robot.com.copy()
        feet = [robot.pose(foot.frame).copy() for foot in spec.feet]
        self._com[:2] = 0.5 * (feet[0].translation + feet[1].translation)[:2] + [COM_AHEAD, 0.0]
        points = [T.act(p)[:2] for T, foot in zip(feet, spec.feet, strict=True) for p in foot.points]
        self.support, self.feet = convex_polygon(np.array(points)), feet
        self._bodies = [robot.pose(name).rotation.copy() for name in (spec.base_body, spec.torso_body)]
        self._palms = [self._hand(side, t, np.array(shift)) for side in (0, 1)]
        self._posture = self._fingers(t)
        self._rates = np.gradient(self._posture[:, 7:], dt, axis=0)
        self._still = np.zeros(robot.n_joints)
        self._rows = np.array([self.reference(k).pack() for k in range(len(t))])

    def _hand(self, side: int, t: np.ndarray, shift: np.ndarray) -> tuple[np.ndarray, ...]:
        """Positions, rotations, twists and accelerations of one palm; the wrist's are kept in ``wrists``."""
        tool, sign, phase = self.spec.tools[side], 1.0 - 2.0 * side, 0.7 * side
        T = self.robot.pose(tool.wrist_frame)
        turn, blend, dt = 2.0 * np.pi * t, self._blend, self.dt
        sway = np.stack(
            [
                0.10 * np.sin(0.25 * turn + phase),
                0.02 * sign + 0.05 * np.sin(0.5 * turn + 0.3),
                0.03 + 0.10 * np.sin(0.35 * turn + phase),
            ],
            axis=1,
        )
        p = T.translation + (sway + shift * [1.0, sign, 1.0]) * blend[:, None]
        angle = 0.30 * np.sin(0.25 * turn + phase) * blend
        axis = AXIS * [1.0, sign, 1.0]
        axis /= np.linalg.norm(axis)
        R = np.array([T.rotation @ pin.exp3(axis * a) for a in angle])
        w = np.gradient(angle, dt)[:, None] * (T.rotation @ axis)
        palm = p + R @ np.array(tool.palm_offset)
        v = np.gradient(palm, dt, axis=0)
        twist = np.hstack([v, w])
        if side == 0:
            self.wrists = ([], [])
        self.wrists[0].append(p)
        self.wrists[1].append(R)
        return palm, R, twist, np.gradient(twist, dt, axis=0)

    def _fingers(self, t: np.ndarray) -> np.ndarray:
        """Posture with the fingers closing six tenths of their way and opening again, shape (ticks + 2, nq)."""
        model, posture = self.robot.model, np.tile(self.q0, (len(t), 1))
        share = 0.6 * (0.5 - 0.5 * np.cos(0.5 * np.pi * t)) * self._blend
        for j, name in enumerate(self.robot.joint_names):
            if "_hand_" in name:
                low, high = model.lowerPositionLimit[7 + j], model.upperPositionLimit[7 + j]
                far = low if abs(low) > abs(high) else high
                posture[:, 7 + j] += share * (far - self.q0[7 + j])
        return posture

    def reference(self, k: int) -> BodyReference:
        """What the controller is given at tick ``k``."""
        zero = np.zeros(3)
        palms = tuple(
            PalmReference(T_world=pin.SE3(R[k], p[k]), twist=twist[k], acceleration=a[k])
            for p, R, twist, a in self._palms
        )
        return BodyReference(
            palms=palms,
            q=self._posture[k],
            dq=self._rates[k],
            ddq=self._still,
            pelvis=(self._bodies[0], zero, zero),
            torso=(self._bodies[1], zero, zero),
            height=(self.q0[2], 0.0, 0.0),
            com=(self._com, zero, zero),
            momentum=(zero, zero),
        )

    def packed(self, k: int) -> PackedReference:
        """References of the script, packed before the clock starts."""
        return PackedReference(self._rows[k])
