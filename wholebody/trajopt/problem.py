"""The nonlinear least-squares problem of a plan: all knots linearised, and the step that its linear model asks for."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from policy.geometry.rotations import rotvec_to_matrix
from wholebody.collision import gjk
from wholebody.config import TrajectoryConfig
from wholebody.errors import InputError
from wholebody.robot.kernels.frames import PALM_FRAME
from wholebody.trajopt import entry_points, weights, workspace
from wholebody.trajopt.arrays import KnotTargets
from wholebody.trajopt.budget import Budget
from wholebody.trajopt.layout import COM_EDGE, DISTANCE, LOWER, N_BODY, TORQUE, UPPER, n_inequalities
from wholebody.trajopt.robot_tables import RobotTables
from wholebody.trajopt.workspace import KnotMotion

SPLINE_OFFSET_MAX = 0.02
"""Most that counts of a palm's offset from its control point [m, rad]; derived: at the 20 m/s^2 of `HandLimits` it is
15 mm (dt^2 / 6 times the acceleration); more comes from motions that are still far from the solution."""
SMOOTHING_PASSES, SMOOTHED_BEFORE = 8, 3
"""How often the binomial filter (1/4, 1/2, 1/4) runs over the motion that the search begins with, and how many of the
knots given it takes in: 8 passes halve a swing with a period of 11 knots (cos^16(pi / 11) = 0.5) and
damp faster ones more."""

RETURN_TIME = 1.0
"""Time in which a motion that starts past bounds on configurations is to be back inside [s]; chosen, no trial is on
record."""


class TrajectoryProblem:
    """Problem of plans of K knots, on memory that is kept.

    Args:
        body: The robot. config: Time between knots, and the distance from which on a pair of bodies counts.
        K: Number of knots.

    Attributes:
        now, trial: Two motions; a step of the first leads to the second.
        budget: What `linearise` and `step` count their work in.
        enforced: Which bounds of a knot count, 0 or 1, shape (n_inequalities,); all, unless somebody asks why not.
    """

    def __init__(self, body: RobotTables, config: TrajectoryConfig, K: int) -> None:
        self.body, self.K, self._trigger = body, K, config.self_trigger
        self.budget = Budget()
        n_edges, bodies = len(body.tables.normals), len(body.tables.parent)
        self.enforced, self._may_bound_between = np.ones(n_inequalities(n_edges)), False
        self.now, self.trial, self._beside = (workspace.new_motion(n, bodies, n_edges) for n in (K, K, 1))
        first = body.shapes.shapes[body.shapes.pairs, gjk.FIRST]
        self.distances = workspace.new_distances(K, len(body.shapes.shapes), first, body.shapes.low_first)
        self._first_state = self.distances.state.copy()
        self._system, self._n_edges = workspace.new_system(K, n_edges), n_edges
        self._scratch, self._assembly = workspace.new_knot_scratch(), workspace.new_assembly_scratch(K)
        n_fingers = len(body.fingers)
        self._task = KnotTargets(
            np.zeros((K, 2, 4, 4)),
            np.zeros((K, n_fingers)),
            np.zeros(N_BODY),
            np.zeros((K, 12)),
            float(config.dt),
            between=False,
            spent=np.zeros(UPPER),
            pushed=False,
            pushes=np.zeros((K, 6)),
        )

    @property
    def between(self) -> bool:
        """Whether torques between the knots count."""
        return self._task.between

    @property
    def z(self) -> np.ndarray:
        """The step found last, shape (K + 2, N_FREE), laid out as in `cost`."""
        return self._system.z

    @property
    def q_fingers(self) -> np.ndarray:
        """Finger joints in the order of their bodies, shape (K, n_fingers)."""
        return self._task.q_fingers

    def begin(
        self,
        T_palms: np.ndarray,
        q_fingers: np.ndarray,
        v_start: np.ndarray,
        pushes: np.ndarray | None = None,
        *,
        between: bool = False,
    ) -> None:
        """Set the palm poses wanted (K, 2, 4, 4), the finger joints (K, n_fingers) and the first velocity (35,).

        Args:
            T_palms: Palm poses wanted.
            q_fingers: Finger joints.
            v_start: First velocity.
            pushes: Forces on the left and the right palm, world axes, shape (K, 6), [N]; none if not given.
            between: Whether torques of waist and arms between the knots may count, as `bound_between` says.
        """
        self._may_bound_between, task = between, self._task
        self._count_between(False)
        task.T_palms[:], task.v_start[:], task.offset[:] = T_palms, v_start, 0.0
        task.pushes[:] = 0.0 if pushes is None else pushes
        self._task = self._task._replace(pushed=bool(task.pushes.any()))
        task.q_fingers[:] = q_fingers[:, self.body.finger_order]
        # A plan does not depend on the plans before it.
        distances = self.distances
        distances.q[:], distances.state[:], distances.lowest[:] = np.inf, self._first_state, self.body.shapes.low_first

    def bound_between(self) -> None:
        """Let torques between the knots count from now on, if they may and the present motion asks for too much."""
        if self._may_bound_between and not self._task.between:
            self._count_between(True)
            entry_points.between(self.body.tables, self._task, self.now, self._beside, self._scratch)
            self._count_between(bool((self.now.violation[:, len(self.enforced) :] > 0.0).any()))
            if self._task.between:
                self._excuse_start()

    def _count_between(self, count: bool) -> None:
        self._task = self._task._replace(between=count)
        if not count:
            self._task.spent[:] = 0.0
            self.now.violation[:, len(self.enforced) :] = self.trial.violation[:, len(self.enforced) :] = -1.0

    def _excuse_start(self) -> None:
        """Let torques past their bounds at the first knot where the start, at rest, is past them.

        No motion changes that; it would have to begin by throwing what the hands carry.
        """
        body, tables, m = self.body, self.body.tables, self.now
        at_rest = pin.computeGeneralizedGravity(body.model, body.data, m.q[0])[LOWER:]
        for hand, force in enumerate(self._task.pushes[0].reshape(2, 3)):
            moment = np.cross(m.palms[0, hand, :3, 3] - m.q[0, :3], force)
            carries = tables.carries[PALM_FRAME + hand, LOWER:]
            at_rest -= carries * (m.S[0, LOWER:] @ np.concatenate([force, moment]))
        self._task.spent[:] = np.maximum(np.abs(at_rest) / tables.tau_max - 1.0, 0.0)
        m.violation[0, TORQUE + self._n_edges : TORQUE + self._n_edges + UPPER] -= self._task.spent

    def update_offset(self) -> None:
        """Track with the palms on the spline; their offset from the control points is held until the next call."""
        entry_points.spline_offset(self.body.tables, self._task, self.now, self.trial, SPLINE_OFFSET_MAX, self._scratch)

    def palms_on_curve(self) -> np.ndarray:
        """Palm poses of the present motion, (K, 2, 4, 4)."""
        self.update_offset()
        T, offset = self.now.palms.copy(), self._task.offset.reshape(self.K, 2, 6)
        T[:, :, :3, 3] += offset[:, :, :3]
        T[:, :, :3, :3] = rotvec_to_matrix(offset[:, :, 3:]) @ T[:, :, :3, :3]
        return T

    def set_weights(self, config: TrajectoryConfig, softness: float) -> None:
        """Set the weights; the scales of the bounds are multiplied by ``softness``."""
        self._weights, penalties = weights.weights(config), self.enforced * weights.penalties(self._n_edges, softness)
        between = weights.between(softness) if self._task.between else penalties[:0]
        self._penalties = np.concatenate([penalties, between])

    def warm_start(self, first: int) -> None:
        """Fill the configurations of the present motion from knot ``first`` on, knot by knot, without distances.

        Each knot is found for itself, whatever acceleration leads there, so the motion is smoothed afterwards.
        """
        tables, task, m, scratch = self.body.tables, self._task, self.now, self._scratch
        for k in range(first, self.K):
            m.q[k], m.n_near[k], m.violation[k, DISTANCE:COM_EDGE] = m.q[k - 1], 0, -1.0
            entry_points.place(tables, task, m, scratch, k, k + 1)
            entry_points.warm_start(k, tables, m, self._weights, self._penalties, self._system, scratch, self._assembly)
        if first < self.K:
            _smooth(m.q[max(0, first - 1 - SMOOTHED_BEFORE) :])

    def follow_rows(self, begins: np.ndarray, passes: int) -> None:
        """Inverse kinematics from row to row of several motions, each begun with a row (K,) that stays where it is."""
        entry_points.follow_rows(
            begins, passes, self.body.tables, self._task, self.now, self._weights, self._penalties, self._system,
            self._scratch, self._assembly,
        )  # fmt: skip

    def palms(self) -> np.ndarray:
        """Palm poses of the present configurations, (K, 2, 4, 4), which puts the feet back."""
        entry_points.place(self.body.tables, self._task, self.now, self._scratch, 0, self.K)
        return self.now.palms

    def still_step(self, k: int) -> None:
        """One step of inverse kinematics at knot ``k`` of the present motion, from the terms of `evaluate_still`."""
        entry_points.warm_start(
            k, self.body.tables, self.now, self._weights, self._penalties, self._system, self._scratch, self._assembly
        )

    def evaluate_still(self, *, anew: bool = False) -> None:
        """Evaluate the configurations of the present motion without velocities; ``anew``: measure all distances."""
        if anew:
            self.distances.q[:] = np.inf
        self._place(self.now)

    def linearise(self, m: KnotMotion) -> None:
        """Evaluate everything at the configurations of a motion, whose first one is given; puts the feet back."""
        self.budget.count(self.K)
        self._place(m)
        entry_points.rates(self.body.tables, self._task, m, self._beside, self._scratch)

    def _place(self, m: KnotMotion) -> None:
        body, task, scratch = self.body, self._task, self._scratch
        entry_points.place(body.tables, task, m, scratch, 0, self.K)
        if self.enforced[DISTANCE]:
            touching = entry_points.measure(body.tables, body.shapes, task, m, self.distances, self._trigger)
            if touching:
                self._measure(m, self.distances.touching[:touching])
        else:
            self.distances.measured[:], self.distances.chosen[:] = False, 0
        entry_points.describe(body.tables, body.shapes, task, m, self.distances)

    def _measure(self, m: KnotMotion, touching: np.ndarray) -> None:
        """Measure pairs that touch: rows of knot, pair and place in the list of the knot, knot after knot."""
        body, (knots, pairs, places) = self.body, touching.T
        full, rows, slack = body.q_full.copy(), np.empty((len(pairs), 9)), np.empty(len(pairs))
        begin = 0
        for end in (np.flatnonzero(np.diff(knots, append=-1)) + 1).tolist():
            k, those = knots[begin], pairs[begin:end]
            body.put(full, m.q[k])
            full[body.fingers[body.finger_order]] = self._task.q_fingers[k]
            body.proximity.measure(full, those)
            rows[begin:end] = body.proximity.rows[those]
            slack[begin:end] = body.proximity.distance[those] - body.proximity.margin[those]
            begin = end
        rows[:, 3:] -= np.tile(m.q[knots, :3], 2)  # the points, from the pelvis
        self.distances.rows[knots, places], self.distances.slack[knots, places] = rows, slack

    def cost(self, m: KnotMotion) -> float:
        """What a motion costs."""
        return entry_points.cost(m, self._weights, self._penalties, COM_EDGE + self._n_edges)

    def assemble(self) -> None:
        """Assemble the linear program of the present motion, as far as it does not depend on what is exceeded."""
        entry_points.assemble(self.now, self._task, self._weights, self._system.H, self._system.g, self._assembly)

    def step(self, damping: float, limit: int = 12, largest: float = np.inf) -> tuple[float, float, bool]:
        """Find the step of the linear program.

        Args:
            damping: Added to the Hessian, as a share of its diagonal and by itself.
            limit: Most Newton steps on the set of exceeded bounds.
            largest: Entry of the step above which the search is given up.

        Returns:
            The decrease of the cost that it promises, its largest entry, and whether it is the exact one.

        Raises:
            InputError: If the program is singular.
        """
        self.budget.count(self.K)
        promise, size, exact = entry_points.step(
            self.body.tables, self._task, self.now, self._penalties, self._system, self._assembly,
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
        entry_points.take_step(self.now, self._system.z, self._scratch.lower_step, self.trial)

    def accept(self) -> None:
        """The trial becomes the present motion."""
        self.now, self.trial = self.trial, self.now

    def excess(self) -> np.ndarray:
        """Excess over each bound at each knot, in terms of its tolerance, (K, n_inequalities); -1 where none counts.

        A start past a tolerance is no fault of the motion if that leads back: so much of the excess over bounds on
        configurations is excused, less with time, and none from `RETURN_TIME` or the last knot on.
        """
        violation = self.now.violation[:, : len(self.enforced)]
        found = np.where(self.enforced > 0.0, violation / weights.tolerances(self._n_edges), -1.0)
        start = found[0, : COM_EDGE + self._n_edges].copy()
        # Every knot has its own list of near bodies.
        start[DISTANCE:COM_EDGE] = start[DISTANCE:COM_EDGE].max()
        knots = min(RETURN_TIME / self._task.dt, self.K - 1.0)
        share = np.maximum(1.0 - np.arange(self.K) / knots, 0.0)[:, None]
        found[:, : len(start)] -= share * np.maximum(start - 1.0, 0.0)
        found[0, : len(start)] = -1.0
        return found

    def violation(self) -> np.ndarray:
        """The largest excess at each knot, (K,)."""
        return np.maximum(0.0, self.excess().max(axis=1))


def _smooth(q: np.ndarray) -> None:
    """Binomial filter of some configurations (k, nq) in place; the first one stays."""
    n = len(q)
    mean = 0.5 * np.eye(n) + 0.25 * (np.eye(n, k=1) + np.eye(n, k=-1))
    mean[0], mean[-1, -1] = np.eye(n)[0], 0.75
    q[:, 3:7] *= np.copysign(1.0, q[:, 3:7] @ q[0, 3:7])[:, None]
    q[1:] = np.linalg.matrix_power(mean, SMOOTHING_PASSES)[1:] @ q
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
