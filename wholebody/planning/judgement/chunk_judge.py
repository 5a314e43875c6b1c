"""A chunk judged by its plan: from where, whether a preview tells, and the room that it leaves to every bound."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from models.pinocchio_model import stance_q
from models.spec import RobotSpec
from policy.action_spec.slot_values import FINGER_TOLERANCE
from policy.chunk import ActionChunk
from policy.geometry.rotations import angle_between
from wholebody.config import START_MAX, ControllerConfig
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.planning.judgement.chunk_margins import PALMS, chunk_margins, palm_margins
from wholebody.planning.judgement.hand_force import HandForce
from wholebody.planning.judgement.holding import staying, torque_at_rest
from wholebody.planning.judgement.limits import OF_NUMBERS, Limit, Margin, Surroundings
from wholebody.planning.judgement.motion_margins import MotionMargins
from wholebody.planning.plan import ChunkPlan
from wholebody.planning.posture import PostureSolver
from wholebody.planning.still_postures import StillPostures
from wholebody.planning.strategies.strategy import PREVIEW
from wholebody.planning.trajectory import BodyState
from wholebody.reference import HandMotion, rest_row, time_scaled
from wholebody.robot.contact_schedule import ContactSchedule
from wholebody.robot.hand_loads import Loads
from wholebody.robot.palms import palm_points
from wholebody.robot.state import Robot
from wholebody.trajopt.problem import TrajectoryProblem
from wholebody.types import RobotState

FIRST_POSE_STARTS = 8
"""Postures from which one for the first pose is searched; measured: of 47 hard ones that 3 do not find 8 find two, and
12 no more. What none of them finds is told as one that is missed."""

STILL = 0.05
"""Speed up to which a robot stands [m/s, rad/s]; chosen: a measured one at rest is below."""


@dataclass(frozen=True)
class Begin:
    """Where a chunk is begun.

    Attributes:
        body: Configuration and velocity.
        hands: What the two hands are commanded to do, rows (2, 40).
        before: Rest of the plan that is being followed, configurations (k, nq) one knot apart; None without one.
        placed: Whether a robot is put there since the chunk begins there, or as near to that as it can stand.
    """

    body: BodyState
    hands: HandMotion
    before: np.ndarray | None = None
    placed: bool = False


@dataclass(frozen=True)
class ChunkJudgement:
    """What a plan says of a chunk; H steps.

    Attributes:
        plan: As it would be followed.
        times: When each step is due, since the first, shape (H,), [s].
        moved: How far each palm is commanded from the chunk, at its own times, shape (H, 2), [m]; 0 before the plan.
        turned: The same of its orientation, shape (H, 2), [rad].
        margins: Least room to each kind of bound, the tightest first.
    """

    plan: ChunkPlan
    times: np.ndarray
    moved: np.ndarray
    turned: np.ndarray
    margins: tuple[Margin, ...]

    @property
    def exceeded(self) -> bool:
        """Whether the chunk's own numbers exceed a bound."""
        return any(one.code in OF_NUMBERS and one.margin < 0.0 for one in self.margins)

    @property
    def previewed(self) -> bool:
        """Whether the cheap tests decided, and nothing was searched for."""
        return self.plan.report.strategy == PREVIEW.name


