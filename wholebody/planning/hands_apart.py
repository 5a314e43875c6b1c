"""Hands that are asked into each other: the nearest poses at which they keep their distance.

A search that begins with overlapping hands has to find by itself which way they come apart, and at some places of a
motion leads one around the other. Here arms and body have no part: each hand is its hulls on a wrist that moves freely,
and what is wanted is the smallest turn and shift of both that parts them.
"""

from __future__ import annotations

from ctypes import c_int

import coal
import daqp
import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from policy.geometry.rotations import rotvec_to_matrix
from wholebody.collision.hull_pairs import HullPairs, found_of, measured
from wholebody.planning.floor_projection import HAND_BOX
from wholebody.robot.palms import palm_offsets, palm_points
from wholebody.trajopt.layout import DISTANCE
from wholebody.trajopt.robot_tables import RobotTables
from wholebody.trajopt.weights import tolerances

SHIFT_COST, TURN_COST = 0.002, 0.1
"""Shift of a palm and turn of a hand that cost the same [m, rad]; measured: with 0.06 rad overlapping hands are up to
3 mm further off, with 0.2 they turn by more than plans follow."""
ROUNDS = 8
"""Most times that distances are measured at a knot; chosen: nearly all hands are apart after three."""
NEAR_MARGIN = 0.015
"""Hulls that are so much further apart than they have to be count, too [m]; chosen: as far as a round moves them."""
STILL_TOO_NEAR = 0.0005
"""Distance by which they may still be too near each other [m]; chosen: plans may be off by twenty times as much."""
TOLERATED = float(tolerances(0)[DISTANCE])
"""Distance by which a plan that is followed may have them too near each other [m]: what is asked for within it needs no
other poses."""
SHIFT_MAX = 0.03
"""Shift past which hands are left where they are asked to be [m]; derived: no plan there follows the chunk
(`planner.tracking_error_max`)."""
SOFT = 8
"""What tells daqp that a row may be exceeded where nothing else is possible."""


