r"""The posture plan: whole-body motion along the hands' path, by differential inverse kinematics with dynamics in it.

Every step solves a small program for the generalised velocity. Accelerations and the rate of the centroidal momentum
are linear in it, since the velocity before is known, so the zero-moment point, the capture point and the acceleration
limits are rows like any other, and what comes out is a motion that the robot can have: it does not jump where limits
change, and it does not ask the floor to pull.

    minimise    sum_tasks w |J v dt - step|^2 + w_a |v - v_before|^2 / dt^2
    subject to  J_feet v = 0
                joint positions (viable), speeds, accelerations
                capture point, centre of mass and zero-moment point inside the shrunk support      (slack 0)
                tilt of pelvis and torso, pelvis height                                           (slack 0)
                distances between bodies                                                           (slack 1)
                torques of the waist and the arms                                                  (slack 2)

Where the hands ask for too much, the plan says what can be had instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import daqp
import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio, palm_frame_ids, stance_q
from models.spec import RobotSpec
from wholebody.config import PosturePlanConfig
from wholebody.proximity import Proximity, watched_pairs
from wholebody.support import convex_polygon

GRAVITY = 9.81
"""[m/s^2]"""
N_SLACKS = 3
UNBOUNDED = 1e3
"""Stands for infinity on velocities [m/s, rad/s]."""
ITERATION_LIMIT = 300
"""Of daqp; past it the step brakes instead."""


@dataclass(frozen=True)
class PostureMotion:
    """What the planner says, one row a step.

    Attributes:
        q: Configurations, shape (K, nq), Pinocchio convention.
        v: Velocities from the step before to each step, shape (K, nv): halfway between them in time.
        T_palms: Palm poses that the plan has, shape (K, 2, 4, 4).
        zmp: Zero-moment point from each step to the next, shape (K, 2), [m].
        slack: Largest slack of each step, shape (K,): above 0 the plan is not what its limits say.
        failed: Number of steps without a solution, at which the plan brakes.
    """

    q: np.ndarray
    v: np.ndarray
    T_palms: np.ndarray
    zmp: np.ndarray
    slack: np.ndarray
    failed: int


class _Rows:
    """Rows that pile up, then one matrix."""

    def __init__(self) -> None:
        self.J: list[np.ndarray] = []
        self.value: list[np.ndarray] = []
        self.extra: list[np.ndarray] = []

    def add(self, J: np.ndarray, value: np.ndarray | float, extra: float) -> None:
        J = np.atleast_2d(J)
        self.J.append(J)
        self.value.append(np.broadcast_to(value, (len(J),)))
        self.extra.append(np.full(len(J), extra))

    def stacked(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return np.vstack(self.J), np.concatenate(self.value), np.concatenate(self.extra)


class PosturePlanner:
    """Plans the whole body along palm poses; fingers stay as they are.

    Args:
        spec: The robot.
        config: Weights, limits and margins.
    """

    def __init__(self, spec: RobotSpec, config: PosturePlanConfig | None = None) -> None:
        self.spec = spec
        self.config = self._config = config or PosturePlanConfig()
        model = self.model = load_pinocchio(spec)
        self.data = model.createData()
        names = list(model.names[2:])
        body = np.array([i for i, name in enumerate(names) if "_hand_" not in name])
        self._joints, self._columns = body, np.concatenate([np.arange(6), 6 + body])
        self.n = len(self._columns)
        fingers = [7 + names.index(name) for tool in spec.tools for name in tool.finger_joints]
        self._fingers = np.array(fingers, dtype=int)
        self._set_joint_limits(names)
        self._upper = np.array([6 + i for i in body if names[i].startswith("waist") or names[i] in _arm_joints(spec)])
        self._tau_max = self.config.torque_share * spec.effort_max[[spec.index(names[i - 6]) for i in self._upper]]
        self.palm_ids = palm_frame_ids(spec, model)
        self._foot_ids = [model.getFrameId(foot.frame) for foot in spec.feet]
        self._pelvis, self._torso = (model.getFrameId(name) for name in (spec.base_body, spec.torso_body))
        self.mass = float(pin.computeTotalMass(model))
        self.q_stance = stance_q(spec, model)
        self._update(self.q_stance)
        self._T_feet = [self.data.oMf[frame].copy() for frame in self._foot_ids]
        self._com_stance = self.data.com[0].copy()
        corners = [T.act(point) for T, foot in zip(self._T_feet, spec.feet, strict=True) for point in foot.points]
        self.support = convex_polygon(np.array(corners)[:, :2])
        self.proximity = Proximity(spec, model, watched_pairs(), self.q_stance, self.config.self_distance)

    def _set_joint_limits(self, names: list[str]) -> None:
        c, spec = self.config, self.spec
        order = np.array([spec.joint_names.index(names[i]) for i in self._joints])
        self._q_min, self._q_max = spec.position_min[order] + c.joint_margin, spec.position_max[order] - c.joint_margin
        self._q_min[[names[i].endswith("knee_joint") for i in self._joints]] = c.knee_min
        elbows = [names[i].endswith("elbow_joint") for i in self._joints]
        self._q_max[elbows] = np.minimum(self._q_max[elbows], c.elbow_max)
        self._v_max = c.speed_share * spec.velocity_max[order]
        self._a_cap = spec.acceleration_max[order]

    def plan(
        self,
        q: np.ndarray,
        v: np.ndarray,
        T_palms: np.ndarray,
        q_fingers: np.ndarray,
        config: PosturePlanConfig | None = None,
    ) -> PostureMotion:
        """Motion along the path, beginning with the state given.

        Args:
            q: Start, shape (nq,), Pinocchio convention.
            v: Velocity half a step before it, shape (nv,).
            T_palms: Palm poses in world, shape (K, 2, 4, 4), ``config.dt`` apart; the first one belongs to ``q``.
            q_fingers: Finger joints, left hand then right hand as `RobotSpec.tools` lists them, shape (K, n_fingers).
            config: Weights to use instead of the planner's own; the step and the joint limits stay the planner's.
        """
        self.config = config or self._config
        self._a_max = np.minimum(self.config.acceleration, self._a_cap)
        n = len(T_palms)
        qs, vs = np.empty((n, self.model.nq)), np.zeros((n, self.model.nv))
        palms, zmp, slack = np.tile(np.eye(4), (n, 2, 1, 1)), np.zeros((n, 2)), np.zeros(n)
        qs[0], vs[0] = q, v
        qs[:, self._fingers] = q_fingers
        failed = 0
        self._update(qs[0])
        velocity = v[self._columns]
        momentum = self._A_momentum @ velocity
        for k in range(n):
            for i, frame in enumerate(self.palm_ids):
                palms[k, i] = self.data.oMf[frame].homogeneous
            if k == n - 1:
                break
            program = self._program(qs[k], velocity, momentum, T_palms[k], T_palms[k + 1])
            x, _, flag, _ = daqp.solve(*program, iter_limit=ITERATION_LIMIT)
            if flag > 0 and np.isfinite(x).all():
                velocity, slack[k] = np.array(x[: self.n]), max(x[self.n :])
            else:
                velocity, slack[k], failed = 0.8 * velocity, np.inf, failed + 1
            com = self.data.com[0][:2]
            load = max(1.0 + self._lift @ velocity - self._fall, 0.1)
            zmp[k] = com + (self._zmp_drift + self._J_zmp @ velocity - com) / load
            momentum = self._A_momentum @ velocity
            vs[k + 1, self._columns] = velocity
            after = pin.integrate(self.model, qs[k], self.config.dt * vs[k + 1])
            after[self._fingers] = q_fingers[k + 1]
            qs[k + 1] = after
            self._update(qs[k + 1])
        return PostureMotion(qs, vs, palms, zmp, slack, failed)

    def _update(self, q: np.ndarray) -> None:
        model, data = self.model, self.data
        self._A_momentum = pin.ccrba(model, data, q, np.zeros(model.nv))[:, self._columns]
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)

    def _jacobian(self, frame: int) -> np.ndarray:
        return pin.getFrameJacobian(self.model, self.data, frame, pin.LOCAL_WORLD_ALIGNED)[:, self._columns]

    def _program(self, q: np.ndarray, v: np.ndarray, momentum: np.ndarray, T: np.ndarray, T_next: np.ndarray) -> tuple:
        """Arguments for daqp: variables are velocity (n,) and slacks (2,)."""
        n, J_pelvis, J_torso = self.n, self._jacobian(self._pelvis), self._jacobian(self._torso)
        H, g = np.zeros((n + N_SLACKS, n + N_SLACKS)), np.zeros(n + N_SLACKS)
        self._zmp_rows(momentum)
        self._torque_matrix(q, v)
        J, step, weight = self._tasks(q, T, T_next, J_pelvis, J_torso).stacked()
        weighted = J.T * weight
        H[:n, :n], g[:n] = weighted @ J, -weighted @ step
        smooth = self.config.smoothness / self.config.dt**2
        H[np.diag_indices(n)] += smooth + self.config.damping
        g[:n] -= smooth * v
        H[n:, n:], g[n:] = np.eye(N_SLACKS) * 1e-3, self.config.slack_price
        g[-1] = self.config.torque_slack_price

        rows = self._limits(q, momentum, J_pelvis, J_torso)
        G, bound, which = rows.stacked()
        C = np.zeros((len(G) + 12, n + N_SLACKS))
        C[: len(G), :n] = G
        C[np.arange(len(G)), n + which.astype(int)] = -1.0
        C[len(G) :, :n], feet = self._feet()
        low, high = self._velocity_bounds(q, v)
        upper = np.concatenate([high, np.full(N_SLACKS, 1e6), bound, feet])
        lower = np.concatenate([low, np.zeros(N_SLACKS), np.full(len(G), -1e30), feet])
        sense = np.zeros(len(upper), dtype=np.int32)
        sense[-12:] = 5
        return H, g, C, upper, lower, sense

    def _tasks(
        self, q: np.ndarray, T: np.ndarray, T_next: np.ndarray, J_pelvis: np.ndarray, J_torso: np.ndarray
    ) -> _Rows:
        """Steps that the hands, the trunk and the joints want to make, strong ones first."""
        c, data, dt, rows = self.config, self.data, self.config.dt, _Rows()
        for i, frame in enumerate(self.palm_ids):
            M, J = data.oMf[frame], self._jacobian(frame)
            p, R = M.translation, M.rotation
            move = _approach(T[i, :3, 3] - p, c.hand_gain, c.hand_brake, c.hand_speed, dt)
            move += T_next[i, :3, 3] - T[i, :3, 3]
            error = pin.log3(T[i, :3, :3] @ R.T)
            turn = _approach(error, c.hand_gain, c.hand_turn_brake, c.hand_turn_speed, dt)
            turn = turn + pin.log3(T_next[i, :3, :3] @ T[i, :3, :3].T)
            rows.add(J[:3] * dt, move, c.position_weight)
            # Position wins where both cannot be had: an orientation that is far off pulls less (Cauchy weight).
            share = 1.0 / (1.0 + (error @ error) / c.orientation_give**2)
            rows.add(J[3:] * dt, turn, share * c.orientation_weight)
        J_com = self._A_momentum[:2] / self.mass
        rows.add(J_com * dt, _towards(self._com_stance[:2] - data.com[0][:2], c, 0.01), c.com_weight)
        for axis, weight in enumerate(c.zmp_weight):
            rows.add(self._J_zmp[axis], data.com[0][axis] - self._zmp_drift[axis], weight)
        rows.add(self._J_tau[:3], -self._tau_drift[:3], c.waist_torque_weight)
        rows.add(J_torso[3:] * dt, _towards(pin.log3(data.oMf[self._torso].rotation.T), c, 0.05), c.torso_weight)
        rows.add(J_pelvis[3:] * dt, _towards(pin.log3(data.oMf[self._pelvis].rotation.T), c, 0.05), c.pelvis_weight)
        rows.add(J_pelvis[2] * dt, _towards(self.q_stance[2] - q[2], c, 0.02), c.height_weight)
        joints = 7 + self._joints
        rows.add(dt * np.eye(self.n)[6:], _towards(self.q_stance[joints] - q[joints], c, 0.05), c.posture_weight)
        return rows

    def _zmp_rows(self, momentum: np.ndarray) -> None:
        """Zero-moment point without vertical acceleration, ``com - (com_z / g) ddcom + (-dL_y, dL_x) / (m g)``.

        ``J v + drift``, with rates as differences; the load on the floor is ``m g (1 + lift v - fall)``.
        """
        com, J, dt = self.data.com[0], self._A_momentum, self.config.dt
        height, weight = com[2] / (GRAVITY * dt), 1.0 / (self.mass * GRAVITY * dt)
        self._J_zmp = -height * J[:2] / self.mass + weight * np.vstack([-J[4], J[3]])
        before = -height * momentum[:2] / self.mass + weight * np.array([-momentum[4], momentum[3]])
        self._zmp_drift = com[:2] - before
        self._lift, self._fall = weight * J[2], weight * momentum[2]

    def _limits(self, q: np.ndarray, momentum: np.ndarray, J_pelvis: np.ndarray, J_torso: np.ndarray) -> _Rows:
        """Rows ``J v <= bound``, each with the number of its slack."""
        c, dt, rows, com = self.config, self.config.dt, _Rows(), self.data.com[0]
        N, edge = self.support.normals, self.support.offsets - self.support.normals @ com[:2]
        J_com = self._A_momentum[:2] / self.mass
        omega = np.sqrt(GRAVITY / max(com[2], 0.3))
        rows.add(N @ J_com * (dt + 1.0 / omega), edge - c.capture_margin, 0)
        rows.add(N @ J_com, c.com_rate * (edge - c.com_margin), 0)
        # Exact with the vertical acceleration: (zmp - com) (1 + ddcom_z / g) is linear in v, and so is its bound.
        room = edge - c.zmp_margin
        bound = room * (1.0 - self._fall) - N @ (self._zmp_drift - com[:2])
        rows.add(N @ self._J_zmp - np.outer(room, self._lift), bound, 0)
        for frame, J, tilt_max in ((self._pelvis, J_pelvis, c.pelvis_tilt), (self._torso, J_torso, c.torso_tilt)):
            up = self.data.oMf[frame].rotation[:, 2]
            lean = np.hypot(up[0], up[1])
            if lean > 1e-6:
                axis = np.array([-up[1], up[0], 0.0]) / lean
                rows.add(axis @ J[3:], _stopping(tilt_max - np.arctan2(lean, up[2]), c.tilt_brake, dt), 0)
        rows.add(-J_pelvis[2], _stopping(q[2] - c.height_min, c.height_brake, dt), 0)
        room, inertia = self._tau_max, self._inertia
        rows.add(self._J_tau / inertia[:, None], (room - self._tau_drift) / inertia, 2)
        rows.add(-self._J_tau / inertia[:, None], (room + self._tau_drift) / inertia, 2)
        self.proximity.update(q, self.data)
        near = self.proximity.near(c.self_trigger)
        if len(near):
            J, _ = self.proximity.rates(self.data, near)
            room = self.proximity.distance[near] - self.proximity.margin[near]
            rows.add(-J[:, self._columns], _stopping(room, c.distance_brake, dt), 1)
        return rows

    def _torque_matrix(self, q: np.ndarray, v: np.ndarray) -> None:
        """``tau = J v + drift`` of the joints that carry no contact force, waist first: ``M dv + nle``."""
        full, dt = np.zeros(self.model.nv), self.config.dt
        full[self._columns] = v
        nle = pin.nonLinearEffects(self.model, self.data, q, full)[self._upper]
        M = pin.crba(self.model, self.data, q)
        M = (np.triu(M) + np.triu(M, 1).T)[self._upper]
        self._inertia = M[np.arange(len(M)), self._upper] / dt
        self._J_tau = M[:, self._columns] / dt
        self._tau_drift = nle - self._J_tau @ v

    def _feet(self) -> tuple[np.ndarray, np.ndarray]:
        """Both feet stay; what they drift by integration is taken back."""
        J = np.vstack([self._jacobian(frame) for frame in self._foot_ids])
        drift = []
        for T, frame in zip(self._T_feet, self._foot_ids, strict=True):
            M = self.data.oMf[frame]
            drift += [T.translation - M.translation, pin.log3(T.rotation @ M.rotation.T)]
        return J, 0.3 * np.concatenate(drift) / self.config.dt

    def _velocity_bounds(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Joint speeds from which the position limits can still be kept, within reach of the present ones."""
        c, joints = self.config, q[7 + self._joints]
        high = np.minimum(_stopping(self._q_max - joints, c.joint_brake, c.dt), self._v_max)
        low = -np.minimum(_stopping(joints - self._q_min, c.joint_brake, c.dt), self._v_max)
        # Past the reach of the accelerations the strongest braking is what is left.
        least, most = v[6:] - self._a_max * c.dt, v[6:] + self._a_max * c.dt
        high, low = np.maximum(np.minimum(high, most), least), np.minimum(np.maximum(low, least), most)
        low = np.minimum(low, high - 1e-6)
        free = np.full(6, UNBOUNDED)
        return np.concatenate([-free, low]), np.concatenate([free, high])


def _arm_joints(spec: RobotSpec) -> set[str]:
    """Joints of both arms, fingers left out."""
    return {name for name in spec.joint_names if any(part in name for part in ("shoulder", "elbow", "wrist"))}


def _approach(error: np.ndarray, gain: float, brake: float, speed: float, dt: float) -> np.ndarray:
    """Step towards a target: a share of a small error, a large one no faster than it can be braked for."""
    distance = float(np.linalg.norm(error))
    if distance < 1e-12:
        return error
    return error * min(gain, dt * min(np.sqrt(2.0 * brake * distance), speed) / distance)


def _towards(error: np.ndarray, config: PosturePlanConfig, most: float) -> np.ndarray:
    """Step of a weak task: a share of the error, limited."""
    return np.clip(config.dt / config.time_constant * error, -most, most)


def _stopping(room: np.ndarray | float, brake: float, dt: float) -> np.ndarray:
    """Largest speed towards a bound from which it can still be kept; past it, the speed back."""
    room = np.asarray(room, dtype=float)
    inside = np.minimum(np.sqrt(2.0 * brake * np.maximum(room, 0.0)), 0.5 * room / dt)
    return np.where(room > 0.0, inside, 0.2 * room / dt)
