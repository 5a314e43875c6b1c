"""Hands that a person drags: chunks that take the palms smoothly to where they are held."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.builtin import builtin
from policy.chunk import ActionChunk
from policy.geometry.rotations import matrix_to_rotvec, rotvec_to_matrix
from policy.observation import Observation
from policy.scripted.policy import ScriptedMotion, stance_pose, to_chunk

STIFFNESS = 8.0
"""Natural frequency with which a palm goes to its target [rad/s]: half of a short way in 0.2 s. By trial."""
SPEED_MAX = 0.8
"""Fastest that a long way is gone [m/s]; chosen: less than the 1.1 m/s that a recorded motion may demand."""
FPS, HORIZON = 30.0, 15
"""Rate [Hz] and length [steps] of the chunks; chosen: half a second, so that planning it is quick."""
RESTING_HORIZON, RESTING = 60, 1e-4
"""Length of chunks of palms that stay [steps], and distance from their targets at which they stay [m, rad]; chosen:
two seconds, so that the planner is free when a drag begins."""


@dataclass
class _Approach:
    """Critically damped way of one palm to its target from a time on [s]; the same for its orientation."""

    time: float
    target: np.ndarray
    offset: np.ndarray
    rate: np.ndarray
    frequency: float

    @classmethod
    def to(cls, target: np.ndarray, T: np.ndarray, rate: np.ndarray, time: float) -> _Approach:
        """Way to the target from a pose (4, 4) with velocity and angular velocity (6,), world axes."""
        turn = matrix_to_rotvec(T[:3, :3] @ target[:3, :3].T)
        offset = np.concatenate([T[:3, 3] - target[:3, 3], turn])
        # A palm that has the largest speed already does not become faster with this frequency, one at rest less fast.
        frequency = min(STIFFNESS, 2.0 * SPEED_MAX / max(np.linalg.norm(offset[:3]), 1e-6))
        return cls(time, target, offset, rate, frequency)

    def rests(self, time: float) -> bool:
        """Whether the palm is at its target from a time on [s]."""
        t, w = time - self.time, self.frequency
        slope = np.abs(self.rate + w * self.offset)
        return bool((np.abs(self.offset) + slope * (t + 1.0 / w)).max() * np.exp(-w * t) < RESTING)

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Poses (n, 4, 4), and velocities (n, 6), at n times [s]."""
        t, w = (times - self.time)[:, None], self.frequency
        slope = self.rate + w * self.offset
        decay = np.exp(-w * t)
        x = (self.offset + slope * t) * decay
        T = np.tile(np.eye(4), (len(t), 1, 1))
        T[:, :3, 3] = self.target[:3, 3] + x[:, :3]
        T[:, :3, :3] = rotvec_to_matrix(x[:, 3:]) @ self.target[:3, :3]
        return T, slope * decay - w * x


class DraggedHands:
    """A policy that goes where the palms are held.

    Attributes:
        palms: Answers the commanded palm poses (4, 4) by side: where an episode begins.
        targets: Palm poses in world that are wanted, shape (2, 4, 4), left first; None: stay.
        spec: Layout of the chunks: wbc32 of the robot, the G1 with Dex3 hands if none is given.
    """

    sees_robot = True

    def __init__(
        self, palms: Callable[[], dict[str, np.ndarray]] | None = None, robot: RobotSpec | None = None
    ) -> None:
        self.spec, self.palms = builtin("wbc32", robot), palms
        self.targets: np.ndarray | None = None
        self.reset()

    def reset(self, task: str = "") -> None:
        """Begin where the palms are, and stay there."""
        self.targets, self._ways, self._seq = None, [], -1

    def infer(self, observation: Observation) -> ActionChunk:
        """The way from where the last chunk is now to the targets."""
        time, self._seq = observation.time, self._seq + 1
        if not self._ways:
            here = self.palms()
            self._ways = [_Approach.to(here[s], here[s], np.zeros(6), time) for s in ("left", "right")]
        if self.targets is not None:
            now = [way.at(np.array([time])) for way in self._ways]
            self._ways = [
                _Approach.to(target, T[0], rate[0], time) for target, (T, rate) in zip(self.targets, now, strict=True)
            ]
        horizon = RESTING_HORIZON if all(way.rests(time) for way in self._ways) else HORIZON
        times = time + np.arange(horizon) / FPS
        left, right = (way.at(times)[0] for way in self._ways)
        stance = stance_pose(self.spec.robot)
        motion = ScriptedMotion(
            left[:, :3, 3], right[:, :3, 3], left[:, :3, :3], right[:, :3, :3], stance.q_lhand, stance.q_rhand
        )
        chunk = to_chunk(motion, self.spec.id, self._seq, time, FPS, horizon, robot=self.spec.robot)
        return replace(chunk, hands_in="stance")  # a person who has the robot walk takes the hands along
