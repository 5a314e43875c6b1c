"""The room that a planned motion leaves to every bound of the trajectory optimiser."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.collision.floor_clearance import FloorClearance
from wholebody.config import TrajectoryConfig
from wholebody.planning.judgement.limits import Limit, Margin
from wholebody.trajopt import weights
from wholebody.trajopt.layout import (  # fmt: skip
    BASE_HEIGHT,
    COM_EDGE,
    DISTANCE,
    LOAD,
    N_JOINTS,
    POSITION,
    STATIC,
    TILT,
    TORQUE,
    ZMP,
    n_inequalities,
)
from wholebody.trajopt.limbs import SPARE
from wholebody.trajopt.problem import TrajectoryProblem
from wholebody.trajopt.robot_tables import RobotTables

SIDE_DIRECTIONS = {"front": (1, 0), "back": (-1, 0), "left": (0, 1), "right": (0, -1)}
FACING_MIN = 0.38
"""Share of an edge's normal from which it counts as facing a side [no unit]; definition: the sine of 22.5 degrees."""


def spans(n_edges: int) -> dict[Limit, slice]:
    """Which inequalities of a knot are of which kind; those of distances are told apart by `MotionMargins`."""
    load, zmp = LOAD + n_edges, ZMP + n_edges
    rate = zmp + 2 * n_edges
    return {
        Limit.TILT: slice(TILT, BASE_HEIGHT),
        Limit.PELVIS_HEIGHT: slice(BASE_HEIGHT, POSITION),
        Limit.JOINT_POSITION: slice(POSITION, STATIC),
        Limit.WAIST_TORQUE: slice(STATIC, DISTANCE),
        Limit.SELF_DISTANCE: slice(DISTANCE, COM_EDGE),
        Limit.BALANCE: slice(COM_EDGE, load),
        Limit.LOAD: slice(load, TORQUE + n_edges),
        Limit.JOINT_TORQUE: slice(TORQUE + n_edges, zmp),
        Limit.ZMP: slice(zmp, zmp + n_edges),
        Limit.CAPTURE_POINT: slice(zmp + n_edges, rate),
        Limit.JOINT_ACCELERATION: slice(rate, rate + N_JOINTS),
        Limit.JOINT_SPEED: slice(rate + N_JOINTS, rate + 2 * N_JOINTS),
        Limit.FRICTION: slice(rate + 2 * N_JOINTS, n_inequalities(n_edges)),
    }


class _Rows(NamedTuple):
    """Rows of one kind: who each is about, its bound, and what a violation adds to the bound to give the value."""

    subjects: tuple[str, ...]
    bounds: np.ndarray
    factors: np.ndarray


