"""Distances between the bodies of the robot, and how motion changes them."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import coal
import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_collision
from models.spec import RobotSpec
from wholebody.errors import InputError

STANCE_SLACK = 0.002
"""A pair that the stance brings closer than the distance asked for keeps this much less than it has there [m]; chosen,
no trial is on record."""


class Proximity:
    """Hull distances of pairs of bodies, of which only those that may be near are measured.

    Each pair has a lower bound of its distance. It shrinks with what the joints between the two bodies turned since,
    times how far a turn of that joint can move a point of them (`sweep_radii`); the motion of the base does not count.
    A pair is measured anew only when its bound says that it may matter. So near pairs are exact in every update, and
    a far pair costs one row of a matrix product.

    Args:
        spec: The robot. model: Its Pinocchio model.
        pairs: Pairs of body names; None watches every pair of `load_collision`, which leaves out neighbours.
        q_stance: Configuration in which pairs may already be closer than the distance asked for, shape (nq,).
        distance: Distance to keep [m]; a pair that is closer in the stance keeps `STANCE_SLACK` less than it has there.

    Attributes:
        pairs: Indices of the two shapes of each pair, shape (n, 2).
        labels: ``distance.<body>.<body>`` for each pair.
        distance: Distance when last measured, shape (n,), negative where the hulls overlap [m].
        bound: Lower bound of the distance now, shape (n,), equal to the distance where it was measured now [m].
        margin: Distance to keep, shape (n,), [m].
        rows: Normal from the first body to the second and the nearest points ``[normal, point, point]`` in world when
            last measured, shape (n, 9).
        radii: How far a turn of a joint can move a point of a shape, as `sweep_radii`.
    """

    def __init__(
        self,
        spec: RobotSpec,
        model: pin.Model,
        pairs: Sequence[tuple[str, str]] | None,
        q_stance: np.ndarray,
        distance: float,
    ) -> None:
        self.model, self.geometry = model, load_collision(spec, model)
        bodies = [shape.name.rpartition("_")[0] for shape in self.geometry.geometryObjects]
        self.pairs = self._choose(bodies, pairs)
        self.labels = tuple(f"distance.{bodies[a]}.{bodies[b]}" for a, b in self.pairs)
        # Pinocchio's and coal's memory, 5 and 9 MB, is made when it is first needed: compiled code does without.
        self._scratch: pin.Data | None = None
        self._warm: pin.GeometryData | None = None
        parents = np.array([shape.parentJoint for shape in self.geometry.geometryObjects])
        self._parents = parents[self.pairs]
        self._supports = joint_supports(model)
        self.radii = sweep_radii(model, self.geometry)
        self._sweep = _pair_sweep(self.radii[self.pairs])
        self.distance, self.bound, self.rows = *np.zeros((2, len(self.pairs))), np.zeros((len(self.pairs), 9))
        self.measure(q_stance, np.arange(len(self.pairs)))
        self._scratch, self.rows[:] = None, 0.0
        self.margin = np.minimum(distance, self.distance - STANCE_SLACK)
        self._joints = q_stance[7:].copy()

    def _choose(self, bodies: list[str], pairs: Sequence[tuple[str, str]] | None) -> np.ndarray:
        """Keep only the wanted pairs in the geometry; shape (n, 2)."""
        listed = [(pair.first, pair.second) for pair in self.geometry.collisionPairs]
        if pairs is None:
            return np.array(listed)
        wanted = {frozenset(pair) for pair in pairs}
        known = {frozenset((bodies[a], bodies[b])) for a, b in listed}
        if not wanted <= known:
            missing = sorted(tuple(sorted(pair)) for pair in wanted - known)
            raise InputError(f"no distance is known for {missing}: not bodies with hulls, or neighbours of each other")
        chosen = [pair for pair in listed if frozenset((bodies[pair[0]], bodies[pair[1]])) in wanted]
        self.geometry.removeAllCollisionPairs()
        for first, second in chosen:
            self.geometry.addCollisionPair(pin.CollisionPair(first, second))
        return np.array(chosen)

    @property
    def data(self) -> pin.GeometryData:
        """The last search of every pair, from which `update` begins the next one."""
        if self._warm is None:
            self._warm = self.geometry.createData()
            for request in self._warm.distanceRequests:
                request.gjk_initial_guess = coal.GJKInitialGuess.CachedGuess
        return self._warm

    def update(self, q: np.ndarray, data: pin.Data, trigger: float = 0.06, least: int = 0) -> None:
        """Measure the pairs that may be near.

        Args:
            q: Configuration, shape (nq,).
            data: Pinocchio data with the joint placements of that configuration.
            trigger: Pairs closer than this beyond their margin are measured [m].
            least: Number of nearest pairs that are measured in any case; nearest by distance less margin.
        """
        self.bound -= self._sweep @ np.abs(q[7:] - self._joints)
        self._joints[:] = q[7:]
        pin.updateGeometryPlacements(self.model, data, self.geometry, self.data)
        room = self.bound - self.margin
        known = room < trigger
        self._measure(np.flatnonzero(known), room)
        least = min(least, len(self.pairs))
        while least:
            nearest = np.argpartition(room, least - 1)[:least]
            unknown = nearest[~known[nearest]]
            if not len(unknown):
                break
            known[unknown] = True
            self._measure(unknown, room)

    def copy(self) -> Proximity:
        """Copy of the shapes that is measured independently."""
        other = copy(self)
        other._scratch = other._warm = None
        other.distance, other.bound, other.rows = self.distance.copy(), self.bound.copy(), self.rows.copy()
        other._joints = self._joints.copy()
        return other

    def keep_state_in(self, distance: np.ndarray, bound: np.ndarray, rows: np.ndarray, joints: np.ndarray) -> None:
        """Keep the state in these arrays from now on, which compiled code updates too; shapes as in the attributes.

        ``joints`` (n_joints,) are the joint positions of the last `update`.
        """
        distance[:], bound[:], rows[:], joints[:] = self.distance, self.bound, self.rows, self._joints
        self.distance, self.bound, self.rows, self._joints = distance, bound, rows, joints

    def measure(self, q: np.ndarray, pairs: np.ndarray) -> None:
        """Measure some pairs (k,) at a configuration (nq,), whatever their bounds say, and without regard to the past.

        From another guess, the direction in which overlapping hulls are found to come apart is another one by 1e-4.
        """
        if self._scratch is None:
            self._scratch = self.model.createData()
        pin.forwardKinematics(self.model, self._scratch, q)
        items, request, result = self.geometry.geometryObjects, coal.DistanceRequest(), coal.DistanceResult()
        chosen = self.pairs[pairs]
        shapes = {i: (items[i].geometry, self._placed(items[i])) for i in np.unique(chosen).tolist()}
        for k, (first, second) in zip(pairs.tolist(), chosen.tolist(), strict=True):
            result.clear()
            coal.distance(*shapes[first], *shapes[second], request, result)
            self._store(k, result)

    def _placed(self, item: pin.GeometryObject) -> coal.Transform3s:
        """Where a shape is, by the joint placements of the last `measure`."""
        T = self._scratch.oMi[item.parentJoint] * item.placement
        return coal.Transform3s(T.rotation, T.translation)

    def _measure(self, pairs: np.ndarray, room: np.ndarray) -> None:
        for k in pairs.tolist():
            self._store(k, pin.computeDistance(self.geometry, self.data, k))
            room[k] = self.distance[k] - self.margin[k]

    def _store(self, k: int, result: coal.DistanceResult) -> None:
        row = self.rows[k]
        self.bound[k] = self.distance[k] = result.min_distance
        row[:3], row[3:6], row[6:] = result.normal, result.getNearestPoint1(), result.getNearestPoint2()

    def near(self, trigger: float, most: int | None = None, least: int = 0) -> np.ndarray:
        """Indices of the pairs within the trigger of their margin, nearest first.

        Args:
            trigger: As in the last `update` [m].
            most: Largest number of pairs.
            least: Number of nearest pairs given even if they are further away; as in the last `update`, at most
                ``most``.
        """
        room = self.bound - self.margin
        count = min(max(int((room < trigger).sum()), least), len(room))
        count = count if most is None else min(count, most)
        if not count:
            return np.zeros(0, dtype=int)
        nearest = np.argpartition(room, count - 1)[:count]
        return nearest[np.argsort(room[nearest], kind="stable")]

    def rates(self, data: pin.Data, pairs: np.ndarray, v: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """How motion changes distances.

        Args:
            data: Pinocchio data with joint Jacobians; with their time variation too where ``v`` is given.
            pairs: Indices of pairs measured in the last `update`, shape (k,).
            v: Velocity, shape (nv,); None leaves the second answer zero.

        Returns:
            J with ``d distance / dt = J v``, shape (k, nv), and the second derivative for ``dv = 0`` with the
            direction between the bodies held fixed, shape (k,), [m/s^2].
        """
        if not len(pairs):
            return np.zeros((0, self.model.nv)), np.zeros(0)
        rows = self.rows[pairs]
        normal = np.concatenate([-rows[:, :3], rows[:, :3]])
        p = np.concatenate([rows[:, 3:6], rows[:, 6:]])
        J, drift = point_rates(data, self._supports[self._parents[pairs].T.ravel()], p, normal, v)
        return J[: len(pairs)] + J[len(pairs) :], drift[: len(pairs)] + drift[len(pairs) :]


def point_rates(
    data: pin.Data, supports: np.ndarray, p: np.ndarray, normal: np.ndarray, v: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """How motion moves points of bodies along given directions.

    Args:
        data: As in `Proximity.rates`.
        supports: Which velocities move the bodies of the points, shape (k, nv), 0 or 1.
        p: Points in world, shape (k, 3), [m].
        normal: Directions in world, shape (k, 3).
        v: Velocity, shape (nv,); None leaves the second answer zero.

    Returns:
        J with ``speed along normal = J v``, shape (k, nv), and the acceleration along the normal for ``dv = 0``,
        shape (k,), [m/s^2].
    """
    # A world-frame motion (u, w) moves the point p along n by n . u + (p x n) . w.
    row = np.hstack([normal, _cross(p, normal)])
    J = (row @ data.J) * supports
    if v is None:
        return J, np.zeros(len(p))
    motion, drifting = supports @ (data.J * v).T, supports @ (data.dJ * v).T
    w = motion[:, 3:]
    swing = _cross(w, motion[:, :3] + _cross(w, p))
    return J, np.einsum("ij,ij->i", row, drifting) + np.einsum("ij,ij->i", normal, swing)


def sweep_radii(model: pin.Model, geometry: pin.GeometryModel) -> np.ndarray:
    """How far a turn of a joint can move a point of a shape at most.

    Returns:
        Shape (n_shapes, nv - 6), [m/rad]: upper bound, over all configurations, of the distance between the origin of
        a joint that carries the shape and any point of the shape; zero for joints that do not carry it.
    """
    radii = np.zeros((geometry.ngeoms, model.nv - 6))
    for shape, row in zip(geometry.geometryObjects, radii, strict=True):
        shape.geometry.computeLocalAABB()
        centre = shape.placement.act(shape.geometry.aabb_center)
        reach, joint = np.linalg.norm(centre) + shape.geometry.aabb_radius, shape.parentJoint
        while joint > 1:  # joint 1 is the base
            row[model.joints[joint].idx_v - 6] = reach
            reach += np.linalg.norm(model.jointPlacements[joint].translation)
            joint = model.parents[joint]
    return radii


def _pair_sweep(radii: np.ndarray) -> np.ndarray:
    """Shape (n, nv - 6): radii (n, 2, nv - 6) of both shapes, without the joints that carry both."""
    first, second = radii[:, 0], radii[:, 1]
    return np.where((first > 0.0) & (second > 0.0), 0.0, first + second)


def joint_supports(model: pin.Model) -> np.ndarray:
    """Which velocities move which joint's body, shape (njoints, nv), 0 or 1."""
    supports = np.zeros((model.njoints, model.nv))
    for joint in range(1, model.njoints):
        supports[joint] = supports[model.parents[joint]]
        start = model.joints[joint].idx_v
        supports[joint, start : start + model.joints[joint].nv] = 1.0
    return supports


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of rows (k, 3), several times faster than numpy's."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]).T


