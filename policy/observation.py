"""What a policy sees of the robot at one instant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.errors import ObservationError
from policy.geometry.rotations import rotation_residual


@dataclass(frozen=True)
class Observation:
    """State, images and task at one time.

    Attributes:
        time: Time of the measurement on the robot's clock [s].
        q_body: Body joints in motor order (`RobotSpec.body_joints`), shape (n,), [rad]; 29 of the G1.
        q_lhand: Left finger joints in motor order, shape (m,), [rad]; 7 of a Dex3 hand.
        q_rhand: Right ones, likewise; a Dex3 hand has index before middle there.
        T_world_base: Measured pelvis in world, shape (4, 4).
        images: Camera name to image, uint8, shape (height, width, 3), RGB.
        task: What to do, in words.
        objects: Poses of the scene's bodies that move, in world: position [m] and quaternion wxyz, shape (k, 7), in the
            scene's order; None where nobody tells them.
    """

    time: float
    q_body: np.ndarray
    q_lhand: np.ndarray
    q_rhand: np.ndarray
    T_world_base: np.ndarray
    images: Mapping[str, np.ndarray] = field(default_factory=lambda: MappingProxyType({}))
    task: str = ""
    objects: np.ndarray | None = None

    def validate(self, robot: RobotSpec | None = None) -> None:
        """Check shapes, those of a robot (of the G1 with Dex3 hands if None), finiteness and the pelvis rotation.

        Raises:
            ObservationError: Naming the field.
        """
        if not np.isfinite(self.time):
            raise ObservationError(f"time is {self.time}; a finite number of seconds is expected")
        robot = robot or g1()
        left, right = robot.fingers
        joints = {"q_body": (len(robot.body_joints),), "q_lhand": (left,), "q_rhand": (right,)}
        for name, shape in {**joints, "T_world_base": (4, 4)}.items():
            value = np.asarray(getattr(self, name))
            if value.shape != shape:
                raise ObservationError(f"{name} has shape {value.shape}; {shape} is expected")
            if not np.isfinite(value).all():
                raise ObservationError(f"{name} is not finite at {np.argwhere(~np.isfinite(value))[0].tolist()}")
        residual = rotation_residual(self.T_world_base[:3, :3])
        if not residual <= 1e-6:
            raise ObservationError(f"T_world_base has no rotation (residual {residual:.2g} > 1e-6)")
        if (objects := self.objects) is not None and not (np.shape(objects)[1:] == (7,) and np.isfinite(objects).all()):
            raise ObservationError(f"objects have shape {np.shape(objects)}; finite poses of shape (k, 7) are expected")
        for name, image in self.images.items():
            if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
                raise ObservationError(
                    f"image '{name}' is {image.dtype} of shape {image.shape}; uint8 (height, width, 3) is expected"
                )