class HandHulls:
    """The hulls of both hands on wrists that go anywhere.

    Args:
        spec: The robot. body: Its shapes, and the distances that plans keep.

    Attributes:
        reach: Distance of the palm points from which on no hulls are near, however the fingers are bent [m].
    """

    def __init__(self, spec: RobotSpec, body: RobotTables) -> None:
        model, shapes, geometry = body.full, body.shapes, body.proximity.geometry.geometryObjects
        self._model, self._data, self._q, self._fingers = model, model.createData(), body.q_full, body.fingers
        self._offsets = palm_offsets(spec)
        self._wrists = [model.getFrameId(tool.wrist_frame) for tool in spec.tools]
        moved = [model.subtrees[model.frames[wrist].parentJoint].tolist() for wrist in self._wrists]
        of_hand = np.array([[item.parentJoint in joints for item in geometry] for joints in moved])
        chosen, self._hand = np.flatnonzero(of_hand.any(axis=0)), of_hand[1, of_hand.any(axis=0)].astype(int)
        self._items = [geometry[i] for i in chosen.tolist()]
        pairs = body.proximity.pairs
        across = (of_hand[0, pairs] & of_hand[1, pairs[:, ::-1]]).any(axis=1)
        left_first = np.where(of_hand[0, pairs[:, :1]], pairs, pairs[:, ::-1])
        self._pairs = np.searchsorted(chosen, left_first[across])
        self._keep = body.proximity.margin[across]
        self._hulls = HullPairs(
            shapes.shapes[chosen], shapes.rounds[chosen], shapes.vertices, shapes.start, shapes.neighbours,
            shapes.centre[chosen], shapes.half[chosen], shapes.radius[chosen], self._pairs, self._keep + NEAR_MARGIN,
        )  # fmt: skip
        self.reach = float(np.linalg.norm(HAND_BOX - self._offsets[:, None], axis=2).max(axis=1).sum())
        self.reach += float(self._keep.max() + NEAR_MARGIN)
        self._request, self._result = coal.DistanceRequest(), coal.DistanceResult()
        self.forget()

    def forget(self) -> None:
        """Begin the next search of `near` anew, not where the last one ended: rounding would differ."""
        self._one = found_of(self._hulls, 1)

    def room(self, T_palms: np.ndarray, q_fingers: np.ndarray) -> np.ndarray:
        """The least distance of hulls beyond the one that they keep, -inf where they touch, shape (k,), [m].

        Args:
            T_palms: Poses of the palm points in world, shape (k, 2, 4, 4).
            q_fingers: Finger joints, hand by hand, shape (k, n_fingers), [rad].
        """
        found = found_of(self._hulls, len(T_palms))
        measured(self._hulls, *self._placed(T_palms, q_fingers), found)
        return (found.distance - self._keep).min(axis=1)

    def near(self, T_palms: np.ndarray, q_fingers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pairs within `NEAR_MARGIN` of the distance that they keep, at one pose.

        Args:
            T_palms: Poses of the palm points in world, shape (2, 4, 4).
            q_fingers: Finger joints, hand by hand, shape (n_fingers,), [rad].

        Returns:
            The room beyond that distance (n,) [m], and how it changes with a shift and a turn of the left hand about
            its palm point and of the right one, shape (n, 12).
        """
        R, p = self._placed(T_palms[None], q_fingers[None])
        measured(self._hulls, R, p, self._one)
        distance, rows = self._one.distance[0].copy(), self._one.rows[0]
        for m in np.flatnonzero(distance == -np.inf).tolist():
            distance[m] = self._depth(*self._pairs[m].tolist(), R[0], p[0], rows[m])
        near = distance < self._keep + NEAR_MARGIN
        normal = rows[near, :3]
        arms = [rows[near, 3 + 3 * hand : 6 + 3 * hand] - T_palms[hand, :3, 3] for hand in (0, 1)]
        change = [-normal, -_cross(arms[0], normal), normal, _cross(arms[1], normal)]
        return (distance - self._keep)[near], np.hstack(change)

    def _depth(self, i: int, j: int, R: np.ndarray, p: np.ndarray, row: np.ndarray) -> float:
        """Distance of a pair that touches, by coal; its normal and points into ``row``."""
        shapes, found = [], self._result
        for k in (i, j):
            placed = pin.SE3(R[k], p[k]) * self._items[k].placement
            shapes += [self._items[k].geometry, coal.Transform3s(placed.rotation, placed.translation)]
        found.clear()
        coal.distance(*shapes, self._request, found)
        row[:3], row[3:6], row[6:] = found.normal, found.getNearestPoint1(), found.getNearestPoint2()
        return found.min_distance

    def _placed(self, T_palms: np.ndarray, q_fingers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rotations (k, n, 3, 3) and origins (k, n, 3) of the bodies that the shapes are on."""
        R_wrists = T_palms[:, :, :3, :3]
        p_wrists = palm_points(T_palms, -self._offsets)
        same = (q_fingers == q_fingers[0]).all()
        local = np.array([self._bent(q) for q in (q_fingers[:1] if same else q_fingers)])
        R = R_wrists[:, self._hand]
        p = p_wrists[:, self._hand] + (R @ local[:, :, :3, 3:])[..., 0]
        return np.ascontiguousarray(R @ local[:, :, :3, :3]), np.ascontiguousarray(p)  # as compiled code expects them

    def _bent(self, q_fingers: np.ndarray) -> np.ndarray:
        """Poses of the bodies from their wrists, with fingers at some positions (n_fingers,); shape (n, 4, 4)."""
        q = self._q.copy()
        q[self._fingers] = q_fingers
        pin.framesForwardKinematics(self._model, self._data, q)
        to_wrists = [self._data.oMf[wrist].inverse() for wrist in self._wrists]
        bodies = zip(self._items, self._hand.tolist(), strict=True)
        return np.array([(to_wrists[hand] * self._data.oMi[item.parentJoint]).homogeneous for item, hand in bodies])


class HandsApart:
    """Turns and shifts hands that are asked nearer to each other than plans bring them.

    Args:
        hulls: Of both hands.
    """

    def __init__(self, hulls: HandHulls) -> None:
        self._hulls, self._scale = hulls, np.tile(np.repeat([SHIFT_COST, TURN_COST], 3), 2)
        self._last: tuple[np.ndarray | None, ...] = (None, None, None)

    def parted(self, T_palms: np.ndarray, q_fingers: np.ndarray) -> np.ndarray | None:
        """Palm poses nearest to those asked for at which hands keep their distance; the last answer is kept.

        Each knot is looked at from the move of the one before it, and from that of the one after it: where hands cross,
        one of them comes from the side on which they part.

        Args:
            T_palms: Poses of the palm points in world, shape (K, 2, 4, 4).
            q_fingers: Finger joints, hand by hand, shape (K, n_fingers), [rad].

        Returns:
            The poses, or None where all are apart as asked, or some only far from where they are asked to be.
        """
        if self._last[0] is not T_palms or self._last[1] is not q_fingers:
            self._last = T_palms, q_fingers, self._found(T_palms, q_fingers)
        return self._last[2]

    def overlap(self, T_palms: np.ndarray, q_fingers: np.ndarray) -> bool:
        """Whether no plan that is followed may have hands so near each other as asked; arguments as of `parted`."""
        return bool((self._room(T_palms, q_fingers)[1] < -TOLERATED).any())

    def _found(self, T_palms: np.ndarray, q_fingers: np.ndarray) -> np.ndarray | None:
        close, room = self._room(T_palms, q_fingers)
        overlaps = close[room < -STILL_TOO_NEAR]
        if not len(overlaps):
            return None
        self._hulls.forget()
        ways = np.zeros((2, len(T_palms), 12))
        for way, order in zip(ways, (1, -1), strict=True):
            for k in overlaps[::order].tolist():
                before = k - order
                seen = way[before] if 0 <= before < len(way) and np.isfinite(way[before]).all() else np.zeros(12)
                way[k] = self._part(T_palms[k], q_fingers[k], seen)
        sizes = np.linalg.norm(ways / self._scale, axis=2)
        moves = np.where((sizes[0] <= sizes[1])[:, None], *ways)
        return moved(T_palms, moves) if np.isfinite(moves).all() else None

    def _room(self, T_palms: np.ndarray, q_fingers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Knots at which hands are near each other as asked, and the room between them there [m]."""
        between = T_palms[:, 0, :3, 3] - T_palms[:, 1, :3, 3]
        close = np.flatnonzero(np.einsum("ki,ki->k", between, between) < self._hulls.reach**2)
        return close, self._hulls.room(T_palms[close], q_fingers[close]) if len(close) else np.zeros(0)

    def _part(self, T_palms: np.ndarray, q_fingers: np.ndarray, move: np.ndarray) -> np.ndarray:
        """The smallest move (12,) that parts both hands, seen from another one; infinite if there is no small one."""
        for count in range(ROUNDS):
            room, change = self._hulls.near(moved(T_palms, move), q_fingers)
            if count and room.min(initial=0.0) >= -STILL_TOO_NEAR:
                return move
            least, n = change @ move - room, len(room)
            soft = np.full(n, SOFT, dtype=c_int)
            y, *_ = daqp.solve(np.eye(12), np.zeros(12), change * self._scale, np.full(n, 1e30), least, soft)
            move = y * self._scale
            if np.linalg.norm(move.reshape(4, 3)[::2], axis=1).max() > SHIFT_MAX:
                break
        return np.full(12, np.inf)


def moved(T_palms: np.ndarray, moves: np.ndarray) -> np.ndarray:
    """Palm poses (..., 2, 4, 4) shifted and turned: rows ``shift turn`` of the left and the right one (..., 12)."""
    T, moves = T_palms.copy(), moves.reshape(*moves.shape[:-1], 2, 6)
    T[..., :3, 3] += moves[..., :3]
    T[..., :3, :3] = rotvec_to_matrix(moves[..., 3:]) @ T[..., :3, :3]
    return T


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Vector products of rows (n, 3)."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]
