"""Whether the floor can give what a trajectory asks of it: pressure under the soles, and friction.

What is not a number, and a wrench on which the solver has no answer, count as infinitely far away: a plan that is not
judged is not balanced.
"""

from __future__ import annotations

from itertools import product

import daqp
import numpy as np

from wholebody.planning.trajectory import COARSE, GRID, CentroidalTrack, SampledTrajectory
from wholebody.robot.kernels.pendulum import LOWEST_HEIGHT
from wholebody.trajopt.footing import HALF_SOLE
from wholebody.trajopt.robot_tables import RobotTables

EDGE_MARGIN = 0.005
"""Distance from the edge of the support at which the pressure can still be held [m]; chosen: soles are soft there."""
DRIFT_GAIN = 2.0
"""Factor on a drift by which the zero-moment point goes past it to take it back; derived: the capture point then
returns as fast as the pendulum took it away (2 - 1 = 1)."""
RECOVERY_TIME = 0.2
"""Time in which the controller makes up for an impulse that was missing [s]; derived: its default `safety.balance_gain`
is 5 / s."""
BOX = np.array([0.1, 0.1, 0.06, 0.05, 0.025])
"""Half sizes of the box of wrenches that is scaled to fit into the cone: forces per weight, the others [m]; chosen: it
saves time only, a wrench in the box is in the cone."""
LIFT_MIN = 0.1
"""Least vertical force per mass by which moments are divided [m/s^2]; chosen: in free fall there is no zero-moment
point."""
SPREADS, SHARE_MIN = 3, 1e-3
"""How often shares of the contacts' forces that give a wrench are spread anew, and the least weight of one [no unit];
measured: of the wrenches that can be had and are not in the box, 27 % are found at first, 97 % after three times."""
SEPARATED, INSIDE = 1, -1
"""daqp's exit flags: a plane between wrench and cone is found; there is none."""

Track = CentroidalTrack | SampledTrajectory
"""What has centre of mass and momentum on the grid."""

_UNITS = np.array([1.0, 1.0, HALF_SOLE, HALF_SOLE, HALF_SOLE])
"""Units of a wrench: forces per weight; a place and a moment per weight [m], half a sole of which counts as much."""
_EYE, _ZERO = np.eye(5), np.zeros(5)


