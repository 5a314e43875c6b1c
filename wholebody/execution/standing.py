"""Off any plan: standing where the robot is, hands let go of, and joints only damped once standing is lost."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from policy.chunk import ActionChunk
from policy.geometry.rotations import matrix_to_quaternion
from wholebody.config import ControllerConfig
from wholebody.control.base import Controller
from wholebody.execution import statuses
from wholebody.execution.ahead.foreseen import Foreseen
from wholebody.execution.ending.leaning import words
from wholebody.execution.ending.way_back import WayBack
from wholebody.execution.plan_follower import PlanFollower
from wholebody.execution.planted_feet import PlantedFeet
from wholebody.execution.states import OFF_PLAN, Event, Machine
from wholebody.planning.judgement.holding import HOLD_SPEC_ID, staying
from wholebody.planning.trajectory import BodyState, SampledTrajectory
from wholebody.reference import HandMotion, ReferenceSmoother, rest_row
from wholebody.robot.kernels.pendulum import natural_frequency
from wholebody.robot.state import Robot
from wholebody.robot.support_polygon import SupportPolygon
from wholebody.types import JointCommand, RobotState, StatusReport

DAMPING_KD = 8.0
"""Joint damping once standing is lost: what Unitree's own damping command uses [N m s/rad]."""
AGAIN_WITHIN = 1.6
"""Time since the robot last stood off its plan within which it then stands for longer, and longest that it stands
before it tries to join a chunk [s]; chosen: three doublings of the first wait."""
FIRST_WAIT = 0.2
"""Time to stand before a plan is joined, the second time [s]; chosen: as long as from one attempt to join a chunk to
the next."""
GO_BACK = 0.4
"""Time for which the robot goes on towards its stance before it stands for another plan [s]; chosen: it is as fast as
it gets within 0.2 s, and a plan is asked for twice a second."""
FAST = 3.0
"""Speed of the fastest joint up to which a robot that leaves its plan goes back at once if its waist is spent [rad/s];
chosen: above it, it comes to rest more than 0.2 rad further on."""
HAND_LOST = 0.04
"""Distance of a wrist from where it was to stand off the plan up to which a plan from there is taken [m]; chosen: a
hand that sinks under its load is further off, and to jerk it back takes the body along."""
PROJECTIONS = 4
"""Times that a point is projected on all edges: one each, and again for what that moved over another."""


class Patience:
    """Waiting time before a plan is joined again: 0 at first, then doubled each time that the robot soon leaves one."""

    def __init__(self) -> None:
        self._last, self._wait = -inf, 0.0

    def wait(self, now: float) -> float:
        """Time to stand before a chunk is joined [s], now that the robot stands [s]."""
        soon = now - self._last < AGAIN_WITHIN
        self._wait, self._last = (min(max(2.0 * self._wait, FIRST_WAIT), AGAIN_WITHIN) if soon else 0.0), now
        return self._wait


