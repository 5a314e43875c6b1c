"""Between chunk and joint command: refuse, contain, slow down, hold, and stay on one's feet."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from policy.chunk import ActionChunk
from policy.errors import ChunkError
from wholebody.backends import make_controller
from wholebody.config import ControllerConfig
from wholebody.controller import BodyReference, PalmReference, TickReport
from wholebody.denoise import denoised
from wholebody.errors import InputError
from wholebody.limits.balance import natural_frequency
from wholebody.planner import ChunkPlan, ChunkPlanner, PlanReport, PostureState, PostureTrack
from wholebody.reference import HandMotion, PathClock, ReferenceSmoother, rest_row, time_scaled
from wholebody.types import JointCommand, RobotState, Status, StatusReport, check_state

DAMPING_KD = 8.0
"""Joint damping once standing is lost: what Unitree's own damping command uses [N m s/rad]."""
FALL_TILT = np.deg2rad(60.0)
"""Pelvis tilt past which standing is lost [rad]."""
FALL_HEIGHT = 0.20
"""Pelvis height below which standing is lost [m]."""


class Supervisor:
    """Owns planner and controller; the only thing a runtime talks to.

    `accept` takes chunks as they come, `step` answers every control period. Neither raises on bad input: a chunk that
    cannot be used is refused with a reason code and the robot goes on, or holds.
    """

    def __init__(self, spec: RobotSpec, config: ControllerConfig | None = None) -> None:
        self.spec, self.config = spec, config or ControllerConfig()
        self.controller = make_controller(spec, self.config)
        self.robot = self.controller.robot
        self.planner = ChunkPlanner(spec, self.robot, self.config.planner)
        self._fingers = [self.robot.joint_indices(tool.finger_joints) for tool in spec.tools]
        self._offsets = [np.array(tool.palm_offset) for tool in spec.tools]
        self.status = StatusReport(Status.HOLD, "no_chunk", "no chunk yet: holding the stance")
        self.plan_report: PlanReport | None = None
        self.last_tick: TickReport | None = None
        self._plan: ChunkPlan | None = None
        self._smoother: ReferenceSmoother | None = None

    def reset(self, state: RobotState) -> None:
        """Start an episode from a measured state of standing.

        Raises:
            InputError: If the state is not a finite state of this robot.
        """
        check_state(state, self.robot.n_joints)
        self.controller.reset(state)
        self._track = PostureTrack.still(self.robot, state.q)
        rows = np.stack([self._rest_row(side, state.q) for side in (0, 1)])
        self._smoother = ReferenceSmoother(rows, self.planner.caps)
        self._clock, self._plan, self._chunk = PathClock(0.0), None, None
        self._posture = PostureState.still(state.q, self.robot.nv)
        self._elapsed = self._travelled = 0.0
        self._fallen = False
        self.status = StatusReport(Status.HOLD, "no_chunk", "no chunk yet: holding the stance")
        self._refused: StatusReport | None = None
        self._noisy: tuple[str, ...] = ()
        self._last_state = state

    @property
    def time_factor(self) -> float:
        """Time spent on chunks over chunk time covered; 1 is unslowed."""
        return self._elapsed / self._travelled if self._travelled > 1e-6 else 1.0

    @property
    def chunk(self) -> ActionChunk | None:
        """The chunk that was accepted last."""
        return self._chunk

    def palm_reference(self) -> dict[str, np.ndarray]:
        """Commanded palm poses in world, 4x4, by side."""
        poses = self._smoother.motion.T_world_hand.copy()
        for i, offset in enumerate(self._offsets):
            poses[i, :3, 3] += poses[i, :3, :3] @ offset
        return {"left": poses[0], "right": poses[1]}

    def ahead(self, times: np.ndarray) -> tuple[HandMotion, HandMotion] | None:
        """What both hands will be commanded at times near the present, as planned and at the present speed.

        Args:
            times: Shape (n,), [s]; past the end of the plan its last pose is held.

        Returns:
            Rows (n, 40) a hand, derivatives with respect to the path; None before the first chunk.
        """
        if self._plan is None:
            return None
        s = self._clock.s + self._clock.rate * (np.asarray(times) - self._last_state.time)
        left, right = (path.sample(np.clip(s, self._plan.start, self._plan.end)) for path in self._plan.paths)
        return left, right

    def accept(self, chunk: ActionChunk) -> StatusReport:
        """Take a chunk, or refuse it with a reason; a refused chunk changes nothing."""
        now = self._last_state.time
        try:
            chunk.validate(after=self._chunk)
        except (ChunkError, ValueError) as error:
            return self._refuse("chunk_invalid", str(error))
        if chunk.times[-1] <= now:
            age = now - chunk.t_obs
            return self._refuse("chunk_stale", f"the chunk's last step is over: it is {age:.2f} s old")
        if chunk.t_obs > now + 1.0 / chunk.fps:
            return self._refuse("chunk_from_future", f"t_obs {chunk.t_obs:.3f} s is after now, {now:.3f} s")
        try:
            commanded = HandMotion(self._smoother.motion.rows.copy())
            meant, noisy = denoised(chunk, self.planner.caps)
            start, before = self._start()
            plan = self.planner.plan(meant, now, start, commanded, before)
        except (InputError, RuntimeError, ValueError) as error:
            return self._refuse("planning_failed", str(error))
        if not plan.report.safe and self._is_safe_ahead():
            return self._refuse(
                "not_joined",
                "no balanced motion leads from here to the chunk, so the one before is followed to its end: "
                "a chunk that begins nearer to the hands, or slower, would be joined",
            )
        self._plan, self._chunk, self._refused = plan, chunk, None
        self.plan_report, self._noisy = plan.report, noisy
        self._clock = PathClock(plan.start, plan.rate, 0.0)
        return self._report_plan()

    def _is_safe_ahead(self) -> bool:
        """Whether the present plan is balanced, followed and not over."""
        plan = self._plan
        return plan is not None and plan.report.safe and self._clock.s < plan.end and not self._lost()

    def _start(self) -> tuple[PostureState, np.ndarray | None]:
        """Where the next plan begins, and what the present one would have done from now on.

        A plan continues the one before, so that nothing jumps; a robot that has left its plan is planned from where it
        is. The rest of the plan is configurations one step of the posture plan apart.
        """
        state = self._last_state
        if self._lost():
            return PostureState(state.q.copy(), state.v.copy()), None
        if self._plan is None:
            return self._posture, None
        track, step = self._plan.posture, self._clock.rate * self.config.planner.posture.dt
        s = self._clock.s + step * np.arange(1.0, 1.0 + (self._plan.end - self._clock.s) / max(step, 1e-3))
        return self._posture, track.q[[track.row(x) for x in s]]

    def _lost(self) -> bool:
        """Whether the robot has left its plan."""
        distance = np.abs(self._last_state.q[7:] - self._posture.q[7:])
        distance[self.controller.finger_indices] = 0.0
        return bool(distance.max() > self.config.safety.posture_lost)

    def step(self, state: RobotState) -> JointCommand:
        """Command for one control period."""
        try:
            check_state(state, self.robot.n_joints)
        except InputError as error:
            self.status = StatusReport(Status.HOLD, "state_invalid", str(error))
            return self._blind_command(self._last_state)
        self._last_state = state
        if self._fallen or self._has_fallen(state):
            self._fallen = True
            self.status = StatusReport(
                Status.DAMPING, "standing_lost", "the robot is no longer standing: joints damped"
            )
            return self._damping_command(state)
        reference = self._reference(state)
        command, self.last_tick = self.controller.step(state, reference)
        self._judge()
        return command

    def _reference(self, state: RobotState) -> BodyReference:
        dt = self.config.dt
        rows = self._smoother.motion.rows
        if self._plan is None:
            target = self._smoother_target_rest
        else:
            wanted = self._plan.rate * self._governor(state)
            self._clock = self._clock.advance(dt, wanted)
            target = np.stack([path.at(self._clock.s) for path in self._plan.paths])
            target = time_scaled(HandMotion(target), self._clock.rate, self._clock.change).rows
            if self._clock.s < self._chunk.times[-1] - self._chunk.t_obs:
                self._elapsed += dt
                self._travelled += dt * self._clock.rate
        rows = self._smoother.step(target, dt).rows
        reference = self._body_reference(rows)
        self._trust_hands(state, reference)
        return reference

    def _body_reference(self, rows: np.ndarray) -> BodyReference:
        motion = HandMotion(rows)
        track, rate = self._track, 0.0
        if self._plan is not None:
            track, rate = self._plan.posture, self._clock.rate
        k = track.row(self._clock.s)
        q, v = track.q[k].copy(), rate * track.v[k]
        dq, ddq = v[6:].copy(), rate**2 * track.ddq[k]
        self._posture = PostureState(track.q[k].copy(), rate * track.v[k])
        for i, joints in enumerate(self._fingers):
            q[7 + joints], dq[joints], ddq[joints] = motion.q_finger[i], motion.dq_finger[i], motion.ddq_finger[i]
        return BodyReference(
            palms=tuple(self._palm(motion, i) for i in (0, 1)),
            q=q,
            dq=dq,
            ddq=ddq,
            pelvis=(track.pelvis[0][k], rate * track.pelvis[1][k], rate**2 * track.pelvis[2][k]),
            torso=(track.torso[0][k], rate * track.torso[1][k], rate**2 * track.torso[2][k]),
            height=(track.height[0, k], rate * track.height[1, k], rate**2 * track.height[2, k]),
            com=(track.com[0, k], rate * track.com[1, k], rate**2 * track.com[2, k]),
            momentum=(rate * track.momentum[0, k], rate**2 * track.momentum[1, k]),
        )

    def _palm(self, motion: HandMotion, i: int) -> PalmReference:
        """The wrist's motion, seen at the palm point."""
        R = pin.Quaternion(motion.quat[i]).toRotationMatrix()
        arm = R @ self._offsets[i]
        w, alpha = motion.w[i], motion.alpha[i]
        twist = np.concatenate([motion.v[i] + _cross(w, arm), w])
        acceleration = np.concatenate([motion.a[i] + _cross(alpha, arm) + _cross(w, _cross(w, arm)), alpha])
        return PalmReference(T_world=pin.SE3(R, motion.p[i] + arm), twist=twist, acceleration=acceleration)

    def _governor(self, state: RobotState) -> float:
        """Share of the planned speed that tracking and balance allow, 0 to 1."""
        safety = self.config.safety
        error = max(np.linalg.norm(task.error(self.robot)[:3]) for task in self.controller.palms)
        share = np.clip((safety.error_stop - error) / (safety.error_stop - safety.error_slow), 0.0, 1.0)
        capture = self.robot.com[:2] + self.robot.com_velocity[:2] / natural_frequency(self.robot)
        margin = self.controller.balance.support.margin(capture)
        return float(min(share, np.clip(margin / safety.balance_slow, 0.0, 1.0)))

    def _trust_hands(self, state: RobotState, reference: BodyReference) -> None:
        """Let the hands give way where the body leaves its plan: near a straight arm they would drag it along."""
        safety = self.config.safety
        distance = np.abs(state.q[7:] - reference.q[7:])
        distance[self.controller.finger_indices] = 0.0
        room = (safety.posture_stop - distance.max()) / (safety.posture_stop - safety.posture_slow)
        for task in self.controller.palms:
            task.share = float(np.clip(room, 1e-3, 1.0))

    def _judge(self) -> None:
        """Status after a tick, worst first."""
        if self.last_tick.level == 2:
            self.status = StatusReport(Status.STOP, "qp_failed", "no program had a solution: last torques held")
        elif self.last_tick.level == 1:
            self.status = StatusReport(Status.STOP, "hands_dropped", "balance needs everything: hands give way")
        elif self._plan is None:
            self.status = self._refused or StatusReport(Status.HOLD, "no_chunk", "no chunk yet: holding the stance")
        elif self._clock.s > self._plan.end or self._last_state.time > self._chunk.times[-1] + 0.5:
            self.status = self._refused or StatusReport(Status.HOLD, "starved", "the chunk is over: holding its end")
        else:
            self._report_plan()

    def _report_plan(self) -> StatusReport:
        if self._refused is not None:
            self.status = self._refused
        elif self._plan.report.reasons:
            report = self._plan.report
            detail = f"targets moved by up to {report.clamped.max():.3f} m, slowed {report.slowdown:.2f} times"
            self.status = StatusReport(Status.SLOWED, report.reasons[0], detail)
        elif self._noisy:
            detail = f"steps scatter: followed the curve through them in {', '.join(self._noisy)}"
            self.status = StatusReport(Status.SLOWED, "noisy_chunk", detail)
        elif self._clock.rate < 0.98:
            self.status = StatusReport(Status.SLOWED, "tracking", f"slowed to {self._clock.rate:.2f} of chunk speed")
        else:
            self.status = StatusReport(Status.TRACKING, "", "")
        return self.status

    def _refuse(self, reason: str, detail: str) -> StatusReport:
        self._refused = self.status = StatusReport(Status.HOLD, reason, detail)
        return self.status

    def _has_fallen(self, state: RobotState) -> bool:
        x, y = state.q[3], state.q[4]
        tilt = np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0))
        return bool(tilt > FALL_TILT or state.q[2] < FALL_HEIGHT)

    def _damping_command(self, state: RobotState) -> JointCommand:
        zero = np.zeros(self.spec.n_joints)
        # Wrists and fingers are too light for the full damping: at 500 Hz it would shake them.
        light = [("_wrist_" in name or "_hand_" in name) for name in self.spec.joint_names]
        kd = np.where(light, self.spec.kd, DAMPING_KD)
        return JointCommand(state.time, state.q[7:][self.robot.pin_to_motor], zero, zero, zero, kd)

    def _blind_command(self, state: RobotState) -> JointCommand:
        """Without a usable state: the last command again, at rest."""
        c, order = self.controller, self.robot.pin_to_motor
        return JointCommand(
            state.time, c.q_des[order], np.zeros(self.spec.n_joints), c._tau[order], self.spec.kp, self.spec.kd
        )

    def _rest_row(self, side: int, q: np.ndarray) -> np.ndarray:
        T = self.robot.pose(self.spec.tools[side].wrist_frame).homogeneous
        row = rest_row(T, q[7 + self._fingers[side]])
        self._smoother_target_rest = row[None] if side == 0 else np.vstack([self._smoother_target_rest, row[None]])
        return row


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product of two vectors (3,), ten times faster than numpy's."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
