"""Chunks followed as they are, by the whole-body program alone: what is left without plan, filters and gate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.spec import RobotSpec
from policy.chunk import ActionChunk
from policy.geometry.rotations import quaternion_to_matrix
from policy.geometry.se3 import make_transform
from wholebody.backends.registry import make_controller
from wholebody.config import ControllerConfig
from wholebody.control.reference_packet import COM, PALM, PackedReference, ReferenceMemory, row_length
from wholebody.control.tick_report import TickLevel, TickReport
from wholebody.errors import StateError
from wholebody.execution import standing, statuses
from wholebody.execution.ending.way_back import WayBack
from wholebody.execution.planted_feet import PlantedFeet
from wholebody.execution.state_monitor import StateMonitor
from wholebody.planning.plan import PlanReport
from wholebody.planning.trajectory import SampledTrajectory
from wholebody.reference import HandMotion, HandPath
from wholebody.robot.palms import palm_offsets
from wholebody.robot.standing import has_lost_standing
from wholebody.types import JointCommand, Reason, RobotState, StatusReport, check_state


class AsGiven:
    """Leads both hands along the C2 paths of each chunk from its first pose on; the posture is the stance.

    A `ChunkExecutor`. Nothing is planned, slowed down, bent, smoothed, lifted out of the
    floor or joined: hands that are elsewhere jump. Only what is no chunk at all is refused. What keeps the robot up is
    the program of the tick. A robot that begins elsewhere than in the stance goes there, hands left out, as slowly as
    `WayBack` does.

    Args:
        spec: The robot.
        config: Settings; the defaults if not given.

    Attributes:
        chunk: The one that is followed, or None.
        plan_report: What an episode reads of a plan: its steps are those of the chunk, and nothing was changed.
        monitor: Says which states a policy may see; the robot follows whatever is measured.
        rate, time_factor, moved_for: Likewise: nothing is slowed down, and no hand is led elsewhere.
        handover: None, for nothing is planned.
    """

    def __init__(self, spec: RobotSpec, config: ControllerConfig | None = None) -> None:
        config = config or ControllerConfig()
        # Chunks are followed as soon as they come.
        self.spec, self.config = spec, replace(config, planning=replace(config.planning, lead=0.0))
        self.controller = make_controller(spec, self.config)
        self.robot = self.controller.robot
        self._offsets = palm_offsets(spec)
        self._fingers = [self.robot.joint_indices(tool.finger_joints) for tool in spec.tools]
        self._memory = ReferenceMemory(np.zeros(row_length(self.robot.n_joints)))
        self.monitor, self._planted = StateMonitor(self.robot), PlantedFeet(self.controller)
        self.contacts = self._planted.contacts
        self._way: WayBack | None = None
        self.rate = self.time_factor = 1.0
        self.moved_for: Reason | None = None
        self.handover: None = None
        self.carried, self.walks, self.not_led = None, False, None

    def reset(self, state: RobotState, now: float | None = None) -> None:
        """Start an episode, now [s], from a measured state of standing; `InputError` if it is none of this robot."""
        check_state(state, self.robot.n_joints)
        self.controller.reset(state)
        self.controller.trust_hands(1.0, 1.0)
        self.monitor.reset(state)
        begin = SampledTrajectory.still(self.robot, state.q)
        self.contacts = self._planted.reset(state)
        self._way = WayBack(self.robot, begin, self._planted.stance)
        self._motions = [HandMotion(row[None]) for row in standing.hands_at_rest(self.robot, state.q)]
        self._palms = [palm_rows(*pair) for pair in zip(self._motions, self._offsets, strict=True)]
        self._body(self._way.advance(0.0))
        self._hands(0)
        self._now = self._since = state.time if now is None else now
        self.status, self._fallen = statuses.NO_CHUNK, False
        self.chunk: ActionChunk | None = None
        self.plan_report: PlanReport | None = None
        self.last_tick: TickReport | None = None

    def accept(self, chunk: ActionChunk, now: float | None = None) -> StatusReport:
        """Take a chunk; only one that is malformed, over, or from the future is refused.

        Raises:
            StateError: Before the first `reset`.
        """
        if self._way is None:
            raise StateError("`accept` before `reset`: there is no state yet that the robot stands in")
        now = self._now if now is None else now
        if (fault := statuses.chunk_fault(chunk, self.chunk, now, self.spec)) is not None:
            return fault
        times, dt, begin = np.arange(len(chunk)) / chunk.fps, self.config.dt, now - chunk.t_obs
        hands = (chunk.T_world_lhand, chunk.q_lhand), (chunk.T_world_rhand, chunk.q_rhand)
        paths = [HandPath.from_knots(times, T, q) for T, q in hands]
        end = max(path.span[1] for path in paths)
        ticks = begin + dt * np.arange(int(np.ceil(max(end - begin, 0.0) / dt)) + 1)
        # The path begins at its first pose, moving: what leads there from rest is left out.
        self._motions = [path.sample(np.maximum(ticks, 0.0)) for path in paths]
        self._palms = [palm_rows(*pair) for pair in zip(self._motions, self._offsets, strict=True)]
        self.chunk, self._since = chunk, now
        still = np.zeros((len(times), 2))
        self.plan_report = PlanReport(np.maximum(times, begin), still, 1.0, still[:, 0])
        return statuses.TRACKING

    def take_refusal(self) -> None:
        """Nothing is refused later than when it comes."""

    def palm_reference(self) -> dict[str, np.ndarray]:
        """Commanded palm poses in world, 4x4, by side."""
        palms = self._memory.palms
        return {
            tool.side: make_transform(row[:9].reshape(3, 3), row[9:12].copy())
            for tool, row in zip(self.spec.tools, palms, strict=True)
        }

    def ahead(self, times: np.ndarray) -> tuple[HandMotion, HandMotion] | None:
        """What both hands will be commanded at times (n,) near the present [s]; None while no chunk is followed."""
        if self.chunk is None:
            return None
        return tuple(HandMotion(motion.rows[self._row(np.asarray(times))]) for motion in self._motions)

    def step(self, state: RobotState, now: float | None = None) -> JointCommand:
        """Command for one control period, from a measured state.

        Raises:
            StateError: Before the first `reset`.
        """
        if self._way is None:
            raise StateError("`step` before `reset`: there is no state yet that the robot stands in")
        now = state.time if now is None else now
        elapsed, self._now = max(now - self._now, 0.0), now
        self._fallen = self._fallen or has_lost_standing(state)
        if self._fallen:
            self.status = statuses.STANDING_LOST
            return standing.damping_command(self.spec, self.robot, state)
        if self._way.seconds > 0.0:
            self._body(self._way.advance(elapsed))
        self._hands(int(self._row(now)))
        command, self.last_tick = self.controller.step(state, PackedReference(self._memory.row), elapsed)
        self.status = self._status()
        return command

    def _row(self, times: np.ndarray | float) -> np.ndarray:
        """Rows of the motions at times [s]; the ends are held."""
        rows = np.rint((times - self._since) / self.config.dt).astype(int)
        return np.clip(rows, 0, len(self._motions[0].rows) - 1)

    def _hands(self, k: int) -> None:
        for i, (motion, palms) in enumerate(zip(self._motions, self._palms, strict=True)):
            self._memory.row[PALM * i : PALM * (i + 1)] = palms[k]
            n, row = len(self._fingers[i]), motion.rows[k]
            for order, first in enumerate((19, 26, 33)):
                self._memory.posture[order][self._fingers[i]] = row[first : first + n]

    def _body(self, still: SampledTrajectory) -> None:
        """Body reference at rest, from one row."""
        memory = self._memory
        memory.row[COM:] = 0.0
        memory.com[:3], memory.height[0], memory.posture[0] = still.com[0, 0], still.height[0, 0], still.q[0, 7:]
        memory.pelvis[:9], memory.torso[:9] = still.pelvis[0].ravel(), still.torso[0].ravel()

    def _status(self) -> StatusReport:
        if self.last_tick.level is TickLevel.FAILED:
            return statuses.FAILED
        if self.last_tick.level is TickLevel.NO_HANDS:
            return statuses.NO_HANDS
        if self.chunk is None:
            return statuses.NO_CHUNK
        return statuses.STARVED if self._now > self.chunk.times[-1] + 0.5 else statuses.TRACKING


def palm_rows(motion: HandMotion, offset: np.ndarray) -> np.ndarray:
    """The motion of a palm point from that of its wrist.

    Args:
        motion: Rows (n, 40).
        offset: Palm point in the axes of the wrist (3,) [m].

    Returns:
        Rotation (9), position (3), twist (6) and acceleration (6) in world axes, shape (n, 24).
    """
    R = quaternion_to_matrix(motion.quat, "xyzw")
    r, w, alpha = R @ offset, motion.w, motion.alpha
    v, a = np.cross(w, r), np.cross(alpha, r) + np.cross(w, np.cross(w, r))
    return np.hstack([R.reshape(-1, 9), motion.p + r, motion.v + v, w, motion.a + a, alpha])