class Reflex:
    """What the robot does off any plan, within the tick: it stands; where no plan leads on, it goes back to its stance.

    Args:
        controller: Of the robot on its feet.
        config: Its configuration.
        follower: Told what to follow.
        smoother: Of the hands.
        planted: Has the stance on its feet.
        states: What the robot follows.

    Attributes:
        status: What a person sees of it then.
    """

    def __init__(
        self,
        controller: Controller,
        config: ControllerConfig,
        follower: PlanFollower,
        smoother: ReferenceSmoother,
        planted: PlantedFeet,
        states: Machine,
    ) -> None:
        self._controller, self._config, self._follower, self._smoother = controller, config, follower, smoother
        self._planted, self._states = planted, states
        self._patience = Patience()
        self._back: WayBack | None = None
        robot, self._share = controller.robot, config.planner.posture.torque_share
        self._waist = np.flatnonzero(np.isin(robot.motor_to_pin, controller.spec.limbs["waist"])).tolist()
        self.status = statuses.OFF_PLAN

    @property
    def active(self) -> bool:
        """Whether the robot is off any plan."""
        return self._states.now in OFF_PLAN

    def stand(self, state: RobotState, now: float) -> float:
        """Come to rest where the robot is, hands let go of; the time to stand before a chunk is joined [s].

        Where the waist cannot hold what is above it, the robot goes towards its stance at once. One that still moves
        fast comes to rest first, which may lead elsewhere.
        """
        here, event = self._hold_still(state), Event.LOST
        if np.abs(state.v[6:]).max() <= FAST and self._sinks(state):
            self._back = WayBack(self._controller.robot, here, self._planted.stance, straight=False)
            event = Event.SPENT
        self._states.on(event)
        self.status = statuses.OFF_PLAN
        return self._patience.wait(now)

    def foreseen(self, state: RobotState, ticks: int) -> Foreseen:
        """What a plan is to begin with so many control periods from now: the robot stands still until then.

        One whose waist could not hold it still goes on towards its stance.
        """
        if self._back is not None and not self._sinks(state):
            self._hold_still(state)
            self._states.on(Event.PLANNED_FROM)
        self._smoother.reset(hands_as_measured(self._controller.robot, self._smoother.motion.rows))
        resting = self._resting(state) if self._back is None else self._back.posture(ticks * self._config.dt)
        return replace(self._follower.foreseen(ticks), body=BodyState.still(resting, len(state.v)))

    def is_away(self, state: RobotState) -> bool:
        """Whether the robot is off any plan, or without one and not in its stance."""
        return self.active or self._follower.distance(state.q, self._planted.stance) > self._config.safety.posture_slow

    def is_elsewhere(self, state: RobotState, begin: np.ndarray) -> bool:
        """Whether the robot, off its last plan, is not where the next one begins, configuration (nq,)."""
        follower, lost = self._follower, self._config.safety.posture_lost
        near = follower.distance(state.q, begin) <= lost and follower.hands_off(state.q, begin) <= HAND_LOST
        return self.active and not near

    def go_back(self, state: RobotState) -> float:
        """Go towards the stance; the time after which a chunk is to be joined from where the robot is then [s]."""
        if self._back is None:
            self._back = WayBack(self._controller.robot, self._hold_still(state), self._planted.stance)
        self._states.on(Event.NO_WAY)
        leaning = words(self._controller, self._config.planner.posture.com_margin)
        detail = f"{statuses.GOING_BACK.detail}; {leaning}" if leaning else statuses.GOING_BACK.detail
        self.status = replace(statuses.GOING_BACK, detail=detail)
        return GO_BACK

    def go_to(self, state: RobotState, posture: np.ndarray, status: StatusReport) -> None:
        """Go to a posture (nq,) from where the robot is, whatever it does, and stay there."""
        self._back = WayBack(self._controller.robot, self._hold_still(state), posture)
        self.status = status

    @property
    def has_arrived(self) -> bool:
        """Whether the way to where the robot goes off any plan is over."""
        return self._back is not None and self._back.is_over

    def advance(self, elapsed: float) -> None:
        """Go on towards the stance for so long [s], if that is where to go and the balance allows it."""
        if self._back is not None and not self._follower.near_edge:
            self._follow(self._back.advance(elapsed))

    def end(self) -> None:
        """Go nowhere any more: a plan is followed, or the stance is reached."""
        self._back = None

    def _hold_still(self, state: RobotState) -> SampledTrajectory:
        """Come to rest where the robot is: the one row that is followed."""
        robot, support = self._controller.robot, self._controller.support
        margin, self._back = self._config.planner.posture.com_margin, None
        trajectory = standing_trajectory(robot, self._resting(state), support, margin)
        self._follow(trajectory)
        return trajectory

    def _sinks(self, state: RobotState) -> bool:
        """Whether the upper body at rest asks for more torque of the waist than plans may."""
        robot = self._controller.robot
        gravity = pin.computeGeneralizedGravity(robot.model, robot.scratch, state.q)[6:][self._waist]
        return bool((np.abs(gravity) > self._share * self._controller.effort_max[self._waist]).any())

    def _follow(self, trajectory: SampledTrajectory) -> None:
        """Be led to one row, the hands to where it has them: a plan begins with both."""
        self._follower.stand(trajectory, hands_at_rest(self._controller.robot, trajectory.q[0]))

    def _resting(self, state: RobotState) -> np.ndarray:
        """Where the robot comes to rest, configuration (nq,)."""
        return resting_posture(state.q, state.v, self._config.body.posture_kd)


