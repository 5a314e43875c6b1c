"""The plan's least-squares program: all knots linearised, and the step that the linear program asks for."""

from __future__ import annotations

import numpy as np

from policy.geometry.rotations import rotvec_to_matrix
from wholebody.collision import gjk
from wholebody.config import TrajectoryConfig
from wholebody.errors import InputError
from wholebody.planning.trajopt import entry_points, weights
from wholebody.planning.trajopt import layout as tables
from wholebody.planning.trajopt.layout import EDGE, NEAR, Motion, Task
from wholebody.planning.trajopt.robot_tables import RobotTables

BEND_MAX = 0.02
"""Of the palms' curve away from its control points [m, rad]."""
EVENED, BEFORE = 8, 3
"""How often each knot of a first motion becomes a mean of itself and the two beside it, and from how many knots before
the first one looked for."""


class TrajectoryProblem:
    """Memory for plans of K knots, and what is done on it.

    Args:
        body: The robot. config: Time between knots, and the distance from which on a pair of bodies counts.
        K: Number of knots.

    Attributes:
        now, trial: Two motions; a step of the first leads to the second.
    """

    def __init__(self, body: RobotTables, config: TrajectoryConfig, K: int) -> None:
        self.body, self.K, self._trigger = body, K, config.self_trigger
        n_edges, bodies = len(body.tables.normals), len(body.tables.parent)
        self.now, self.trial = (tables.new_motion(K, bodies, n_edges) for _ in range(2))
        first = body.shapes.shapes[body.shapes.pairs, gjk.FIRST]
        self.near = tables.new_near(K, len(body.shapes.shapes), first, body.shapes.low_first)
        self._first_state = self.near.state.copy()
        self._system, self._n_edges = tables.new_system(K, n_edges), n_edges
        self._work, self._sums = tables.new_work(), tables.new_sum_work(K)
        n_fingers = len(body.fingers)
        self._task = Task(
            np.zeros((K, 2, 4, 4)),
            np.zeros((K, n_fingers)),
            np.zeros(tables.N_BODY),
            np.zeros((K, 12)),
            float(config.dt),
        )

    @property
    def z(self) -> np.ndarray:
        """The step found last, shape (K + 2, N_FREE), laid out as in `cost`."""
        return self._system.z

    @property
    def q_fingers(self) -> np.ndarray:
        """In the order of their bodies, shape (K, n_fingers)."""
        return self._task.q_fingers

    def begin(self, T_palms: np.ndarray, q_fingers: np.ndarray, v_start: np.ndarray) -> None:
        """Set the palm poses wanted (K, 2, 4, 4), the finger joints (K, n_fingers) and the first velocity (35,)."""
        task = self._task
        task.T_palms[:], task.v_start[:], task.bend[:] = T_palms, v_start, 0.0
        task.q_fingers[:] = q_fingers[:, self.body.finger_order]
        # A plan does not depend on the plans before it.
        near = self.near
        near.q[:], near.state[:], near.lowest[:] = np.inf, self._first_state, self.body.shapes.low_first

    def bend(self) -> None:
        """Judge the palms on the curve that has the knots as control points, as far as it bends away from them now."""
        entry_points.bend(self.body.tables, self._task, self.now, self.trial, BEND_MAX, self._work)

    def palms_on_curve(self) -> np.ndarray:
        """Palm poses of the present motion, (K, 2, 4, 4)."""
        self.bend()
        T, bend = self.now.palms.copy(), self._task.bend.reshape(self.K, 2, 6)
        T[:, :, :3, 3] += bend[:, :, :3]
        T[:, :, :3, :3] = rotvec_to_matrix(bend[:, :, 3:]) @ T[:, :, :3, :3]
        return T

    def weigh(self, config: TrajectoryConfig, softness: float) -> None:
        """Set the weights; the scales of the bounds are multiplied by ``softness``."""
        self._scales, self._weights = weights.scales(config), weights.sided(self._n_edges, softness)

    def follow(self, first: int) -> None:
        """Fill the configurations of the present motion from knot ``first`` on: hand over hand, without distances.

        Whoever goes hand over hand does not look at accelerations, so the motion found is evened out afterwards.
        """
        tables, task, m, work = self.body.tables, self._task, self.now, self._work
        for k in range(first, self.K):
            m.q[k], m.near[k], m.over[k, NEAR:EDGE] = m.q[k - 1], 0, -1.0
            entry_points.place(tables, task, m, work, k, k + 1)
            entry_points.follow(k, tables, m, self._scales, self._weights, self._system, work, self._sums)
        if first < self.K:
            _even_out(m.q[max(0, first - 1 - BEFORE) :])

    def linearise(self, m: Motion) -> None:
        """Evaluate everything at the configurations of a motion, whose first one is given; puts the feet back."""
        body, task, work = self.body, self._task, self._work
        entry_points.place(body.tables, task, m, work, 0, self.K)
        unsure = entry_points.measure(body.tables, body.shapes, task, m, self.near, self._trigger)
        if unsure:
            self._measure(m, self.near.unsure[:unsure])
        entry_points.describe(body.tables, body.shapes, task, m, self.near)
        entry_points.rates(body.tables, task, m, work)

    def _measure(self, m: Motion, unsure: np.ndarray) -> None:
        """Measure pairs that touch: rows of knot, pair and place in the list of the knot."""
        body, near = self.body, self.near
        full = body.q_full.copy()
        for k in np.unique(unsure[:, 0]).tolist():
            listed = unsure[unsure[:, 0] == k]
            full[body.body], full[body.fingers[body.finger_order]] = m.q[k], self._task.q_fingers[k]
            body.proximity.measure(full, listed[:, 1])
            for _, pair, place in listed.tolist():
                row = body.proximity.rows[pair].copy()
                row[3:6] -= m.q[k, :3]
                row[6:9] -= m.q[k, :3]
                near.rows[k, place] = row
                near.room[k, place] = body.proximity.distance[pair] - body.proximity.margin[pair]

    def cost(self, m: Motion) -> float:
        """What a motion costs."""
        return entry_points.cost(m, self._scales, self._weights, EDGE + self._n_edges)

    def assemble(self) -> None:
        """Assemble the linear program of the present motion, as far as it does not depend on what is exceeded."""
        entry_points.assemble(self.now, self._task, self._scales, self._system.H, self._system.g, self._sums)

    def step(self, damping: float, limit: int = 12, largest: float = np.inf) -> tuple[float, float, bool]:
        """Find the step of the linear program.

        Args:
            damping: Added to the Hessian, as a share of its diagonal and by itself.
            limit: How often the set of exceeded bounds is guessed anew.
            largest: Entry of the step above which it is not looked for any further.

        Returns:
            The decrease of the cost that it promises, its largest entry, and whether it is the exact one.

        Raises:
            InputError: If the program is singular.
        """
        promise, size, exact = entry_points.step(
            self.body.tables, self._task, self.now, self._weights, self._system, self._sums,
            float(damping), limit, float(largest),
        )  # fmt: skip
        if size < 0.0:
            raise InputError(
                "the optimiser's linear program is singular: is a scale in planner.posture or in planner.weights_* "
                "zero or huge? `wholebody config` prints those that work"
            )
        return promise, size, exact

    def move(self) -> None:
        """Set the configurations of the trial to where the step leads."""
        entry_points.moved(self.now, self._system.z, self._work.lower_step, self.trial)

    def accept(self) -> None:
        """The trial becomes the present motion."""
        self.now, self.trial = self.trial, self.now

    def excess(self) -> np.ndarray:
        """Largest excess over a bound at each knot, in terms of the room behind it, (K,)."""
        over = self.now.over.copy()
        over[0, : EDGE + self._n_edges] = -1.0
        return np.maximum(0.0, (over / weights.rooms(self._n_edges)).max(axis=1))


def _even_out(q: np.ndarray) -> None:
    """Low-pass filter of some configurations (k, nq) in place; the first one stays."""
    n = len(q)
    mean = 0.5 * np.eye(n) + 0.25 * (np.eye(n, k=1) + np.eye(n, k=-1))
    mean[0], mean[-1, -1] = np.eye(n)[0], 0.75
    q[:, 3:7] *= np.copysign(1.0, q[:, 3:7] @ q[0, 3:7])[:, None]
    q[1:] = np.linalg.matrix_power(mean, EVENED)[1:] @ q
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