class ContactFeasibility:
    """Judges the whole curve of a trajectory; the optimiser looks at its knots only.

    Args:
        body: The robot that is planned, on its feet.
        friction: Friction coefficient that the controller counts on.
    """

    def __init__(self, body: RobotTables, friction: float) -> None:
        footing, support = body.footing, body.footing.support
        self._normals, self._offsets = support.normals, footing.pressure_offsets
        self._body, self._gravity = body, -float(body.tables.gravity[2])
        (x, y, z), (fx, fy, fz) = (part.T for part in footing.forces(friction, body.foot_load_min))
        fx, fy = fx / fz, fy / fz
        self._generators = np.stack([fx, fy, x - z * fx, y - z * fy, x * fy - y * fx], axis=1) / _UNITS
        self._shares = np.vstack([self._generators.T, np.ones(len(fz))])
        self._even, self._separated = np.linalg.pinv(self._shares), -np.ones(len(fz))
        self._middle = np.array([0.0, 0.0, *support.vertices.mean(axis=0), 0.0]) / _UNITS
        self._box = self._inner_box()

    def _inner_box(self) -> np.ndarray:
        """Half sizes of a box of wrenches that can all be had: most of any motion is in it and needs no second look."""
        corners, size = np.array(list(product((-1.0, 1.0), repeat=5))), BOX / _UNITS
        while any(self._distance(self._middle + corner * size) > 0.0 for corner in corners):
            size = 0.8 * size
        return size

    def _motion(self, track: Track, slowdown: float, every: int) -> tuple[np.ndarray, ...]:
        """Centre of mass, its acceleration and the rate of the angular momentum per mass, of some rows of a track."""
        rate, rows = slowdown**-2, slice(None, None, every)
        return track.com[0, rows], rate * track.com[2, rows], rate * track.momentum[1, rows] / self._body.mass

    def _pressure(
        self, com: np.ndarray, a: np.ndarray, turning: np.ndarray, pushes: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Zero-moment points (n, 2) [m], and the vertical force per mass (n,)."""
        lift = np.maximum(a[:, 2] + self._gravity, LIFT_MIN)
        shift = com[:, 2:] * a[:, :2] + turning[:, [1, 0]] * [1.0, -1.0]
        if pushes is None:
            return com[:, :2] - shift / lift[:, None], lift
        left = np.maximum(lift - pushes[:, 2], LIFT_MIN)
        moment = com[:, :2] * lift[:, None] - shift + pushes[:, [4, 3]] * [1.0, -1.0]
        return moment / left[:, None], left

    def _pushes(self, track: Track, every: int) -> np.ndarray | None:
        """What pushes the palms, about the world's origin per mass, at some rows of a track, shape (n, 6)."""
        if not isinstance(track, CentroidalTrack) or track.pushes is None or track.palms is None:
            return None
        palms, pushes = track.palms[::every], track.pushes[::every]
        return np.concatenate([pushes, np.cross(palms, pushes)], axis=2).sum(axis=1) / self._body.mass

    def capture_point_drift(self, track: Track, slowdown: float) -> float:
        """How far the capture point drifts from the plan because the pressure under the soles cannot follow it [m].

        The plan keeps its zero-moment point inside at its knots. Between them it may be outside for some hundredths of
        a second: the pressure stays at the edge, the capture point diverges from the plan at the pendulum's rate, and
        is brought back as soon as the zero-moment point is inside again. Taken along each edge by itself.

        Args:
            track: The plan.
            slowdown: How much slower than its parameter it is followed.
        """
        com, a, turning = self._motion(track, slowdown, 1)
        zmp, lift = self._pressure(com, a, turning, self._pushes(track, 1))
        if not np.isfinite(zmp).all():
            return np.inf
        outside = zmp @ self._normals.T - (self._offsets - EDGE_MARGIN)
        if outside.max() <= 0.0:
            return 0.0
        step = np.sqrt(lift / np.maximum(com[:, 2], LOWEST_HEIGHT)) * (GRID * slowdown)
        edges = np.flatnonzero(outside.max(axis=0) > 0.0)
        return max(_edge_drift(outside[:, edge].tolist(), step.tolist()) for edge in edges)

    def friction_impulse_deficit(self, track: Track, slowdown: float) -> float:
        """Largest impulse that is missing for lack of friction at any time, per mass [m/s].

        Arms that swing against each other ask for a moment about the vertical. With the pressure under one edge of the
        soles there is little friction to give it. The controller makes up for what was missing, within `RECOVERY_TIME`.

        Args:
            track: The plan.
            slowdown: How much slower than its parameter it is followed.
        """
        (com, a, turning), pushes = self._motion(track, slowdown, COARSE), self._pushes(track, COARSE)
        zmp, lift = self._pressure(com, a, turning, pushes)
        force = a[:, :2] / lift[:, None]
        moment = com[:, 0] * force[:, 1] - com[:, 1] * force[:, 0] + turning[:, 2] / lift
        if pushes is not None:
            force, moment = force - pushes[:, :2] / lift[:, None], moment - pushes[:, 5] / lift
        wrenches = np.column_stack([force, zmp, moment]) / _UNITS
        if not np.isfinite(wrenches).all():
            return np.inf
        lacking = np.zeros(len(lift))
        outside = np.flatnonzero((np.abs(wrenches - self._middle) > self._box).any(axis=1))
        for k in outside[~self._can_be_had(wrenches[outside])]:
            lacking[k] = lift[k] * self._distance(wrenches[k])
        step, impulse, largest = COARSE * GRID * slowdown, 0.0, 0.0
        for rate in lacking.tolist():
            impulse += step * (rate - impulse / RECOVERY_TIME)
            largest = max(largest, impulse)
        return largest

    def _can_be_had(self, wrenches: np.ndarray) -> np.ndarray:
        """Whether forces that give wrenches (n, 5) are found at once, (n,): many times faster than `_distance`.

        Shares of the contacts' forces that are the least in squares give each wrench. Where some are negative they are
        found anew, with weights of what they were: that takes from those which have much. All positive are a proof;
        there is none that a wrench cannot be had.
        """
        wanted = np.column_stack([wrenches, np.ones(len(wrenches))])
        shares = wanted @ self._even.T
        found = shares.min(axis=1) >= 0.0
        for _ in range(SPREADS):
            rest = np.flatnonzero(~found)
            weights = np.clip(shares[rest], SHARE_MIN, 1.0)
            weighted = (self._shares * weights[:, None]) @ self._shares.T
            shares[rest] = weights * (np.linalg.solve(weighted, wanted[rest, :, None])[:, :, 0] @ self._shares)
            found[rest] = shares[rest].min(axis=1) >= 0.0
        return found

    def _distance(self, wrench: np.ndarray) -> float:
        """Distance of a wrench (5,) from the nearest one that the contacts can give, 0 inside, inf if it is not found.

        It is the width of the widest slab between both: of all normals that separate the wrench from every force of
        one point by at least 1, the shortest.
        """
        away = self._generators - wrench
        normal, _, flag, _ = daqp.solve(_EYE, _ZERO, away, self._separated)
        if flag == SEPARATED:
            return 1.0 / float(np.linalg.norm(normal))
        return 0.0 if flag == INSIDE else np.inf


def _edge_drift(outside: list[float], step: list[float]) -> float:
    """Largest drift past one edge; ``step`` is the time between rows in terms of the pendulum's."""
    drift = largest = 0.0
    for now, share in zip(outside, step, strict=True):
        if drift > 0.0 or now > 0.0:
            led = now if now > 0.0 else max(now, -DRIFT_GAIN * drift)
            drift = max(drift + share * (drift + led), 0.0)
            largest = max(largest, drift)
    return largest
