r"""The trajectory: whole-body motion along the hands' path, optimised for all of the path at once.

The motion is a row of knots, 1/15 s apart, with both feet in place at each. What is wanted is a sum of squares; what
is forbidden costs the square of its excess on a scale so fine that nothing wanted buys much of it:

    wanted      palms at their targets (pulling no harder when far away), centre of mass and zero-moment point over the
                middle of the support, trunk upright, joints near the stance, little waist torque, acceleration, speed
    forbidden   zero-moment point or centre of mass near the edge of the support, unloading the floor
                more horizontal force or moment about the vertical than friction gives
                joints past position, speed, acceleration or torque limits (waist and arms)
                places where the waist could not hold the upper body still
                bodies nearer to each other or hands to the floor than they may be, trunk tilted too far, pelvis too low

The zero-moment point and the torques are those of the full dynamics (Carpentier and Mansard, Analytical derivatives of
rigid body dynamics algorithms, RSS 2018), so the body moves before the hands do where that keeps the balance. There is
always an answer; where it cannot be the motion wanted, it is the least bad one, and says by how much.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.spec import RobotSpec
from wholebody.config import ControllerConfig, TrajectoryConfig
from wholebody.jit.entry import Entry
from wholebody.robot.contact_schedule import ContactSchedule
from wholebody.trajopt.budget import Budget
from wholebody.trajopt.gauss_newton import optimise
from wholebody.trajopt.kernels.centroidal import place_palms
from wholebody.trajopt.layout import N_JOINTS
from wholebody.trajopt.problem import TrajectoryProblem
from wholebody.trajopt.robot_tables import RobotTables

SIZES_KEPT = 2
"""Numbers of knots for which memory is kept, that of a plan and of a slower try; measured: 8 MB for forty knots, taken
anew in 0.3 ms."""

_place_palms = Entry(place_palms)


@dataclass(frozen=True)
class KnotTrajectory:
    """What the planner says, one row a knot.

    Attributes:
        q: The start, then control points of the cubic B-spline that the motion is, shape (K, nq), Pinocchio convention.
        v: Velocities from the knot before to each knot, shape (K, nv): halfway between them in time.
        T_palms: Palm poses that the plan has on its curve, shape (K, 2, 4, 4).
        zmp: Zero-moment point at each knot, shape (K, 2), [m].
        violation: Largest excess over a bound at each knot, shape (K,), in terms of the bound's tolerance.
        cost: What the motion costs.
        between: Whether torques between the knots counted.
        pushes: Forces on the left and the right palm that it counts on, world axes, shape (K, 6), [N]; None if on none.
    """

    q: np.ndarray
    v: np.ndarray
    T_palms: np.ndarray
    zmp: np.ndarray
    violation: np.ndarray
    cost: float
    between: bool = False
    pushes: np.ndarray | None = None


class TrajectoryOptimizer:
    """Plans the whole body along palm poses; fingers go where they are told.

    Args:
        spec: The robot.
        config: Weights, limits and margins.
        friction: Coefficient that the controller counts on.
        force_min: Least normal force that the controller keeps at each contact point [N].

    Attributes:
        work: Linearisations and steps that all plans took so far, as budgets count them.
    """

    def __init__(
        self,
        spec: RobotSpec,
        config: TrajectoryConfig | None = None,
        friction: float = ControllerConfig.friction,
        force_min: float = ControllerConfig.force_min,
    ) -> None:
        self.spec, self.config = spec, config or TrajectoryConfig()
        self.body = RobotTables.of(spec, self.config, friction, force_min)
        self.model = self.body.full
        self.q_stance = self.body.q_full.copy()
        self.work = 0.0
        self._problems: dict[int, TrajectoryProblem] = {}
        self._pushes: np.ndarray | None = None
        self._scratch = np.zeros((1 + N_JOINTS, 3, 3)), np.zeros((2 + N_JOINTS, 3))
        self._relaxation: tuple[np.ndarray | None, np.ndarray] = (None, np.ones(1))

    def stand_on(self, contacts: ContactSchedule) -> None:
        """Plan with the feet there from now on; an `InputError` for a schedule in which one steps."""
        self.body.stand_on(contacts)
        self.body.put(self.q_stance, self.body.tables.q_stance)
        self._problems.clear()  # the support may have another number of edges

    def plan(
        self,
        q: np.ndarray,
        v: np.ndarray,
        T_palms: np.ndarray,
        q_fingers: np.ndarray,
        guess: np.ndarray | None = None,
        config: TrajectoryConfig | None = None,
        budget: Budget | None = None,
        *,
        between: bool = False,
    ) -> KnotTrajectory:
        """Motion along the path, beginning with the state given and ending at rest.

        Args:
            q: Start, shape (nq,), Pinocchio convention.
            v: Velocity at it, shape (nv,).
            T_palms: Palm poses in world, shape (K, 2, 4, 4), ``config.dt`` apart; the first one belongs to ``q``.
            q_fingers: Finger joints, left hand then right hand as `RobotSpec.tools` lists them, shape (K, n_fingers).
            guess: Configurations to begin the search with, at the second and following knots, shape (k, nq), k < K.
            config: Weights to use instead of the planner's own; step, limits and margins stay the planner's.
            budget: What the search may compute; it ends with the best motion so far. That of one search if not given.
            between: Bound torques of waist and arms between the knots too, once a motion asks for too much there.
        """
        body, K, config = self.body, len(T_palms), config or self.config
        problem = self._problem(K)
        problem.budget = budget or Budget()
        problem.budget.begin_search(K)
        seed, problem.enforced[:] = self._relaxation
        problem.begin(T_palms, q_fingers, body.rates_of(v), self._pushes, between=between)
        start, known = problem.now.q, 1
        start[0] = body.body_of(q if seed is None else seed)
        if guess is not None and len(guess):
            known = 1 + len(guess)
            start[1:known] = body.body_of(guess)
        problem.set_weights(config, 1.0)
        problem.warm_start(known)
        start[0] = body.body_of(q)
        before = problem.budget.spent
        cost = optimise(problem, config)
        self.work += problem.budget.spent - before
        now = problem.now
        qs, vs = np.tile(q, (K, 1)), np.zeros((K, len(v)))
        body.put(qs, now.q)
        qs[:, body.fingers] = q_fingers
        body.put_rates(vs, now.v_mid[:-1])
        return KnotTrajectory(
            qs, vs, problem.palms_on_curve(), now.zmp.copy(), problem.violation(), cost, problem.between, self._pushes
        )

    def plan_against(self, pushes: np.ndarray | None, *arguments: Any, **options: Any) -> KnotTrajectory:
        """Plan against what pushes the palms.

        Args:
            pushes: Forces on the left and the right palm, world axes, shape (K, 6), [N]; None if there are none.
            *arguments: Of `plan`.
            **options: Likewise.
        """
        self._pushes = pushes
        try:
            return self.plan(*arguments, **options)
        finally:
            self._pushes = None

    def plan_with_less(
        self, enforced: np.ndarray, seed: np.ndarray | None, *arguments: Any, pushes: np.ndarray | None = None
    ) -> KnotTrajectory:
        """Plan with a subset of the bounds, to find which one is binding.

        Args:
            enforced: As in `TrajectoryProblem`.
            seed: Configuration (nq,) that inverse kinematics from knot to knot begins at; the start if None.
            *arguments: Of `plan`.
            pushes: Of `plan_against`.
        """
        self._relaxation = seed, enforced
        try:
            return self.plan_against(pushes, *arguments)
        finally:
            self._relaxation = None, np.ones(1)

    def palms(self, q: np.ndarray) -> np.ndarray:
        """Poses of both palms, shape (n, 2, 4, 4), at configurations (n, nq)."""
        T = np.empty((len(q), 2, 4, 4))
        _place_palms(self.body.tables, self.body.body_of(np.asarray(q, dtype=float)), T, *self._scratch)
        return T

    def measured(self, motion: KnotTrajectory) -> TrajectoryProblem:
        """The problem with a motion that was found as its present one, everything measured anew.

        It is valid until the next plan.
        """
        body, problem = self.body, self._problem(len(motion.q))
        problem.enforced[:] = 1.0
        problem.budget = Budget()
        problem.begin(motion.T_palms, motion.q[:, body.fingers], body.rates_of(motion.v[0]), motion.pushes)
        problem.now.q[:] = body.body_of(motion.q)
        problem.linearise(problem.now)
        return problem

    def _problem(self, K: int) -> TrajectoryProblem:
        """Memory for K knots; that of the plans before, where it fits."""
        if K not in self._problems:
            if len(self._problems) >= SIZES_KEPT:
                del self._problems[next(iter(self._problems))]
            self._problems[K] = TrajectoryProblem(self.body, self.config, K)
        return self._problems[K]