class ChunkJudge:
    """Judges chunks without simulating them.

    Args:
        spec: The robot. config: Of its controller: bounds, margins and the budget of a plan are the planner's.
        scene: What stands around it; nothing if not given.

    Attributes:
        contacts: Both feet where the stance has them.
    """

    def __init__(
        self, spec: RobotSpec, config: ControllerConfig | None = None, scene: Surroundings | None = None
    ) -> None:
        self.scene = scene
        self.spec, self.config, self.robot = spec, config or ControllerConfig(), Robot(spec)
        self.planner = ChunkPlanner(spec, self.robot, self.config)
        # What hands carry is known by the time that a chunk comes: told, or observed.
        self._loads = Loads((self.config.loads.left, self.config.loads.right))
        self.planner.carry(self._loads)
        self._margins = MotionMargins(self.planner.optimizer.body, self.config.planner.posture)
        self.contacts = self.planner.optimizer.body.footing.contacts

    @property
    def loads(self) -> tuple[float, float]:
        """Masses in the left and right hand that plans count on, without their reserve [kg]."""
        left, right = self._loads.masses
        return left, right

    def carry(self, left: float, right: float) -> None:
        """Count on these masses in the hands from now on [kg]."""
        self._loads = Loads((left, right))
        self.planner.carry(self._loads)
        self.postures.body.carry(self._loads.most)

    def stand_on(self, contacts: ContactSchedule | None = None) -> None:
        """Judge with the feet there from now on; where the stance has them if not given."""
        contacts = contacts or self.contacts
        if not contacts.same(self.planner.optimizer.body.footing.contacts):
            self.planner.stand_on(contacts)
            self._margins = MotionMargins(self.planner.optimizer.body, self.config.planner.posture)
            self.__dict__.pop("stills", None)  # the support may have another number of edges

    @cached_property
    def postures(self) -> PostureSolver:
        """Still postures for the first pose of a chunk."""
        solver = PostureSolver(self.spec, self.config)
        solver.body.carry(self._loads.most)
        return solver

    @cached_property
    def stills(self) -> StillPostures:
        """Room for a posture at rest that keeps the bounds of a plan's configurations."""
        return StillPostures(self.planner.optimizer.body, self.config.planner.posture, 2)

    @cached_property
    def forces(self) -> HandForce:
        """Room for forces that hands are told to push with."""
        return HandForce(self.robot, self.config)

    def stance(self) -> Begin:
        """Start at rest in the stance."""
        return self._at_rest(stance_q(self.spec, self.robot.model))

    def first_pose(self, chunk: ActionChunk) -> Begin:
        """Start at rest in a balanced posture, hands where the chunk begins, or as near to it as one is found."""
        found = self.postures.solve(chunk.T_world_lhand[0], chunk.T_world_rhand[0], starts=FIRST_POSE_STARTS)
        q = found.q.copy()
        for tool, fingers, limits in zip(
            self.spec.tools, (chunk.q_lhand[0], chunk.q_rhand[0]), self.planner.hand_limits, strict=True
        ):
            if tool.finger_joints:
                q[7 + self.robot.joint_indices(tool.finger_joints)] = limits.within(fingers)
        return replace(self._at_rest(q), placed=True)

    def present(self, state: RobotState) -> Begin:
        """Start as measured, hands commanded to do what they do."""
        begin = self._at_rest(state.q, state.v)
        for i, tool in enumerate(self.spec.tools):
            twist = self.robot.velocity(tool.wrist_frame)
            begin.hands.v[i], begin.hands.w[i] = twist[:3], twist[3:]
        return begin

    def judge(self, chunk: ActionChunk, begin: Begin, now: float | None = None) -> ChunkJudgement:
        """Plan a valid chunk from where it is begun, with no more effort than it takes to tell.

        Args:
            chunk: A valid chunk.
            begin: Where it is begun.
            now: When, on the clock of its observation [s]; with its first step if not given.
        """
        now = chunk.t_obs if now is None else now
        plan = self._planned(chunk, begin, now)
        times = np.arange(len(chunk)) / chunk.fps
        moved, turned = self._off(chunk, plan, times)
        margins = [
            self.start_margin(chunk, begin, now),
            *chunk_margins(chunk, self.planner.hand_limits, self.spec),
            *self.measured(self.planner.optimizer.measured(plan.knots), chunk.fps, plan.start),
            *palm_margins(moved, turned, self.config.verdict, chunk.fps),
        ]
        margins += self.around(chunk, plan)
        body = self.planner.optimizer.body
        if any(chunk.pushes) and (force := self.forces.of(chunk, plan, body, self.loads)) is not None:
            margins.append(force)
        return ChunkJudgement(plan, times, moved, turned, tuple(sorted(margins, key=lambda one: one.share)))

    def _planned(self, chunk: ActionChunk, begin: Begin, now: float) -> ChunkPlan:
        if any(self.loads) and begin.before is None and np.abs(begin.body.v).max() <= STILL:
            if (plan := self.planner.previewed(chunk, now, begin.body, begin.hands)) is not None:
                return plan
            begin = self._held(begin)
        return self.planner.plan(chunk, now, begin.body, begin.hands, begin.before, quick=True, hold=True)

    def _held(self, begin: Begin) -> Begin:
        """Where a robot at rest with something in its hands is once a first plan takes over.

        The loop holds that by a plan, too, which leads the body to where it is easier to hold: what is found from there
        may be another motion.
        """
        still, lead = staying(begin.hands.T_world_hand, begin.hands.q_finger, 0.0), self.config.planning.lead
        return self.later(self.planner.plan(still, lead, begin.body, begin.hands, hold=True), lead)

    def previews(self, chunk: ActionChunk, begin: Begin) -> bool:
        """Whether the cheap tests alone show that a chunk is done as given, with no scene around; no plan is made."""
        planner, far, still = self.planner, self.config.verdict.palm_feasible, self.start_torque(begin)
        held = still is None or still.share >= 0.0
        return held and planner.previews(chunk, chunk.t_obs, begin.body, begin.hands, far)

    def around(self, chunk: ActionChunk, plan: ChunkPlan) -> tuple[Margin, ...]:
        """The least room to what stands around the robot, if anything is near."""
        if self.scene is None:
            return ()
        near = self.scene.asked(chunk), self.scene.planned(plan, chunk)
        return tuple(sorted((one for one in near if one is not None), key=lambda one: one.margin)[:1])

    def numbers(self, chunk: ActionChunk, begin: Begin, now: float) -> dict[Limit, Margin]:
        """Room that a chunk leaves to the bounds that need no plan: on its own numbers, and what it asks of a scene."""
        found = [self.start_margin(chunk, begin, now)]
        found += [] if self.scene is None or (near := self.scene.asked(chunk)) is None else [near]
        return {one.code: one for one in found} | self.of_numbers(chunk)

    def of_numbers(self, chunk: ActionChunk) -> dict[Limit, Margin]:
        """Room that a chunk leaves to the bounds on its own numbers, wherever it is begun."""
        return {one.code: one for one in chunk_margins(chunk, self.planner.hand_limits, self.spec)}

    def exceeds(self, chunk: ActionChunk, begin: Begin) -> bool:
        """Whether a chunk's own numbers show that it is not done as given from there, with its first step."""
        numbers = self.numbers(chunk, begin, chunk.t_obs)
        forgiven = {Limit.FINGER_RANGE: FINGER_TOLERANCE, Limit.INTO_FLOOR: self.config.verdict.palm_feasible}
        limits = (Limit.START, Limit.FINGER_RANGE, Limit.INTO_FLOOR, Limit.SCENE_DISTANCE)
        return any(code in numbers and numbers[code].margin < -forgiven.get(code, 0.0) for code in limits)

    def start_margin(self, chunk: ActionChunk, begin: Begin, now: float) -> Margin:
        """How far a chunk begins from where the hands are then, now [s], against what is no continuation any more."""
        step = min(max(int(np.ceil((now - chunk.t_obs) * chunk.fps - 1e-6)), 0), len(chunk) - 1)
        away = np.linalg.norm(self.at(begin)[0] - self.asked(chunk)[0][step], axis=1)
        side, bound = int(away.argmax()), START_MAX[0]
        value = float(away[side])
        return Margin(
            code=Limit.START, subject=PALMS[side], time=step / chunk.fps, step=step, value=value, bound=bound, unit="m",
            margin=bound - value, share=(bound - value) / bound if value <= bound else min(1.0 - value / bound, -1.0),
        )  # fmt: skip

    def start_torque(self, begin: Begin) -> Margin | None:
        """Room of the motor of waist and arms that spends most on standing still where a chunk is begun.

        A share of -1 is all that the motor has. None of a robot on a plan, whose torques are bounded. One in motion
        counts as if it stood there: a measured state is never quite still.
        """
        if begin.before is not None:
            return None
        return torque_at_rest(self.planner.optimizer.body, self.planner.effort, begin.body.q)

    @property
    def spans(self) -> dict[Limit, slice]:
        """Which inequalities of a knot are of which kind."""
        return self._margins.spans

    def measured(self, problem: TrajectoryProblem, fps: float, start: float = 0.0) -> Iterator[Margin]:
        """Least room to each kind of bound of a motion whose first knot is at ``start`` [s] after the first step."""
        times = start + self.config.planner.posture.dt * np.arange(problem.K)
        return self._margins.of(problem, times, fps)

    def commanded(self, plan: ChunkPlan, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Palm points (n, 2, 3) [m] and rotations (n, 2, 3, 3) that a plan commands at parameters (n,) [s]."""
        T = np.stack([path.sample(s).T_world_hand for path in plan.paths], axis=1)
        return palm_points(T, self.planner.offsets), T[:, :, :3, :3]

    def later(self, plan: ChunkPlan, after: float) -> Begin:
        """Where a plan is after a time on it [s]."""
        s = plan.start + plan.rate * after
        row = plan.trajectory.row(s)
        rate = plan.rate if s < plan.end else 0.0
        hands = HandMotion(np.stack([path.sample(np.array([s])).rows[0] for path in plan.paths]))
        body = BodyState(plan.trajectory.q[row].copy(), rate * plan.trajectory.v[row], plan.pushes_at(s))
        before = plan.rest(s, rate, self.config.planner.posture.dt)
        return Begin(body, time_scaled(hands, rate, 0.0), before)

    def asked(self, chunk: ActionChunk) -> tuple[np.ndarray, np.ndarray]:
        """Palm points (H, 2, 3) [m] and rotations (H, 2, 3, 3) that a chunk asks for."""
        T = np.stack([chunk.T_world_lhand, chunk.T_world_rhand], axis=1)
        return palm_points(T, self.planner.offsets), T[:, :, :3, :3]

    def at(self, begin: Begin) -> tuple[np.ndarray, np.ndarray]:
        """Palm points (2, 3) [m] and rotations (2, 3, 3) that are commanded where a chunk is begun."""
        T = begin.hands.T_world_hand
        return palm_points(T, self.planner.offsets), T[:, :3, :3]

    def _off(self, chunk: ActionChunk, plan: ChunkPlan, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        s = plan.start + plan.rate * (times - plan.start)
        (p, R), (wanted_p, wanted_R) = self.commanded(plan, s), self.asked(chunk)
        due = (times > plan.start - 1e-9)[:, None]
        return due * np.linalg.norm(p - wanted_p, axis=2), due * angle_between(R, wanted_R)

    def _at_rest(self, q: np.ndarray, v: np.ndarray | None = None) -> Begin:
        v = np.zeros(self.robot.nv) if v is None else v
        self.robot.update(q, v)
        rows = [
            rest_row(self.robot.pose(tool.wrist_frame).homogeneous, q[7 + self.robot.joint_indices(tool.finger_joints)])
            for tool in self.spec.tools
        ]
        return Begin(BodyState(q.copy(), v.copy()), HandMotion(np.stack(rows)))