def hands_at_rest(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Motions of hands that stay where a configuration (nq,) has them, rows (2, 40)."""
    tools, data = robot.spec.tools, robot.scratch
    pin.framesForwardKinematics(robot.model, data, q)
    poses = [data.oMf[robot.frame_id(tool.wrist_frame)].homogeneous for tool in tools]
    fingers = [q[7 + robot.joint_indices(tool.finger_joints)] for tool in tools]
    return np.stack([rest_row(T, joints) for T, joints in zip(poses, fingers, strict=True)])


def to_hold(newest: ActionChunk | None, motion: HandMotion, now: float) -> ActionChunk:
    """Chunk to go on with: the newest one, or steps that stay where it ended, or where hands are commanded to be."""
    if newest is not None and newest.times[-1] > now:
        return newest
    if newest is None:
        T, fingers = motion.T_world_hand, motion.q_finger
    else:
        T = [newest.T_world_lhand[-1], newest.T_world_rhand[-1]]
        fingers = [newest.q_lhand[-1], newest.q_rhand[-1]]
    return staying(T, fingers, now)


def is_hold(chunk: ActionChunk) -> bool:
    """Whether the supervisor made a chunk to hold its position."""
    return chunk.spec_id == HOLD_SPEC_ID


def hands_as_measured(robot: Robot, commanded: np.ndarray) -> np.ndarray:
    """Motions of the hands as they are, rows (2, 40); fingers as commanded, accelerations unknown and taken as 0."""
    rows = commanded.copy()
    motion = HandMotion(rows)
    motion.a[:], motion.alpha[:] = 0.0, 0.0
    for i, tool in enumerate(robot.spec.tools):
        pose, twist = robot.pose(tool.wrist_frame), robot.velocity(tool.wrist_frame)
        motion.p[i], motion.quat[i] = pose.translation, matrix_to_quaternion(pose.rotation, "xyzw")
        motion.v[i], motion.w[i] = twist[:3], twist[3:]
    return rows


def resting_posture(q: np.ndarray, v: np.ndarray, kd: float) -> np.ndarray:
    """Where joints that are only damped come to rest: configuration (nq,), the base as it is; ``kd`` [1/s]."""
    rest = q.copy()
    rest[7:] += v[6:] / kd
    return rest


def standing_trajectory(robot: Robot, q: np.ndarray, support: SupportPolygon, margin: float) -> SampledTrajectory:
    """One row at rest: a posture, the trunk as it is, the centre of mass where the robot tips over least.

    That is its capture point, to which a pendulum comes by itself, moved inside the support where it is not.

    Args:
        robot: In its present state.
        q: The posture, shape (nq,).
        support: Of both soles.
        margin: Distance of the centre of mass from its edge [m].
    """
    still = SampledTrajectory.still(robot, q)
    com = still.com.copy()
    com[0, :, :2] = inside(support, robot.com[:2] + robot.com_velocity[:2] / natural_frequency(robot.com[2]), margin)
    return replace(still, com=com)


def inside(support: SupportPolygon, point: np.ndarray, margin: float) -> np.ndarray:
    """A point (2,) near the given one that is that far inside a support [m], by projection on edge after edge."""
    point = np.array(point)
    for _ in range(PROJECTIONS):
        for normal, offset in zip(support.normals, support.offsets - margin, strict=True):
            point -= max(normal @ point - offset, 0.0) * normal
    return point


def damping_command(spec: RobotSpec, robot: Robot, state: RobotState) -> JointCommand:
    """Joints only damped. Wrists and fingers are too light for the full damping: at 500 Hz it would shake them."""
    zero = np.zeros(spec.n_joints)
    light = spec.parts("wrist") | spec.is_finger
    kd = np.where(light, spec.kd, DAMPING_KD)
    return JointCommand(state.time, state.q[7:][robot.pin_to_motor], zero, zero, zero, kd)
