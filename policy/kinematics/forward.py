"""Wrists, torso and soles of a robot from joint angles, relative to the pelvis. Pinocchio loads at the first use."""

from __future__ import annotations

from functools import lru_cache
from threading import local
from typing import TYPE_CHECKING

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.errors import PolicyError

if TYPE_CHECKING:
    import pinocchio as pin

IK_TOLERANCE = 1e-6
"""Largest pose error of a solved arm, metres and radians in one norm."""
_IK_ITERATIONS = 200
_DAMPING_MAX = 1e4
"""Steps are shorter than a microradian by then: a local minimum."""
_STALLED_MAX = 15
"""Iterations in a row that gain less than 1 %: out of reach."""
_IK_STEP_MAX = 0.3
"""Largest joint step of an iteration [rad]: the linearisation does not reach further."""
_LIMIT_MARGIN = 0.15
"""Share of a joint's range, at each end, in which the redundant joints move away from the limit."""
_RETREAT = 0.3
"""Share of the way out of that margin that the first iteration goes."""


class Kinematics:
    """Forward kinematics of a robot with its pelvis at the origin; any number of threads may ask.

    Use `kinematics()`, which shares one instance: making one parses the URDF (about 0.1 s).
    """

    def __init__(self, robot: RobotSpec) -> None:
        import pinocchio as pin

        from models.pinocchio_model import frame_id, load_pinocchio

        self._pin, self._n = pin, len(robot.body_joints)
        self.model = load_pinocchio(robot)
        self._own = local()
        self.frames = {
            "lhand": frame_id(self.model, robot.tool("left").wrist_frame),
            "rhand": frame_id(self.model, robot.tool("right").wrist_frame),
            "torso": frame_id(self.model, robot.torso_body),
        }
        self._soles = {foot.side: (frame_id(self.model, foot.frame), foot.sole_center) for foot in robot.feet}
        self._neutral = pin.neutral(self.model)
        self.idx_q = np.array([self.model.joints[self.model.getJointId(name)].idx_q for name in robot.body_joints])
        """Entry of each body joint (motor order) in Pinocchio's configuration."""
        self.idx_v = np.array([self.model.joints[self.model.getJointId(name)].idx_v for name in robot.body_joints])
        """Entry of each body joint (motor order) in Pinocchio's velocity."""

    @property
    def data(self) -> pin.Data:
        """What Pinocchio computes in, one a thread."""
        if not hasattr(self._own, "data"):
            self._own.data = self.model.createData()
        return self._own.data

    def poses(self, q_body: np.ndarray) -> dict[str, np.ndarray]:
        """``T_base_lhand``, ``T_base_rhand`` and ``T_base_torso`` under the keys lhand, rhand, torso.

        Args:
            q_body: Body joints in motor order, shape (m,) or (n, m), [rad].

        Returns:
            Arrays of shape (4, 4) or (n, 4, 4).

        Raises:
            PolicyError: If the last axis is not that of the body joints.
        """
        q_body = np.asarray(q_body, dtype=float)
        if q_body.shape[-1:] != (self._n,):
            raise PolicyError(f"q_body has shape {q_body.shape}; its last axis must be the {self._n} body joints")
        rows = q_body.reshape(-1, self._n)
        found = {name: np.empty((len(rows), 4, 4)) for name in self.frames}
        for i, row in enumerate(rows):
            self._forward(row)
            for name, frame in self.frames.items():
                found[name][i] = self._pin.updateFramePlacement(self.model, self.data, frame).homogeneous
        return {name: T.reshape(*q_body.shape[:-1], 4, 4) for name, T in found.items()}

    def soles(self, q_body: np.ndarray) -> dict[str, np.ndarray]:
        """Soles in the pelvis, at the middle of their contact points with the axes of the foot.

        Args:
            q_body: Body joints in motor order, shape (n, m), [rad].

        Returns:
            Arrays of shape (n, 4, 4) under the keys left and right.
        """
        found = {side: np.empty((len(q_body), 4, 4)) for side in self._soles}
        for i, row in enumerate(q_body):
            self._forward(row)
            for side, (frame, center) in self._soles.items():
                T = self._pin.updateFramePlacement(self.model, self.data, frame)
                found[side][i] = T.homogeneous
                found[side][i, :3, 3] = T.act(center)
        return found

    def solve(self, goals: dict[str, np.ndarray], joints: np.ndarray, q_body: np.ndarray) -> tuple[np.ndarray, float]:
        """Posture in which frames are at their goals, by moving some of the joints.

        Levenberg-Marquardt on the pose errors in the frames' own axes, joints clipped to their limits.

        Args:
            goals: Wanted poses in the pelvis (4, 4), under the keys lhand, rhand, torso; of soles under left, right.
            joints: Which of the body joints may move.
            q_body: Posture to start from, shape (m,), [rad].

        Returns:
            Posture, shape (m,), [rad], and the norm of the remaining error [m and rad].
        """
        pin = self._pin
        wanted = [self._goal(name, T) for name, T in goals.items()]
        low, high = (x[self.idx_q[joints]] for x in (self.model.lowerPositionLimit, self.model.upperPositionLimit))

        def errors(q_body: np.ndarray) -> np.ndarray:
            self._forward(q_body)
            placements = [pin.updateFramePlacement(self.model, self.data, frame) for frame, _ in wanted]
            return np.concatenate(
                [pin.log6(T.actInv(goal)).vector for T, (_, goal) in zip(placements, wanted, strict=True)]
            )

        q, damping, stalled = np.array(q_body, dtype=float), 1e-4, 0
        error = errors(q)
        # Once only: it changes the pose in second order, which the following iterations take back.
        retreat = _retreat(q[joints], low, high)
        for _ in range(_IK_ITERATIONS):
            if np.linalg.norm(error) <= IK_TOLERANCE or damping > _DAMPING_MAX or stalled > _STALLED_MAX:
                break
            configuration = self._configuration(q)
            jacobians = [
                pin.computeFrameJacobian(self.model, self.data, configuration, frame, pin.LOCAL) for frame, _ in wanted
            ]
            J = np.vstack(jacobians)[:, self.idx_v[joints]]
            step = _bounded_step(J, error, damping, low - q[joints], high - q[joints], retreat)
            retreat = None
            step *= min(1.0, _IK_STEP_MAX / max(np.abs(step).max(), 1e-12))
            trial = q.copy()
            trial[joints] = np.clip(q[joints] + step, low, high)
            trial_error = errors(trial)
            stalled = stalled + 1 if np.linalg.norm(trial_error) > 0.99 * np.linalg.norm(error) else 0
            if np.linalg.norm(trial_error) < np.linalg.norm(error):
                q, error, damping = trial, trial_error, max(0.2 * damping, 1e-12)
            else:
                damping *= 10.0
        return q, float(np.linalg.norm(error))

    def _goal(self, name: str, T: np.ndarray) -> tuple[int, pin.SE3]:
        """Frame of a goal, and where it has to be."""
        if name in self.frames:
            return self.frames[name], self._pin.SE3(T)
        frame, center = self._soles[name]
        return frame, self._pin.SE3(T) * self._pin.SE3(np.eye(3), -center)

    def _configuration(self, q_body: np.ndarray) -> np.ndarray:
        q = self._neutral.copy()
        q[self.idx_q] = q_body
        return q

    def _forward(self, q_body: np.ndarray) -> None:
        self._pin.forwardKinematics(self.model, self.data, self._configuration(q_body))


