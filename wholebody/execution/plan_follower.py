"""Follow a plan: clock, hand paths, smoother and posture track, one reference a control tick."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from wholebody.backends.registry import Controller
from wholebody.config import ControllerConfig
from wholebody.control.reference_packet import COM, PALM, POSTURE, PackedReference
from wholebody.execution.kernels import plan_follower as core
from wholebody.jit.former import digest, native, register
from wholebody.planning.plan import ChunkPlan
from wholebody.planning.trajectory import GRID, BodyState, SampledTrajectory
from wholebody.reference import PathClock, ReferenceSmoother
from wholebody.reference.kernels import path as path_kernel
from wholebody.reference.kernels import smoother as smoother_kernel

NO_PATH = np.zeros(0)

WRIST_SHARE = 1.0 / 3.0
"""How much the distance of a wrist joint from the plan counts: little weight hangs on it."""


class PlanFollower:
    """Says what the controller follows at each tick; slows down where tracking or balance suffer.

    Args:
        controller: Whose tracking and balance count.
        config: Its configuration.
        track: Posture to hold before the first plan.
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
        track: SampledTrajectory,
        smoother: ReferenceSmoother,
        rest: np.ndarray,
        *,
        interpret: bool = False,
    ) -> None:
        self._controller, self._smoother = controller, smoother
        robot, spec, safety = controller.robot, controller.spec, config.safety
        self._settings, self._state = np.zeros(core.SETTINGS), np.zeros(core.CLOCK)
        self._settings[[core.DT, core.GRID_STEP]] = config.dt, GRID
        self._settings[core.ERROR_SLOW : core.SETTINGS] = (
            safety.error_slow, safety.error_stop, safety.balance_slow, safety.posture_slow, safety.posture_stop
        )  # fmt: skip
        self._state[[core.RATE, core.SHARE]] = 1.0
        self.row = np.zeros(POSTURE + 3 * robot.n_joints)
        self._paths = NO_PATH, NO_PATH
        self._track = track_table(track)
        offsets = np.array([tool.palm_offset for tool in spec.tools])
        self._smoothing = smoother.state, np.array(rest), smoother.caps, offsets
        for motion, offset, part in zip(smoother.state, offsets, self._palm_rows(), strict=True):
            core.palm(motion, offset, part)
        support = controller.balance.support
        self._edges = np.column_stack([support.normals, support.offsets])
        self._posture = track.q[0].copy(), np.zeros(robot.nv)
        self._fingers = np.array([robot.joint_indices(tool.finger_joints) for tool in spec.tools])
        self._shares = np.array([_share(name) for name in robot.joint_names])
        self._follow = core.follow if interpret else compiled_follow()

    @property
    def clock(self) -> PathClock:
        """Where on the plan the robot is."""
        return PathClock(*self._state[: core.CHANGE + 1].tolist())

    @property
    def s(self) -> float:
        """Parameter of the plan [s]."""
        return float(self._state[core.S])

    @property
    def rate(self) -> float:
        """How fast the plan is followed, 1 at the chunk's own speed."""
        return float(self._state[core.RATE])

    @property
    def share(self) -> float:
        """How far the hands are trusted, 1 as long as the body is near its plan."""
        return float(self._state[core.SHARE])

    @property
    def posture(self) -> BodyState:
        """What the posture plan asks for now."""
        q, v = self._posture
        return BodyState(q.copy(), v.copy())

    def distance(self, q: np.ndarray) -> float:
        """How far a configuration (nq,) is from the posture plan: its furthest joint, light ones count less [rad]."""
        return float(np.max(self._shares * np.abs(q[7:] - self._posture[0][7:])))

    @property
    def time_factor(self) -> float:
        """Time spent on chunks over chunk time covered; 1 is unslowed."""
        elapsed, travelled = self._state[[core.ELAPSED, core.TRAVELLED]].tolist()
        return elapsed / travelled if travelled > 1e-6 else 1.0

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
        self._paths = plan.paths[0].flat, plan.paths[1].flat
        self._track = track_table(plan.trajectory)
        self._settings[core.MOVING : core.GRID_START + 1] = 1.0, plan.rate, plan.trajectory.start
        self._settings[core.LAST_STEP] = last
        self._state[: core.CHANGE + 1] = plan.start, plan.rate, 0.0

    def reference(self, q: np.ndarray) -> PackedReference:
        """What to follow in this tick, and how far the hands are trusted in it.

        Args:
            q: Configuration now, shape (nq,).
        """
        q = np.ascontiguousarray(q, dtype=float)
        controller = self._controller
        robot = controller.robot
        self._follow(
            self._settings, self._state, self._paths, self._track, self._smoothing,
            (self._edges, controller.palm_positions()), (q, robot.com, robot.com_velocity), self._posture, self.row,
            self._fingers, self._shares,
        )  # fmt: skip
        controller.trust_hands(float(self._state[core.SHARE]))
        return PackedReference(self.row)


def _share(joint: str) -> float:
    """How much a joint's distance from the plan counts: it is the heavy ones that carry balance away."""
    return 0.0 if "_hand_" in joint else WRIST_SHARE if "_wrist_" in joint else 1.0


def track_table(track: SampledTrajectory) -> np.ndarray:
    """A posture track as `plan_follower` reads it: all that belongs to a point of the grid side by side."""
    n = len(track.q)
    parts = (
        track.q, track.v, track.ddq, track.com.transpose(1, 0, 2), track.momentum.transpose(1, 0, 2), track.height.T,
        *track.pelvis, *track.torso,
    )  # fmt: skip
    return np.concatenate([np.reshape(part, (n, -1)) for part in parts], axis=1, dtype=float)


@cache
def compiled_follow() -> Callable[..., None]:
    """The compiled `plan_follower.follow`."""
    from numba import float64, int64, types

    modules = (path_kernel, smoother_kernel, core)
    # Nothing is allocated, so nobody has to count references.
    options = {"_nrt": False, "no_cfunc_wrapper": True}
    for module in modules:
        register(module, **options)
    vector, matrix = float64[::1], float64[:, ::1]
    two, three = types.UniTuple(vector, 2), types.UniTuple(vector, 3)
    arguments = (
        vector, vector, two, matrix, types.UniTuple(matrix, 4), types.UniTuple(matrix, 2), three, two, vector,
        int64[:, ::1], vector,
    )  # fmt: skip
    return native(core.follow, arguments, digest(modules), **options)
