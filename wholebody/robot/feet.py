"""Where both feet stand, the floor under them, and the stance on them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from math import atan2, hypot, tan

import numpy as np
import pinocchio as pin

from models.pinocchio_model import frame_id, stance_q
from models.spec import RobotSpec

LEVEL_SLOPE = 1e-6
"""Slope below which a floor is level [rad]; derived: the angles of the stance are rounded, its soles slope by 1e-7."""
FLOOR_REACH = 0.6
"""Horizontal distance from the feet within which hands come near the floor [m]; derived: the 0.5 m of the furthest
reach, and half of a hand."""
BASE_GIVE = 0.01
"""How far the base gives way where a joint of a leg does by 1 [m/rad, no unit]; chosen: only where a leg cannot."""
NEWTON_STEPS, CLOSE = 20, 1e-9
"""Most Newton steps that put the stance on its feet, and how near that is [m, rad]; chosen: four or five will do, they
converge quadratically."""


@dataclass(frozen=True)
class Feet:
    """Poses of the left and right foot in world.

    Attributes:
        R: Orientations, shape (2, 3, 3); the axes are parallel to the soles.
        p: Origins of the feet's frames, shape (2, 3), [m].
    """

    R: np.ndarray
    p: np.ndarray

    @classmethod
    def at(cls, spec: RobotSpec, model: pin.Model, q: np.ndarray, data: pin.Data | None = None) -> Feet:
        """Feet of a configuration (nq,); ``data`` is overwritten."""
        data = model.createData() if data is None else data
        pin.forwardKinematics(model, data, q)
        return cls.of(pin.updateFramePlacement(model, data, frame_id(model, foot.frame)) for foot in spec.feet)

    @classmethod
    def of(cls, poses: Iterable[pin.SE3]) -> Feet:
        """Feet at poses ``T_world_foot``, left first."""
        R, p = zip(*((T.rotation, T.translation) for T in poses), strict=True)
        return cls(np.array(R), np.array(p))

    @property
    def poses(self) -> tuple[pin.SE3, pin.SE3]:
        """``T_world_foot``, left and right."""
        return pin.SE3(self.R[0], self.p[0]), pin.SE3(self.R[1], self.p[1])

    @cached_property
    def heading(self) -> float:
        """Angle about the vertical of the mean of both feet's x axes [rad]."""
        x, y, _ = self.R[:, :, 0].sum(axis=0)
        return atan2(y, x)

    def same(self, other: Feet) -> bool:
        """Whether other feet are there to the bit."""
        return np.array_equal(self.R, other.R) and np.array_equal(self.p, other.p)

    def differ(self, other: Feet, place: float, angle: float) -> bool:
        """Whether a foot is further from where other feet have it than that [m], or turned by more [rad]."""
        turns = [np.linalg.norm(pin.log3(a @ b.T)) for a, b in zip(self.R, other.R, strict=True)]
        return bool(np.abs(self.p - other.p).max() > place or max(turns) > angle)

    def corners(self, spec: RobotSpec) -> np.ndarray:
        """Contact points in world, shape (2, k, 3), [m]."""
        pairs = zip(self.poses, spec.feet, strict=True)
        return np.array([[T.act(point) for point in foot.points] for T, foot in pairs])

    def floor(self, spec: RobotSpec) -> Floor:
        """The plane midway between the soles, as steep as they are on average; it heads where they do."""
        normal = self.R[:, :, 2].sum(axis=0)
        middles = [R @ foot.sole_center + p for foot, R, p in zip(spec.feet, self.R, self.p, strict=True)]
        return Floor(normal / np.linalg.norm(normal), np.mean(middles, axis=0))

    def stance(self, spec: RobotSpec, model: pin.Model, posture: np.ndarray | None = None) -> np.ndarray:
        """The stance, or another posture (nq,), with the soles on these feet, shape (nq,).

        The pelvis is over them as it was over its own, and the legs give way.
        """
        q, data = stance_q(spec, model) if posture is None else posture.copy(), model.createData()
        nominal = Feet.at(spec, model, q, data)
        if not self.differ(nominal, CLOSE, CLOSE):
            return q
        turn = pin.exp3(np.array([0.0, 0.0, self.heading - nominal.heading]))
        here, there = (feet.floor(spec).point for feet in (nominal, self))
        q[:7] = pin.SE3ToXYZQUAT(pin.SE3(turn, there - turn @ here) * pin.XYZQUATToSE3(q[:7]))
        return self._reached(spec, model, data, q)

    def _reached(self, spec: RobotSpec, model: pin.Model, data: pin.Data, q: np.ndarray) -> np.ndarray:
        """The configuration near another one that has its feet here; the base moves only as far as the legs have to."""
        give = np.where(np.arange(model.nv) < 6, BASE_GIVE, 1.0)
        for _ in range(NEWTON_STEPS):
            pin.computeJointJacobians(model, data, q)
            rows, errors = [], []
            for foot, T in zip(spec.feet, self.poses, strict=True):
                frame = frame_id(model, foot.frame)
                now = pin.updateFramePlacement(model, data, frame)
                errors += [T.translation - now.translation, pin.log3(T.rotation @ now.rotation.T)]
                rows.append(pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED))
            error = np.concatenate(errors)
            if np.abs(error).max() < CLOSE:
                break
            q = pin.integrate(model, q, give * np.linalg.lstsq(np.vstack(rows) * give, error, rcond=None)[0])
        return q


@dataclass(frozen=True)
class Floor:
    """A plane.

    Attributes:
        normal: Up from it, unit, shape (3,).
        point: On it, shape (3,), [m].
    """

    normal: np.ndarray
    point: np.ndarray

    @cached_property
    def slope(self) -> float:
        """Its angle with the horizontal [rad]; 0 for one that is level but for rounding."""
        x, y, z = self.normal.tolist()
        angle = atan2(hypot(x, y), z)
        return angle if angle > LEVEL_SLOPE else 0.0

    @cached_property
    def origin(self) -> np.ndarray:
        """Its point over the world's origin, shape (3,), [m]."""
        return np.array([0.0, 0.0, float(self.height(np.zeros(2)))])

    @cached_property
    def axes(self) -> np.ndarray:
        """Rotation from level axes to its own by the shortest way, shape (3, 3); the identity for a level one."""
        if self.slope == 0.0:
            return np.eye(3)
        return pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), self.normal).toRotationMatrix()

    @property
    def rise(self) -> float:
        """How high it is at most within `FLOOR_REACH` of its point, beyond the world's own floor at 0 [m]."""
        return float(self.height(self.point[:2])) + FLOOR_REACH * tan(self.slope)

    def height(self, points: np.ndarray) -> np.ndarray:
        """Its height at places (..., 2), [m]; 0 where the world has a level one through its origin."""
        if self.slope == 0.0 and abs(self.point[2]) < LEVEL_SLOPE:
            return np.zeros(np.shape(points)[:-1])
        return self.point[2] - (np.asarray(points) - self.point[:2]) @ self.normal[:2] / self.normal[2]
