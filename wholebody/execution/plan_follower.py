"""Follow a plan: clock, hand paths, smoother and whole-body trajectory, one reference a control tick."""

from __future__ import annotations

import numpy as np

from policy.geometry.se3 import make_transform
from wholebody.config import ControllerConfig
from wholebody.control.base import Controller
from wholebody.control.reference_packet import COM, PALM, POSTURE, PackedReference, row_length
from wholebody.control.touch import Touch
from wholebody.execution.ahead.deviation import Deviation, joint_weights
from wholebody.execution.ahead.foreseen import Foreseen
from wholebody.execution.kernels import plan_follower as kernel
from wholebody.execution.kernels.compiled_follow import compiled_follow
from wholebody.execution.saturation import Saturation
from wholebody.planning.plan import ChunkPlan
from wholebody.planning.trajectory import GRID, BodyState, SampledTrajectory
from wholebody.reference import HandMotion, HandPath, ReferenceSmoother
from wholebody.robot.palms import palm_offsets
from wholebody.types import RobotState

NO_PATH, NO_EDGES = np.zeros(0), np.zeros((0, 3))
SHARE_MIN = 0.05
"""Least share of its speed to which a chunk is stretched; chosen: as good as at rest."""
ELAPSED_MAX = 1.0
"""Longest time that is followed in one tick [s]; what lies further back is left out; chosen, no trial is on record."""
LEANT = 0.5
"""Time that a body which leant all of the way may take to be as planned again [s]; measured: it is after 0.3 s."""


