"""Distances between the bodies of the robot, and how motion changes them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_collision
from models.spec import RobotSpec


class Proximity:
    """Hull distances of watched pairs of bodies.

    Far pairs are not measured: each pair has a lower bound of its distance, which shrinks with what its two bodies
    moved since, and is measured anew only when the bound falls below the trigger.

    Args:
        spec: The robot. model: Its Pinocchio model.
        pairs: Pairs of body names.
        q_stance: Configuration in which pairs may already be closer than the distance asked for, shape (nq,).
        distance: Distance to keep [m]; a pair that is closer in the stance keeps 2 mm less than it has there.
    """

    def __init__(
        self, spec: RobotSpec, model: pin.Model, pairs: Sequence[tuple[str, str]], q_stance: np.ndarray, distance: float
    ) -> None:
        self.model, self.geometry = model, load_collision(spec, model)
        bodies = [shape.name.rpartition("_")[0] for shape in self.geometry.geometryObjects]
        watched = {frozenset(pair) for pair in pairs}
        listed = [(pair.first, pair.second) for pair in self.geometry.collisionPairs]
        self.geometry.removeAllCollisionPairs()
        self.pairs = np.array([pair for pair in listed if frozenset((bodies[pair[0]], bodies[pair[1]])) in watched])
        for first, second in self.pairs:
            self.geometry.addCollisionPair(pin.CollisionPair(int(first), int(second)))
        self.labels = tuple(f"distance.{bodies[a]}.{bodies[b]}" for a, b in self.pairs)
        self.data = self.geometry.createData()
        self._parents = [shape.parentJoint for shape in self.geometry.geometryObjects]
        self._used = np.unique(self.pairs)
        self._radius = self._reach()
        scratch = model.createData()
        pin.computeDistances(model, scratch, self.geometry, self.data, q_stance)
        self.distance = np.array([result.min_distance for result in self.data.distanceResults])
        self.margin = np.minimum(distance, self.distance - 0.002)
        self._bound = np.full(len(self.pairs), -np.inf)
        self._placements = np.zeros((len(bodies), 4, 3))

    def _reach(self) -> np.ndarray:
        """Radius of each shape about its own origin, shape (n_shapes,), [m]."""
        radius = np.zeros(len(self.geometry.geometryObjects))
        for i in self._used:
            shape = self.geometry.geometryObjects[int(i)].geometry
            shape.computeLocalAABB()
            radius[i] = np.linalg.norm(shape.aabb_center) + shape.aabb_radius
        return radius

    def update(self, data: pin.Data, trigger: float = 0.06) -> None:
        """Measure the pairs that may be near.

        Args:
            data: Pinocchio data whose joint placements are up to date.
            trigger: Pairs further apart than this beyond their margin need no measuring [m].
        """
        pin.updateGeometryPlacements(self.model, data, self.geometry, self.data)
        placements = self._placements.copy()
        for i in self._used:
            M = self.data.oMg[int(i)]
            placements[i, :3], placements[i, 3] = M.rotation, M.translation
        change = placements - self._placements
        self._placements = placements
        moved = np.linalg.norm(change[:, 3], axis=1) + self._radius * np.linalg.norm(change[:, :3], axis=(1, 2))
        self._bound -= moved[self.pairs].sum(axis=1)
        for k in np.flatnonzero(self._bound < self.margin + trigger):
            self._bound[k] = self.distance[k] = pin.computeDistance(self.geometry, self.data, int(k)).min_distance

    def near(self, trigger: float, most: int | None = None) -> np.ndarray:
        """Indices of the pairs within the trigger of their margin, nearest first, at most ``most``."""
        near = np.flatnonzero(self._bound < self.margin + trigger)
        left = self.distance[near] - self.margin[near]
        return near[np.argsort(left, kind="stable")[:most]]

    def rates(self, data: pin.Data, pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How motion changes distances.

        Args:
            data: Pinocchio data with joint Jacobians, and accelerations for ``dv = 0`` if the second answer is used.
            pairs: Indices of measured pairs, shape (k,).

        Returns:
            J with ``d distance / dt = J v``, shape (k, nv), and the second derivative for ``dv = 0`` with the
            direction between the bodies held fixed, shape (k,), [m/s^2].
        """
        J, drift = np.empty((len(pairs), self.model.nv)), np.empty(len(pairs))
        joints: dict[int, tuple] = {}
        for row, k in enumerate(pairs):
            result = self.data.distanceResults[int(k)]
            first, second = (self._parents[shape] for shape in self.pairs[k])
            J_second, drift_second = self._point(data, joints, second, result.getNearestPoint2())
            J_first, drift_first = self._point(data, joints, first, result.getNearestPoint1())
            J[row] = result.normal @ (J_second - J_first)
            drift[row] = result.normal @ (drift_second - drift_first)
        return J, drift

    def _point(self, data: pin.Data, joints: dict[int, tuple], joint: int, point: np.ndarray) -> tuple:
        """Jacobian (3, nv) and drift acceleration (3,) of a point of a body."""
        if joint not in joints:
            frame = pin.LOCAL_WORLD_ALIGNED
            joints[joint] = (
                pin.getJointJacobian(self.model, data, joint, frame),
                pin.getClassicalAcceleration(self.model, data, joint, frame).vector,
                pin.getVelocity(self.model, data, joint, frame).angular,
            )
        J, acceleration, w = joints[joint]
        arm = point - data.oMi[joint].translation
        swing = _cross(acceleration[3:], arm) + _cross(w, _cross(w, arm))
        return J[:3] - pin.skew(arm) @ J[3:], acceleration[:3] + swing


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


ARM = ("elbow_link", "wrist_pitch_link", "wrist_yaw_link", "hand_palm_link", "hand_thumb_1_link", "hand_thumb_2_link")
"""Bodies of one arm that reach the trunk, the legs and the other arm first."""
FINGERS = ("hand_index_0_link", "hand_index_1_link", "hand_middle_0_link", "hand_middle_1_link")


def watched_pairs() -> list[tuple[str, str]]:
    """Pairs of bodies that a hand motion of a standing robot can bring together."""
    pairs = []
    for side in ("left", "right"):
        legs = [f"{side}_{leg}" for leg in ("hip_roll_link", "hip_yaw_link", "knee_link")]
        trunk = ["torso_link", "pelvis_contour_link", *legs]
        pairs += [(f"{side}_{arm}", body) for arm in ARM for body in trunk]
        pairs += [(f"{side}_{finger}", body) for finger in FINGERS[1::2] for body in ("torso_link", *legs[1:])]
        pairs += [("torso_link", leg) for leg in legs]
        pairs += [(f"{side}_{arm}", "head_link") for arm in ("shoulder_yaw_link", *ARM)]
        pairs += [(f"{side}_shoulder_yaw_link", body) for body in ("torso_link", *legs[1:])]
    hands = (*ARM[1:], *FINGERS)
    return pairs + [(f"left_{a}", f"right_{b}") for a in hands for b in hands]
