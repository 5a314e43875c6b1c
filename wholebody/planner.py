"""From an action chunk to a plan: hand paths that can be had, a posture to go with them, and how fast.

Slow down along the chunk first, shift the body second (the posture plan), bend the hand path last (the clamp).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import pinocchio as pin
from scipy.interpolate import CubicSpline

from models.spec import RobotSpec
from policy.chunk import ActionChunk
from wholebody.config import PlannerConfig
from wholebody.reference import HandCaps, HandMotion, HandPath
from wholebody.reference.posture_plan import PosturePlanner
from wholebody.robot import Robot

GRID = 0.004
"""Spacing of the sampled posture [s]."""
GRAVITY = 9.81
"""[m/s^2]"""


@dataclass(frozen=True)
class PostureTrack:
    """The posture plan on a regular grid of the path parameter.

    Attributes:
        start: Parameter of the first row [s].
        q: Configurations, shape (n, nq). v: Joint speeds with respect to ``s``, shape (n, n_joints).
        com, com_velocity, com_acceleration: Shape (n, 3), with respect to ``s``.
        R_pelvis, R_torso: Shape (n, 3, 3).
    """

    start: float
    q: np.ndarray
    v: np.ndarray
    com: np.ndarray
    com_velocity: np.ndarray
    com_acceleration: np.ndarray
    R_pelvis: np.ndarray
    R_torso: np.ndarray

    def row(self, s: float) -> int:
        """Nearest row; the ends are held."""
        return int(min(max(round((s - self.start) / GRID), 0), len(self.q) - 1))


@dataclass(frozen=True)
class PlanReport:
    """What had to be changed for a chunk to be feasible.

    Attributes:
        clamped: How far each hand was moved at each remaining step, shape (H, 2), [m].
        slowdown: Factor by which each remaining step takes longer, shape (H,), at least 1.
        zmp_margin: Distance of the planned zero-moment point from the edge of the support, shape (H,), [m].
        reasons: Stable reason codes.
        failed_steps: Steps at which the inverse kinematics found no solution and stayed where it was.
    """

    clamped: np.ndarray
    slowdown: np.ndarray
    zmp_margin: np.ndarray
    reasons: tuple[str, ...] = ()
    failed_steps: int = 0


@dataclass(frozen=True)
class ChunkPlan:
    """A chunk made feasible; parameters ``s`` are seconds since the chunk's observation."""

    paths: tuple[HandPath, HandPath]
    posture: PostureTrack
    steps: np.ndarray
    report: PlanReport
    rates: np.ndarray = field(default_factory=lambda: np.ones(1))

    def rate(self, s: float) -> float:
        """Speed along the chunk at parameter ``s``, 1 being the chunk's own."""
        return float(np.interp(s, self.steps, self.rates))