ARM = ("elbow_link", "wrist_pitch_link", "wrist_yaw_link", "hand_palm_link", "hand_thumb_1_link", "hand_thumb_2_link")
"""Bodies of one arm that reach the trunk, the legs and the other arm first."""
FINGERS = ("hand_index_0_link", "hand_index_1_link", "hand_middle_0_link", "hand_middle_1_link")


def watched_pairs(*, hands: bool = True) -> list[tuple[str, str]]:
    """Pairs of bodies that a hand motion of a standing robot, with Dex3 or rubber hands, can bring together."""
    arms, fingers = (ARM, FINGERS) if hands else ((*ARM[:3], "rubber_hand"), ())
    pairs = []
    for side in ("left", "right"):
        legs = [f"{side}_{leg}" for leg in ("hip_roll_link", "hip_yaw_link", "knee_link")]
        trunk = ["torso_link", "pelvis_contour_link", *legs]
        pairs += [(f"{side}_{arm}", body) for arm in arms for body in trunk]
        pairs += [(f"{side}_{finger}", body) for finger in fingers[1::2] for body in ("torso_link", *legs[1:])]
        pairs += [("torso_link", leg) for leg in legs]
        pairs += [(f"{side}_{arm}", "head_link") for arm in ("shoulder_yaw_link", *arms)]
        pairs += [(f"{side}_shoulder_yaw_link", body) for body in ("torso_link", *legs[1:])]
    parts = (*arms[1:], *fingers)
    return pairs + [(f"left_{a}", f"right_{b}") for a in parts for b in parts]