def _bounded_step(
    J: np.ndarray,
    error: np.ndarray,
    damping: float,
    low: np.ndarray,
    high: np.ndarray,
    wish: np.ndarray | None,
) -> np.ndarray:
    """Damped least-squares step within bounds: a joint that would leave them goes to its bound, the others make up.

    Args:
        J: Jacobian, shape (m, n).
        error: What is to be gained, shape (m,).
        damping: Added to the diagonal of ``J J^T``.
        low: Least step of each joint, shape (n,), [rad].
        high: Largest step, shape (n,), [rad].
        wish: Step that is followed where it does not disturb the error, shape (n,), [rad]; None for the shortest.
    """
    free, step = np.ones(J.shape[1], dtype=bool), np.zeros(J.shape[1])
    identity = damping * np.eye(len(error))
    for _ in range(J.shape[1]):
        J_free = J[:, free]
        rest = np.zeros(J_free.shape[1]) if wish is None else wish[free]
        remaining = error - J[:, ~free] @ step[~free] - J_free @ rest
        step[free] = rest + J_free.T @ np.linalg.solve(J_free @ J_free.T + identity, remaining)
        beyond = free & ((step < low) | (step > high))
        if not beyond.any():
            return step
        step[beyond] = np.clip(step, low, high)[beyond]
        free &= ~beyond
    return step


def _retreat(q: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Step (n,) [rad] away from limits that are near, zero in the middle of the range."""
    margin = _LIMIT_MARGIN * (high - low)
    return _RETREAT * (np.maximum(low + margin - q, 0.0) - np.maximum(q - high + margin, 0.0))


def kinematics(robot: RobotSpec | None = None) -> Kinematics:
    """The shared instance of a robot, the G1 with Dex3 hands if not given."""
    return _shared(robot or g1())


@lru_cache(maxsize=8)
def _shared(robot: RobotSpec) -> Kinematics:
    return Kinematics(robot)