class ChunkPlanner:
    """Plans chunks; keeps the planned configuration so that successive plans agree."""

    def __init__(self, spec: RobotSpec, robot: Robot, config: PlannerConfig) -> None:
        self.spec, self.config = spec, config
        self.model, self.data = robot.model, robot.model.createData()
        self.motor_to_pin, self.pin_to_motor = robot.motor_to_pin, robot.pin_to_motor
        self.posture = PosturePlanner(spec, config.posture)
        self.palm_ids = [robot.frame_id(tool.palm_frame) for tool in spec.tools]
        self.torso_id, self.pelvis_id = robot.frame_id(spec.torso_body), robot.frame_id(spec.base_body)
        self.offsets = np.array([tool.palm_offset for tool in spec.tools])
        low, high = spec.position_min, spec.position_max
        fingers = [spec.indices(tool.finger_joints) for tool in spec.tools]
        self.caps = tuple(
            HandCaps(finger_lower=tuple(low[i]), finger_upper=tuple(high[i])) if len(i) else HandCaps() for i in fingers
        )

    def plan(self, chunk: ActionChunk, now: float, q_plan: np.ndarray, commanded: HandMotion) -> ChunkPlan:
        """Plan the rest of a chunk.

        Args:
            chunk: A valid chunk.
            now: Present time [s].
            q_plan: Where the posture plan is now, shape (nq,).
            commanded: What the two hands are commanded to do now, rows (2, 40).
        """
        s0 = now - chunk.t_obs
        times = np.arange(len(chunk)) / chunk.fps
        poses = (chunk.T_world_lhand, chunk.T_world_rhand)
        fingers = (chunk.q_lhand, chunk.q_rhand)
        raw = [
            HandPath.from_knots(times, T, q, caps=caps).joined(HandMotion(commanded.rows[i]), s0)
            for i, (T, q, caps) in enumerate(zip(poses, fingers, self.caps, strict=True))
        ]
        end = max(path.span[1] for path in raw)
        steps = np.arange(s0, max(end, s0 + 2.0 / chunk.fps) + 1e-9, 1.0 / chunk.fps)
        wanted = np.stack([path.sample(steps).T_world_hand for path in raw], axis=1)
        palms = wanted.copy()
        palms[:, :, :3, 3] += np.einsum("khij,hj->khi", wanted[:, :, :3, :3], self.offsets)
        q, failed = self.posture.plan(q_plan, palms, 1.0 / chunk.fps)
        q[0] = q_plan
        reached = self._palms(q)
        paths, clamped = self._clamp(raw, steps, wanted, palms, reached, commanded, s0)
        track, zmp_margin, slowdown = self._posture_track(steps, q)
        reasons = []
        if clamped.max() > 0.0:
            reasons.append("out_of_reach")
        if slowdown.max() > 1.001:
            reasons.append("too_fast_for_balance")
        if failed:
            reasons.append("posture_infeasible")
        report = PlanReport(clamped, slowdown, zmp_margin, tuple(reasons), failed)
        return ChunkPlan(paths, track, steps, report, 1.0 / slowdown)

    def _palms(self, q: np.ndarray) -> np.ndarray:
        T = np.tile(np.eye(4), (len(q), 2, 1, 1))
        for k, configuration in enumerate(q):
            pin.framesForwardKinematics(self.model, self.data, configuration)
            for i, frame in enumerate(self.palm_ids):
                T[k, i] = self.data.oMf[frame].homogeneous
        return T

    def _clamp(self, raw, steps, wanted, palms, reached, commanded, s0) -> tuple[tuple[HandPath, HandPath], np.ndarray]:
        """Move the targets that the plan does not reach to where it does; a small remainder is left to the QP."""
        offset = reached[:, :, :3, 3] - palms[:, :, :3, 3]
        distance = np.linalg.norm(offset, axis=2)
        turn = np.array(
            [[pin.log3(reached[k, i, :3, :3] @ palms[k, i, :3, :3].T) for i in (0, 1)] for k in range(len(steps))]
        )
        angle = np.linalg.norm(turn, axis=2)
        # Inside the tolerance the QP is left to close the gap; past it the target becomes the plan's own pose, whole:
        # near a straight arm, a target a few millimetres off the planned posture drives the arm far away from it.
        share = np.clip(2.0 * distance / self.config.clamp_tolerance - 1.0, 0.0, 1.0)
        turn_share = np.clip(2.0 * angle / self.config.turn_tolerance - 1.0, 0.0, 1.0)
        if not share.any() and not turn_share.any():
            return tuple(raw), np.zeros_like(distance)
        paths = []
        for i, path in enumerate(raw):
            T = wanted[:, i].copy()
            for k in range(len(steps)):
                R = pin.exp3(turn[k, i] * turn_share[k, i]) @ palms[k, i, :3, :3]
                palm = palms[k, i, :3, 3] + share[k, i] * offset[k, i]
                T[k, :3, :3], T[k, :3, 3] = R, palm - R @ self.offsets[i]
            fingers = path.sample(steps).q_finger
            bent = HandPath.from_knots(steps, T, fingers, caps=self.caps[i])
            paths.append(bent.joined(HandMotion(commanded.rows[i]), s0))
        return tuple(paths), distance * share

    def _posture_track(self, steps: np.ndarray, q: np.ndarray) -> tuple[PostureTrack, np.ndarray, np.ndarray]:
        com, angular = np.empty((len(q), 3)), np.empty((len(q), 3))
        dt = steps[1] - steps[0]
        v = np.array([pin.difference(self.model, a, b) / dt for a, b in pairwise(q)])
        v = np.vstack([v, np.zeros(self.model.nv)])
        for k in range(len(q)):
            pin.computeCentroidalMomentum(self.model, self.data, q[k], v[k])
            com[k], angular[k] = self.data.com[0], self.data.hg.angular
        com_curve = CubicSpline(steps, com, bc_type=("clamped", "clamped"))
        margin, slowdown = self._slowdown(steps, com, com_curve(steps, 2), np.gradient(angular, dt, axis=0))
        grid = np.arange(steps[0], steps[-1] + GRID, GRID)
        curve = CubicSpline(steps, q, bc_type="clamped")
        q_grid = curve(grid)
        q_grid[:, 3:7] /= np.linalg.norm(q_grid[:, 3:7], axis=1, keepdims=True)
        pelvis, torso = self._trunk(q_grid)
        track = PostureTrack(
            float(steps[0]),
            q_grid,
            curve(grid, 1)[:, 7:],
            com_curve(grid),
            com_curve(grid, 1),
            com_curve(grid, 2),
            pelvis,
            torso,
        )
        return track, margin, slowdown

    def _trunk(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        pelvis, torso = np.empty((len(q), 3, 3)), np.empty((len(q), 3, 3))
        for k, configuration in enumerate(q):
            pin.framesForwardKinematics(self.model, self.data, configuration)
            pelvis[k] = self.data.oMf[self.pelvis_id].rotation
            torso[k] = self.data.oMf[self.torso_id].rotation
        return pelvis, torso

    def _slowdown(self, steps, com, acceleration, momentum_rate) -> tuple[np.ndarray, np.ndarray]:
        """Zero-moment point of the plan, and how much slower it has to be for that to stay inside."""
        mass = pin.computeTotalMass(self.model)
        lift = GRAVITY + np.clip(acceleration[:, 2], -5.0, None)
        dynamic = -acceleration[:, :2] * com[:, 2:3] / lift[:, None]
        dynamic += np.stack([-momentum_rate[:, 1], momentum_rate[:, 0]], axis=1) / (mass * lift[:, None])
        support = self.posture.support
        room = support.offsets - self.config.zmp_margin - com[:, :2] @ support.normals.T
        push = dynamic @ support.normals.T
        margin = np.min(support.offsets - (com[:, :2] + dynamic) @ support.normals.T, axis=1)
        needed = np.sqrt(np.max(np.where(push > 0.0, push / np.maximum(room, 0.005), 0.0), axis=1))
        slowdown = np.clip(needed, 1.0, self.config.slowest)
        # Slow down before and after the step that needs it, so that the change of speed is itself gentle.
        width = max(1, round(0.15 / (steps[1] - steps[0])))
        wide = np.array([slowdown[max(0, k - width) : k + width + 1].max() for k in range(len(slowdown))])
        return margin, wide