class PlanFollower:
    """Says what the controller follows at each tick; slows down where tracking or balance suffer.

    Args:
        controller: Whose tracking and balance count.
        config: Its configuration.
        trajectory: To hold before the first plan.
        smoother: Has followed the hands so far; advanced here from now on.
        rest: What the hands do before the first plan, rows (2, 40).
        touch: Says which hands touch something; none does if not given.
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
        touch: Touch | None = None,
        interpret: bool = False,
    ) -> None:
        self._controller, self._touch = controller, touch
        robot, spec, safety = controller.robot, controller.spec, config.safety
        self._deviation, self._saturation = (
            Deviation(robot, config.planner.posture),
            Saturation(spec, robot, controller.tau_max),
        )
        self._settings, self._clock = np.zeros(1, kernel.SETTINGS), np.zeros(1, kernel.CLOCK)
        settings, clock = self._settings[0], self._clock[0]
        settings.dt, settings.grid_step = config.dt, GRID
        for name in ("error_slow", "error_stop", "balance_slow", "posture_slow", "posture_stop"):
            settings[name] = getattr(safety, name)
        clock.rate = clock.share = clock.trust = 1.0
        self.row = np.zeros(row_length(robot.n_joints))
        self._plan = kernel.Plan(self._settings, NO_PATH, NO_PATH, kernel.records(trajectory), NO_PATH, NO_PATH)
        offsets = palm_offsets(spec)
        self._smoothing = kernel.Smoothing(smoother.state, np.array(rest), np.array(rest), smoother.limits, offsets)
        for motion, offset, part in zip(smoother.motion.rows, offsets, self._palm_rows(), strict=True):
            kernel.palm(motion, offset, part)
        self._body = kernel.Body(
            edges=self._edges(),
            fingers=np.array([robot.joint_indices(tool.finger_joints) for tool in spec.tools]),
            weights=joint_weights(robot.spec)[robot.motor_to_pin],
            sides=np.full(robot.n_joints, len(spec.tools)),
        )
        self._weights = self._counted = self._body.weights.copy()
        self._arms = [robot.joint_indices(robot.arm_joints(tool.side)) for tool in spec.tools]
        self._body.sides[self._arms] = [[0], [1]]
        self._follow, self._foresee = (kernel.follow, kernel.foresee) if interpret else compiled_follow(robot.n_joints)
        self._dt, self._standing, self._hands_ahead, self._stretched, self._leant = config.dt, False, False, 1.0, 0.0

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
    def sinks(self) -> bool:
        """Whether the trunk sinks: a joint of the waist has had no torque left for long, the body is off its plan."""
        return self.trust < 1.0 and self._saturation.sinks

    @property
    def waits(self) -> bool:
        """Whether the chunk is followed more slowly for the next plan to be there before it is over."""
        return self._stretched < 1.0

    def stretch(self, seconds: float) -> None:
        """Follow the rest of the chunk so slowly that it lasts for so long [s]; one that is over goes on to rest."""
        left, asked = self._settings[0].last_step - self.s, self._settings[0].plan_rate * seconds
        self._stretched = float(max(left / asked, SHARE_MIN)) if 0.0 < left < asked else 1.0

    def foreseen(self, ticks: int, state: RobotState | None = None) -> Foreseen:
        """What will be followed so many control periods from now; 0 for now.

        Args:
            ticks: How many.
            state: Present one. Off the plan, the body is foreseen as far off it; led hands, with arms that follow.
        """
        clock, smoothing = self._clock.copy(), self._smoothing
        clock["share"] = np.minimum(clock["share"], self._stretched)
        smoothing = smoothing._replace(state=smoothing.state.copy(), target=smoothing.target.copy())
        self._foresee(self._plan, clock, smoothing, ticks)
        settings, now, rows = self._settings[0], clock[0], self._plan.trajectory
        row = rows[kernel.nearest(settings, now.s, len(rows))]
        rate, planned = float(now.rate) if settings.moving > 0.0 else 0.0, row.q.copy()
        hands, v = HandMotion(smoothing.state["motion"]), rate * row.v
        if state is not None and (self.trust < 1.0 or self._hands_ahead):
            here = rows[kernel.nearest(settings, self.s, len(rows))]
            planned = self._deviation.carried(here.q, planned, state.q)
            if self._hands_ahead and self.trust == 1.0:
                # What a body moves beside a plan that leads it, it has braked by then.
                v += state.v - self.rate * here.v if len(rows) == 1 else 0.0
                planned, v = self._deviation.reaching(planned, v, hands)
        return Foreseen(float(now.s), rate, BodyState(planned, v), hands)

    def distance(self, q: np.ndarray, planned: np.ndarray | None = None) -> float:
        """Distance of a configuration (nq,) from another one, or from the plan of the last tick [rad].

        That of the furthest joint; wrists count less, fingers not at all.
        """
        weights = self._body.weights
        other = self.row[POSTURE : POSTURE + len(weights)] if planned is None else planned[7:]
        return float(np.max(weights * np.abs(q[7:] - other)))

    def hands_off(self, q: np.ndarray, planned: np.ndarray) -> float:
        """How far a wrist of a configuration (nq,) is from where another one has it [m]."""
        return self._deviation.of_hands(planned, q)

    @property
    def time_factor(self) -> float:
        """Time spent on chunks over chunk time covered; 1 is unslowed."""
        clock = self._clock[0]
        return float(clock.elapsed / clock.travelled) if clock.travelled > 1e-6 else 1.0

    def _forgiven(self, palms: np.ndarray) -> np.ndarray:
        """Palm points (2, 3) as far as they count; a robot that leans, or has just leant, is not as planned."""
        arms = 0.0 if self._hands_ahead else (1.0 - self._leant) * (1.0 - max(self._touch.shares))
        self._count(arms, 1.0 / (1.0 + self._leant))
        return self._touch.forgiven(palms, self.row)

    def _count(self, arms: float, body: float = 1.0) -> None:
        """Let arms and body count with shares of their weights in how far the robot is off its plan."""
        self._body.weights[:] = body * self._counted
        self._body.weights[self._arms] = arms * self._counted[self._arms]

    def _count_from(self, share: float) -> None:
        """Let all joints count with a share of their weight from now on."""
        self._body.weights[:] = self._counted = share * self._weights

    def _palm_rows(self) -> np.ndarray:
        return self.row[:COM].reshape(2, PALM)

    def palm_poses(self) -> np.ndarray:
        """Commanded palm poses in world, shape (2, 4, 4)."""
        rows = self._palm_rows()
        return make_transform(rows[:, :9].reshape(2, 3, 3), rows[:, 9:12])

    def off(self) -> float:
        """Distance of the further palm from where it was commanded in the last tick [m]."""
        return float(np.linalg.norm(self._controller.palm_positions() - self._palm_rows()[:, 9:12], axis=1).max())

    @property
    def near_edge(self) -> bool:
        """Whether the capture point is so near to the edge of the support that the plan has to wait."""
        robot = self._controller.robot
        return kernel.balance_share(self._settings[0], self._body.edges, robot.com, robot.com_velocity) < 1.0

    def begin(self, plan: ChunkPlan, last: float, *, beyond: float = 0.0, speed_fraction: float = 1.0) -> None:
        """Follow a plan from now on.

        Args:
            plan: The plan.
            last: Parameter of the chunk's last step [s].
            beyond: How far past its start it is taken over [s].
            speed_fraction: Of its speed at which it is taken over, 0 to 1.
        """
        (left, right), rows = plan.paths, kernel.records(plan.trajectory)
        self._plan = kernel.Plan(self._settings, left.flat, right.flat, rows, NO_PATH, NO_PATH)
        settings, clock = self._settings[0], self._clock[0]
        settings.moving, settings.plan_rate, settings.grid_start = 1.0, plan.rate, plan.trajectory.start
        settings.last_step = last
        clock.s, clock.rate, clock.change = plan.start + beyond, plan.rate * speed_fraction, 0.0
        clock.trust = 1.0  # how far the robot is from this plan is known from the next tick on
        settings.leash[:], self._hands_ahead, self._stretched = 0.0, False, 1.0
        self._count_from(1.0)
        if self._standing:
            self._saturation.begin_anew()
        self._standing, self._body = False, self._body._replace(edges=self._edges())

    @property
    def leads(self) -> bool:
        """Whether hands are led along other paths than those of the plan."""
        return bool(self._settings[0].leash[0] > 0.0)

    def lead(self, paths: tuple[HandPath, ...], ahead: float, leash: tuple[float, float]) -> None:
        """Lead the hands along other paths until the next plan; arms do not count in how far the robot is off it then.

        Args:
            paths: Of the left and the right hand.
            ahead: How far their parameter is past that of the plan [s].
            leash: How far hands may be from the paths of the plan [m], [rad].
        """
        left, right = paths
        self._plan = self._plan._replace(lead_left=left.flat, lead_right=right.flat)
        settings = self._settings[0]
        settings.ahead, settings.leash[:], self._hands_ahead = ahead, leash, True

    def wait(self, row: SampledTrajectory, share: float) -> None:
        """Lead the body to one row instead of along the plan, until the next one; joints count with a share there.

        Hands are led at their own speed then, whatever that of the plan.
        """
        clock = self._clock[0]
        self._settings[0].plan_rate, clock.rate = 1.0, max(clock.rate, clock.share)
        self._plan = self._plan._replace(trajectory=kernel.records(row))
        self._count_from(share)

    def let_go(self, paths: tuple[HandPath, ...]) -> None:
        """Lead the hands by the plan again, along its paths as joined to what they do now."""
        left, right = paths
        self._plan = self._plan._replace(left=left.flat, right=right.flat)
        self._settings[0].leash[:] = 0.0

    def _edges(self) -> np.ndarray:
        """Half-planes of the support, (k, 3)."""
        support = self._controller.support
        return np.column_stack([support.normals, support.offsets])

    def stand(self, trajectory: SampledTrajectory, rows: np.ndarray, *, holds: bool = False) -> None:
        """Follow no plan: hold the one row of a trajectory.

        Args:
            trajectory: One row.
            rows: Where the hands come to rest, (2, 40).
            holds: Whether the hands are held there, after a walk; otherwise they are let go of.
        """
        self._plan = kernel.Plan(self._settings, NO_PATH, NO_PATH, kernel.records(trajectory), NO_PATH, NO_PATH)
        self._settings[0].moving, self._settings[0].leash[:], self._hands_ahead = 0.0, 0.0, False
        self._smoothing.target[:] = rows
        self._standing = not holds
        if holds:
            self._body = self._body._replace(edges=self._edges())
            self._count_from(1.0)
            self._clock[0].trust = 1.0
        self._saturation.begin_anew()

    def carry(self, paths: tuple[HandPath, ...], s: float, last: float) -> None:
        """Lead the hands along paths from ``s`` on, at their own speed, while a walk carries them; the body stays.

        Args:
            paths: Of the left and the right hand, beginning with what they do.
            s: Parameter now [s].
            last: That of the chunk's last step [s].
        """
        left, right = paths
        settings, clock, rows = self._settings[0], self._clock[0], self._plan.trajectory
        k = kernel.nearest(settings, self.s, len(rows)) if settings.moving > 0.0 else 0
        self._plan = kernel.Plan(self._settings, left.flat, right.flat, rows[k : k + 1], NO_PATH, NO_PATH)
        settings.moving, settings.plan_rate, settings.last_step, settings.leash[:] = 1.0, 1.0, last, 0.0
        clock.s, clock.rate, clock.change, self._hands_ahead, self._stretched = s, 1.0, 0.0, False, 1.0
        self._saturation.begin_anew()

    def ride(self) -> None:
        """Keep the hands for a walk that carries them: neither support nor joints say how far the robot is off."""
        self._body = self._body._replace(edges=NO_EDGES)
        self._count_from(0.0)

    def reference(self, q: np.ndarray, elapsed: float | None = None, *, allowed: float = 1.0) -> PackedReference:
        """What to follow in this tick, and how far the hands are trusted in it.

        Args:
            q: Configuration now, shape (nq,).
            elapsed: Time since the last tick [s], at most `ELAPSED_MAX`; the control period if not given.
            allowed: Largest share of the planned speed, 0 to 1.
        """
        q = np.ascontiguousarray(q, dtype=float)
        controller, elapsed = self._controller, self._dt if elapsed is None else min(elapsed, ELAPSED_MAX)
        robot, palms = controller.robot, controller.palm_positions()
        if self._touch is not None and (self._touch.active or self._leant > 0.0):
            self._leant = max(self._touch.leaning, self._leant - elapsed / LEANT)
            palms = self._forgiven(palms)
        elif self._hands_ahead:
            self._count(0.0)
        left, right = self._saturation.trust(controller.tau, palms, self.row, float(elapsed))
        self._follow(
            self._plan, self._clock, self._smoothing, self._body, q, robot.com, robot.com_velocity, palms, self.row,
            float(elapsed), min(allowed, self._stretched),
        )  # fmt: skip
        most = kernel.TRUST_MIN if self._standing else self.trust
        if self._saturation.waist_is_spent:
            most = min(most, self._saturation.trust_off_plan(self.distance(q)))
        controller.trust_hands(min(left, most), min(right, most))
        return PackedReference(self.row)
