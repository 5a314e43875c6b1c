"""What a plan knows of where the robot stands: edges that bound the pressure, and the cone of friction."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from wholebody.config import TrajectoryConfig
from wholebody.contacts.friction import pyramid_slope
from wholebody.robot.contact_schedule import ContactSchedule
from wholebody.robot.feet import Feet, Floor
from wholebody.robot.support_polygon import SupportPolygon, convex_polygon

HALF_SOLE = 0.1
"""Lever at which a moment counts as much as a force [m]; from the URDF: half of the G1's sole of 0.17 m, rounded."""
_ROWS = np.zeros((6, 6))
"""Rows ZMP_FORCE, VERTICAL, HORIZONTAL and YAW of the dynamics from a wrench (force, moment) about the origin."""
_ROWS[[0, 1, 2, 3, 4, 5], [4, 3, 2, 0, 1, 5]] = -1.0, 1.0, 1.0, 1.0, 1.0, 1.0


@dataclass(frozen=True)
class Footing:
    """Both feet where they are, on a floor that may slope.

    Gravity bounds the centre of mass by the level outline of the soles. The floor bounds the pressure by the same
    outline, the zero-moment point being taken at its height: beside a slope of 5 degrees that is up to 4 mm from the
    pressure where the forces lean by 0.3. The cone of friction is that about the floor's own normal.

    Attributes:
        contacts: Which feet stand where; both, for as long as the plan lasts.
        feet: Both feet.
        floor: Under them.
        corners: Contact points in world, shape (2, k, 3), [m].
        support: Their outline as seen from above.
        outline: The same in the floor, from its point over the world's origin in its own axes.
        pressure_offsets: How far the centre of pressure goes towards the edges of the support [m].
    """

    contacts: ContactSchedule
    feet: Feet
    floor: Floor
    corners: np.ndarray
    support: SupportPolygon
    outline: SupportPolygon
    pressure_offsets: np.ndarray

    @classmethod
    def of(cls, spec: RobotSpec, contacts: ContactSchedule, least: float) -> Footing:
        """Footing on these contacts, each with its least share of the weight; an `InputError` if a foot steps."""
        feet = contacts.feet()
        corners, floor = feet.corners(spec), feet.floor(spec)
        support = convex_polygon(corners[:, :, :2].reshape(-1, 2))
        within = (corners.reshape(-1, 3) - floor.origin) @ floor.axes
        pressure = _pressure_offsets(support, *corners[:, :, :2], least)
        return cls(contacts, feet, floor, corners, support, convex_polygon(within[:, :2]), pressure)

    def tables(self, c: TrajectoryConfig, friction: float, least: float) -> dict[str, np.ndarray]:
        """Fields of `arrays.Tables` that say where the robot stands."""
        return {
            "R_feet": self.feet.R.copy(),
            "p_feet": self.feet.p.copy(),
            "normals": self.support.normals.copy(),
            "com_offsets": self.support.offsets - c.com_margin,
            "zmp_offsets": self.pressure_offsets - c.zmp_margin,
            "capture_offsets": self.pressure_offsets - c.capture_margin,
            "cone": _cone(self.outline, c.friction_share * friction, least) @ self._rows_in_floor(),
        }

    def forces(self, friction: float, least: float) -> tuple[np.ndarray, np.ndarray]:
        """Points (n, 3) [m] and forces (n, 3) whose sums are what the soles give while each keeps its least load."""
        middle = self.outline.vertices.mean(axis=0)
        # Each foot keeps its least load: only the rest can be moved about.
        points = middle + (1.0 - 2.0 * least) * (self.outline.vertices - middle)
        points = np.column_stack([points, np.zeros(len(points))]) @ self.floor.axes.T + self.floor.origin
        edges = pyramid_slope(friction) * np.array(list(product((-1.0, 1.0), repeat=2)))
        forces = np.column_stack([edges, np.ones(len(edges))]) @ self.floor.axes.T
        return np.tile(points, (len(forces), 1)), np.repeat(forces, len(points), axis=0)

    def _rows_in_floor(self) -> np.ndarray:
        """Matrix from a wrench in world to one in the floor's axes about its origin, shape (6, 6)."""
        T = np.zeros((6, 6))
        T[:3, :3] = T[3:, 3:] = self.floor.axes.T
        T[3:, :3] = -self.floor.axes.T @ pin.skew(self.floor.origin)
        return _ROWS @ T @ _ROWS.T


def _pressure_offsets(support: SupportPolygon, left: np.ndarray, right: np.ndarray, least: float) -> np.ndarray:
    """How far the centre of pressure goes towards each edge while both feet, corners (k, 2), carry their least load."""
    shares = np.array([least, 1.0 - least])[:, None]
    offsets = [(foot @ support.normals.T).max(0) for foot in (left, right)]
    return (shares * offsets[0] + (1.0 - shares) * offsets[1]).max(0)


def _cone(support: SupportPolygon, friction: float, least: float) -> np.ndarray:
    """Sides (N_FRICTION, 6) of the cone of wrenches that soles give without sliding, the edges of the pressure aside.

    Exact for a rectangle and the pyramid of `wholebody.contacts.friction`; the largest rectangle in the support of the
    proportions of the box around it is taken. So it is inside the cone of `ContactFeasibility`, which has the same
    pyramids at the corners of the whole support: an optimiser needs few sides, a judge the truth.

    Source:
        Caron, Pham and Nakamura 2015, "Stability of Surface Contacts for Humanoid Robots: Closed-Form Formulae of the
        Contact Wrench for Rectangular Support Areas", ICRA.
    """
    low, high = support.vertices.min(axis=0), support.vertices.max(axis=0)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    room = support.offsets - support.normals @ middle
    half = half * np.min(room / (np.abs(support.normals) @ half)) * (1.0 - 2.0 * least)
    (x, y), mu = half, pyramid_slope(friction)
    # Moments about the middle, as columns by ZMP_FORCE, VERTICAL, HORIZONTAL, YAW.
    turn_x, turn_y = np.array([0.0, 1.0, -middle[1], 0.0, 0.0, 0.0]), np.array([-1.0, 0.0, middle[0], 0.0, 0.0, 0.0])
    twist = np.array([0.0, 0.0, 0.0, middle[1], -middle[0], 1.0])
    load, along, across = np.eye(6)[2:5]
    sides = [sign * force - mu * load for force in (along, across) for sign in (1.0, -1.0)]
    for sign, a, b in product((1.0, -1.0), repeat=3):
        shears = a * (y * along + sign * mu * turn_x) + b * (x * across + sign * mu * turn_y)
        sides.append(sign * twist + shears - mu * (x + y) * load)
    sides = np.array(sides)
    # All in terms of a force.
    size = np.linalg.norm(sides * [HALF_SOLE, HALF_SOLE, 0.0, 1.0, 1.0, HALF_SOLE], axis=1)
    return sides / size[:, None]
