"""The nearest pairs of bodies at a knot."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from wholebody.posture import boxes_core as core
from wholebody.proximity import Proximity
from wholebody.reference.compiled import compiled

BATCH = 4
"""Pairs measured before looking again whether more are needed."""


class Distances(Proximity):
    """Hull distances of the pairs that are nearest; knots are far apart, so boxes say which may be.

    Args:
        spec: The robot. model: Its Pinocchio model.
        q_stance: Configuration in which pairs may already be closer than the distance asked for, shape (nq,).
        distance: Distance to keep [m].
    """

    def __init__(self, spec: RobotSpec, model: pin.Model, q_stance: np.ndarray, distance: float) -> None:
        super().__init__(spec, model, None, q_stance, distance)
        centres, halves, radii = [], [], []
        for shape in self.geometry.geometryObjects:
            geometry = shape.geometry
            geometry.computeLocalAABB()
            box = geometry.aabb_local
            centres.append(0.5 * (np.array(box.min_) + np.array(box.max_)))
            halves.append(0.5 * (np.array(box.max_) - np.array(box.min_)))
            radii.append(np.linalg.norm(halves[-1]))
        self._boxes = np.array(centres), np.array(halves), np.array(radii)

    def find(self, data: pin.Data, trigger: float, most: int) -> np.ndarray:
        """The pairs within the trigger of their margin, at most so many, nearest first.

        Args:
            data: Pinocchio data with the joint placements.
            trigger: Distance beyond the margin [m].
            most: Largest number of pairs.
        """
        pin.updateGeometryPlacements(self.model, data, self.geometry, self.data)
        T = np.array([placement.homogeneous for placement in self.data.oMg])
        compiled(core, "bounds")(self.pairs, T, *self._boxes, self.bound)
        room = self.bound - self.margin
        candidates = np.flatnonzero(room < trigger)
        order = candidates[np.argsort(room[candidates])]
        found: list[int] = []
        worst = trigger
        for first in range(0, len(order), BATCH):
            pairs = order[first : first + BATCH]
            if room[pairs[0]] >= worst:
                break
            self._measure(pairs, room)
            found = sorted((k for k in (*found, *pairs.tolist()) if room[k] < trigger), key=room.__getitem__)[:most]
            if len(found) == most:
                worst = room[found[-1]]
        return np.array(found, dtype=int)
