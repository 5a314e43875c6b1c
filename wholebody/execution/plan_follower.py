"""Follow a plan: clock, hand paths, smoother and whole-body trajectory, one reference a control tick."""

from __future__ import annotations

from functools import cache

import numpy as np

from wholebody.backends.registry import Controller
from wholebody.config import ControllerConfig
from wholebody.control.reference_packet import COM, PALM, POSTURE, PackedReference, row_length
from wholebody.execution.kernels import plan_follower as kernel
from wholebody.jit.entry import Entry
from wholebody.planning.plan import ChunkPlan
from wholebody.planning.trajectory import GRID, BodyState, SampledTrajectory
from wholebody.reference import ReferenceSmoother
from wholebody.reference.kernels.smoother_memory import HAND, LIMITS

NO_PATH = np.zeros(0)

WRIST_WEIGHT = 1.0 / 3.0
"""How much the distance of a wrist joint from the plan counts: little weight hangs on it."""


class PlanFollower:
    """Says what the controller follows at each tick; slows down where tracking or balance suffer.

    Args:
        controller: Whose tracking and balance count.
        config: Its configuration.
        trajectory: To hold before the first plan.
        smoother: Has followed the hands so far; advanced here from now on.
        rest: What the hands do before the first plan, rows (2, 40).
        interpret: Run the interpreted arithmetic, the specification, instead of the compiled one (tests).

    Attributes:
        row: The packed reference of the last tick.
    """

    def __init__(
        self,
        controller: Controller,
        config: ControllerConfig,
        trajectory: SampledTrajectory,
        smoother: ReferenceSmoother,
        rest: np.ndarray,
        *,
        interpret: bool = False,
    ) -> None:
        self._controller = controller
        robot, spec, safety = controller.robot, controller.spec, config.safety
        self._settings, self._clock = np.zeros(1, kernel.SETTINGS), np.zeros(1, kernel.CLOCK)
        settings, clock = self._settings[0], self._clock[0]
        settings.dt, settings.grid_step = config.dt, GRID
        for name in ("error_slow", "error_stop", "balance_slow", "posture_slow", "posture_stop"):
            settings[name] = getattr(safety, name)
        clock.rate = clock.trust = 1.0
        self.row = np.zeros(row_length(robot.n_joints))
        self._plan = kernel.Plan(self._settings, NO_PATH, NO_PATH, records(trajectory))
        offsets = np.array([tool.palm_offset for tool in spec.tools])
        self._smoothing = kernel.Smoothing(smoother.state, np.array(rest), smoother.limits, offsets)
        for motion, offset, part in zip(smoother.motion.rows, offsets, self._palm_rows(), strict=True):
            kernel.palm(motion, offset, part)
        support = controller.balance.support
        self._body = kernel.Body(
            edges=np.column_stack([support.normals, support.offsets]),
            fingers=np.array([robot.joint_indices(tool.finger_joints) for tool in spec.tools]),
            weights=np.array([_weight(name) for name in robot.joint_names]),
        )
        self._follow = kernel.follow if interpret else compiled_follow(robot.n_joints)

    @property
    def s(self) -> float:
        """Parameter of the plan [s]."""
        return float(self._clock["s"][0])

    @property
    def rate(self) -> float:
        """How fast the plan is followed, 1 at the chunk's own speed."""
        return float(self._clock["rate"][0])

    @property
    def trust(self) -> float:
        """How far the hands are trusted, 1 as long as the body is near its plan."""
        return float(self._clock["trust"][0])

    @property
    def planned(self) -> BodyState:
        """What the trajectory asks for now."""
        settings, clock, rows = self._settings[0], self._clock[0], self._plan.trajectory
        row = rows[kernel.nearest(settings, clock.s, len(rows))]
        rate = clock.rate if settings.moving > 0.0 else 0.0
        return BodyState(row.q.copy(), rate * row.v)

    def distance(self, q: np.ndarray) -> float:
        """How far a configuration (nq,) is from what was planned for the last tick [rad].

        That of the furthest joint; wrists count less, fingers not at all.
        """
        weights = self._body.weights
        return float(np.max(weights * np.abs(q[7:] - self.row[POSTURE : POSTURE + len(weights)])))

    @property
    def time_factor(self) -> float:
        """Time spent on chunks over chunk time covered; 1 is unslowed."""
        clock = self._clock[0]
        return float(clock.elapsed / clock.travelled) if clock.travelled > 1e-6 else 1.0

    def _palm_rows(self) -> np.ndarray:
        return self.row[:COM].reshape(2, PALM)

    def palm_poses(self) -> np.ndarray:
        """Commanded palm poses in world, shape (2, 4, 4)."""
        rows, T = self._palm_rows(), np.zeros((2, 4, 4))
        T[:, :3, :3], T[:, :3, 3], T[:, 3, 3] = rows[:, :9].reshape(2, 3, 3), rows[:, 9:12], 1.0
        return T

    def begin(self, plan: ChunkPlan, last: float) -> None:
        """Follow a plan from its start on.

        Args:
            plan: The plan.
            last: Parameter of the chunk's last step [s].
        """
        left, right = plan.paths
        self._plan = kernel.Plan(self._settings, left.flat, right.flat, records(plan.trajectory))
        settings, clock = self._settings[0], self._clock[0]
        settings.moving, settings.plan_rate, settings.grid_start = 1.0, plan.rate, plan.trajectory.start
        settings.last_step = last
        clock.s, clock.rate, clock.change = plan.start, plan.rate, 0.0

    def reference(self, q: np.ndarray) -> PackedReference:
        """What to follow in this tick, and how far the hands are trusted in it.

        Args:
            q: Configuration now, shape (nq,).
        """
        q = np.ascontiguousarray(q, dtype=float)
        controller = self._controller
        robot = controller.robot
        self._follow(
            self._plan, self._clock, self._smoothing, self._body, q, robot.com, robot.com_velocity,
            controller.palm_positions(), self.row,
        )  # fmt: skip
        controller.trust_hands(self.trust)
        return PackedReference(self.row)


