"""Where a chunk is fixed in the world, and the state that relative actions refer to."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.geometry.rotations import nearest_rotation, quaternion_to_matrix
from policy.geometry.se3 import inverse, make_transform, yaw_frame
from policy.kinematics.forward import kinematics
from policy.observation import Observation


@dataclass(frozen=True)
class Anchor:
    """A pelvis pose with the joints that go with it.

    There are two kinds. A policy that was given an observation's state is anchored at that observation's measured
    pelvis and soles (`measured`). A source that does not see the robot is anchored once an episode at the nominal
    stance (`nominal`). Rows that were recorded step by step, each in its own pelvis, have an anchor a row (`standing`).

    Attributes:
        T_world_base: Pelvis in world, shape (4, 4).
        q_body: Body joints in motor order, shape (n,), [rad]; 29 of the G1.
        q_lhand, q_rhand: Finger joints in motor order, shape (m,), [rad]; 7 of a Dex3 hand.
        robot: The robot that these joints are of; the G1 with Dex3 hands if not given.
        stance: Stance frame in world where it is not that of the legs, shape (4, 4); None where it is.
    """

    T_world_base: np.ndarray
    q_body: np.ndarray
    q_lhand: np.ndarray
    q_rhand: np.ndarray
    robot: RobotSpec = field(default_factory=g1, repr=False)
    stance: np.ndarray | None = None

    @classmethod
    def measured(cls, observation: Observation, robot: RobotSpec | None = None) -> Anchor:
        """Anchor at the pelvis and joints of an observation of a robot, the G1 with Dex3 hands if not given.

        Raises:
            ObservationError: If the observation is malformed.
        """
        robot = robot or g1()
        observation.validate(robot)
        T = np.asarray(observation.T_world_base, dtype=float)
        # The measured rotation may carry rounding that a chunk must not inherit.
        return cls(
            make_transform(nearest_rotation(T[:3, :3]), T[:3, 3]),
            np.asarray(observation.q_body, dtype=float),
            np.asarray(observation.q_lhand, dtype=float),
            np.asarray(observation.q_rhand, dtype=float),
            robot,
        )

    @classmethod
    def nominal(cls, T_world_feet: np.ndarray | None = None, robot: RobotSpec | None = None) -> Anchor:
        """Anchor at the pelvis of the default stance, upright and heading along the feet.

        Args:
            T_world_feet: Midpoint of the soles on the floor, x forward, shape (4, 4); the world frame if None.
            robot: The robot; the G1 with Dex3 hands if None.
        """
        robot = robot or g1()
        stance = robot.stance
        R = quaternion_to_matrix(np.array(stance.base_quat_xyzw), "xyzw")
        T_feet_base = yaw_frame(make_transform(R, np.array(stance.base_position)))
        T_world_feet = np.eye(4) if T_world_feet is None else yaw_frame(np.asarray(T_world_feet, dtype=float))
        q_body = stance.joints[: len(robot.body_joints)].copy()
        return cls(T_world_feet @ T_feet_base, q_body, *robot.by_hand(robot.hand_neutral), robot, T_world_feet)

    @classmethod
    def standing(cls, q_body: np.ndarray, robot: RobotSpec | None = None) -> list[Anchor]:
        """Anchors of postures alone, each in a world whose origin is its stance; hands are the nominal ones.

        Both soles are taken to lie flat on a level floor, so that they say where the pelvis is.

        Args:
            q_body: Body joints in motor order, shape (n, m), [rad].
            robot: The robot; the G1 with Dex3 hands if None.
        """
        nominal, origin = cls.nominal(robot=robot), np.eye(4)
        T_stance_base = inverse(between_soles(kinematics(nominal.robot).soles(q_body)))
        hands = (nominal.q_lhand, nominal.q_rhand, nominal.robot, origin)
        return [cls(T, q, *hands) for T, q in zip(T_stance_base, q_body, strict=True)]

    def observation(self, time: float = 0.0) -> Observation:
        """What a robot senses that stands so, without images and task."""
        return Observation(time, self.q_body, self.q_lhand, self.q_rhand, self.T_world_base)

    @cached_property
    def T_base_world(self) -> np.ndarray:
        """World in pelvis, shape (4, 4)."""
        return inverse(self.T_world_base)

    @cached_property
    def T_world_stance(self) -> np.ndarray:
        """Frame between the soles, shape (4, 4): level, heading along both feet.

        It stands still while the body leans and squats on planted feet, and goes with their steps. Its height is that
        of the lower sole, so that a foot that is lifted for a step does not lift what is given in the frame.
        """
        if self.stance is not None:
            return self.stance
        found = kinematics(self.robot).soles(self.q_body[None])
        soles = {side: self.T_world_base @ T for side, T in found.items()}
        T = yaw_frame(between_soles(soles)[0])
        T[2, 3] = min(T_world_sole[0, 2, 3] for T_world_sole in soles.values())
        return T

    @cached_property
    def poses(self) -> dict[str, np.ndarray]:
        """``T_base_lhand``, ``T_base_rhand``, ``T_base_torso`` (4, 4) at these joints, keys lhand, rhand, torso."""
        return kinematics(self.robot).poses(self.q_body)


def between_soles(T_soles: dict[str, np.ndarray]) -> np.ndarray:
    """Frame (n, 4, 4) between both soles (n, 4, 4), keys left and right: their mean position, mean axes."""
    left, right = T_soles["left"], T_soles["right"]
    z = left[:, :3, 2] + right[:, :3, 2]
    z /= np.linalg.norm(z, axis=1)[:, None]
    x = left[:, :3, 0] + right[:, :3, 0]
    x -= (x * z).sum(axis=1)[:, None] * z
    x /= np.linalg.norm(x, axis=1)[:, None]
    R = np.stack([x, np.cross(z, x), z], axis=-1)
    return make_transform(R, 0.5 * (left[:, :3, 3] + right[:, :3, 3]))