class MotionMargins:
    """Measures planned motions.

    Args:
        body: The robot. config: Bounds and margins.
    """

    def __init__(self, body: RobotTables, config: TrajectoryConfig) -> None:
        self.body, t = body, body.tables
        edges, names = len(t.normals), tuple(body.model.names)[2:]
        upper, tau = names[N_JOINTS - len(t.tau_max) :], t.tau_max
        weight, one = -body.mass * float(t.gravity[2]), np.ones(edges)
        sides = tuple(f"{side} edge of the soles" for side in map(_side, t.normals))
        self.spans = spans(edges)
        self.tolerances = weights.tolerances(edges)
        self._tables = {
            Limit.TILT: _Rows(("torso", "pelvis"), t.limits[:2], np.ones(2)),
            Limit.PELVIS_HEIGHT: _Rows(("pelvis",), t.limits[2:], -np.ones(1)),
            Limit.WAIST_TORQUE: _Rows(upper[:3], tau[:3], tau[:3]),
            Limit.BALANCE: _Rows(sides, config.com_margin * one, -one),
            Limit.LOAD: _Rows(("soles",), np.array([weight * t.load_min]), np.array([-weight])),
            Limit.JOINT_TORQUE: _Rows(upper, tau, tau),
            Limit.ZMP: _Rows(sides, config.zmp_margin * one, -one),
            Limit.CAPTURE_POINT: _Rows(sides, config.capture_margin * one, -one),
            Limit.JOINT_ACCELERATION: _Rows(names, t.acceleration_max, np.ones(N_JOINTS)),
            Limit.JOINT_SPEED: _Rows(names, t.speed_max, np.ones(N_JOINTS)),
            Limit.FRICTION: _Rows(12 * ("soles",), np.zeros(12), np.ones(12)),
        }
        self._names, self._low = names, FloorClearance(body.spec, body.full, body.proximity.geometry)
        self._data = body.full.createData()

    def of(self, problem: TrajectoryProblem, times: np.ndarray, fps: float) -> Iterator[Margin]:
        """The least room to each kind of bound that the present motion of a problem leaves, its start left out.

        Args:
            problem: Linearised, its distances measured there.
            times: Of the knots, since the chunk's first step, shape (K,), [s].
            fps: Steps per second of the chunk [Hz].
        """
        found = problem.now.violation[1:, : len(self.tolerances)] / self.tolerances
        pairs = np.arange(COM_EDGE - DISTANCE) < problem.distances.chosen[1:, None]
        for limit, span in self.spans.items():
            if limit is Limit.SELF_DISTANCE:
                for kind, mask in ((limit, pairs), (Limit.FLOOR_DISTANCE, ~pairs)):
                    rows = np.where(mask & (problem.now.violation[1:, span] != -1.0), found[:, span], -np.inf)
                    if np.isfinite(rows).any():
                        yield self._margin(problem, kind, span, rows, times, fps)
            elif not (one := self._margin(problem, limit, span, found[:, span], times, fps)).subject.startswith(SPARE):
                yield one  # of a limb that the robot has

    def _margin(
        self, problem: TrajectoryProblem, limit: Limit, span: slice, rows: np.ndarray, times: np.ndarray, fps: float
    ) -> Margin:
        k, i = np.unravel_index(rows.argmax(), rows.shape)
        k, share = int(k) + 1, float(rows[k, i])
        violation = float(problem.now.violation[k, span.start + i])
        subject, bound, factor = self._about(problem, limit, k, int(i))
        return Margin(
            code=limit,
            subject=subject,
            time=float(times[k]),
            step=max(round(float(times[k]) * fps), 0),
            value=bound + factor * violation,
            bound=bound,
            unit=limit.unit,
            margin=-abs(factor) * violation,
            share=-share,
        )

    def _about(self, problem: TrajectoryProblem, limit: Limit, k: int, i: int) -> tuple[str, float, float]:
        """Subject and bound of a row, and what a violation adds to the bound to give the value."""
        t = self.body.tables
        if limit is Limit.JOINT_POSITION:
            sign = float(problem.now.sign[k, POSITION + i])
            return self._names[i], float((t.q_max if sign > 0.0 else t.q_min)[i]), sign
        if limit is Limit.SELF_DISTANCE:
            pair = int(problem.distances.pair[k, i])
            label = self.body.proximity.labels[pair].removeprefix("distance.")
            return label.replace(".", " - "), float(self.body.proximity.margin[pair]), -1.0
        if limit is Limit.FLOOR_DISTANCE:
            return self._lowest(problem, k), float(self.body.shapes.floor[0]), -1.0
        rows = self._tables[limit]
        return rows.subjects[i], float(rows.bounds[i]), float(rows.factors[i])

    def _lowest(self, problem: TrajectoryProblem, k: int) -> str:
        """Body below the elbows that is nearest to the floor at a knot."""
        body, full = self.body, self.body.q_full.copy()
        body.put(full, problem.now.q[k])
        full[body.fingers[body.finger_order]] = problem.q_fingers[k]
        pin.forwardKinematics(body.full, self._data, full)
        return self._low.labels[int(self._low.lowest(self._data)[:, 2].argmin())].removeprefix("floor.")


def _side(normal: np.ndarray) -> str:
    """Where an edge with that outward normal (2,) is."""
    return " ".join(name for name, way in SIDE_DIRECTIONS.items() if np.dot(way, normal) > FACING_MIN)