def _weight(joint: str) -> float:
    """How much a joint's distance from the plan counts: it is the heavy ones that carry balance away."""
    return 0.0 if "_hand_" in joint else WRIST_WEIGHT if "_wrist_" in joint else 1.0


def records(trajectory: SampledTrajectory) -> np.ndarray:
    """A trajectory as `kernel.follow` reads it: all that belongs to a point of the grid side by side."""
    n, n_joints = trajectory.ddq.shape
    rows = np.zeros(n, kernel.trajectory_row(n_joints))
    for name in ("q", "v", "ddq"):
        rows[name] = getattr(trajectory, name)
    for name in ("com", "momentum"):
        rows[name] = getattr(trajectory, name).transpose(1, 0, 2)
    rows["height"] = trajectory.height.T
    for name in ("pelvis", "torso"):
        rows[name] = np.concatenate([part.reshape(n, -1) for part in getattr(trajectory, name)], axis=1)
    return rows


@cache
def compiled_follow(n_joints: int) -> Entry:
    """The compiled `kernel.follow` for robots with so many joints, compiled when first called."""
    return Entry(kernel.follow)


def compile_follow(n_joints: int) -> None:
    """Compile `kernel.follow` for robots with so many joints, or load it: what its arguments hold does not matter."""
    vector, matrix, trajectory = np.zeros(1), np.zeros((1, 1)), np.zeros(1, kernel.trajectory_row(n_joints))
    plan = kernel.Plan(np.zeros(1, kernel.SETTINGS), vector, vector, trajectory)
    smoothing = kernel.Smoothing(np.zeros(1, HAND), matrix, np.zeros(1, LIMITS), matrix)
    body = kernel.Body(matrix, np.zeros((1, 1), dtype=int), vector)
    clock = np.zeros(1, kernel.CLOCK)
    compiled_follow(n_joints).compile(plan, clock, smoothing, body, vector, vector, vector, matrix, vector)
