"""The trajectory as the control loop follows it: one smooth curve through its knots, sampled on a regular grid."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin

from policy.geometry.rotations import matrix_to_quaternion, matrix_to_rotvec, quaternion_to_matrix
from wholebody.jit.entry import Entry
from wholebody.planning.kernels.along_curve import along_curve
from wholebody.reference.cubic import CubicBSpline
from wholebody.robot.state import Robot
from wholebody.trajopt.centroidal import Centroidal
from wholebody.trajopt.optimizer import KnotTrajectory

GRID = 0.002
"""Spacing of the sampled posture [s]; chosen: a control tick at 500 Hz."""
LEAN_TIME = 0.6
"""Time in which a plan comes to count on a force that it begins with [s]; chosen: a trunk takes half of it to lean."""
PUSH_MIN = 0.5
"""Force on a palm that no plan counts on [N]; chosen: what scripts leave of one that ends."""
COARSE = 5
"""Rows of that grid from one evaluation of the centre of mass, the momentum and the trunk to the next."""

_along_curve = Entry(along_curve)


@dataclass(frozen=True)
class SampledTrajectory:
    """The trajectory on a regular grid of the path parameter ``s``.

    Attributes:
        start: Parameter of the first row [s].
        q: Configurations, shape (n, nq). v: Velocities with respect to ``s``, shape (n, nv).
        ddq: Second derivatives of the joints, shape (n, n_joints).
        com: Centre of mass, first and second derivative, shape (3, n, 3).
        momentum: Angular momentum about it and its first derivative, shape (2, n, 3), for ds/dt = 1.
        height: Pelvis height, first and second derivative, shape (3, n).
        pelvis, torso: Orientations (n, 3, 3), angular rates (n, 3) and accelerations (n, 3), world axes.
    """

    start: float
    q: np.ndarray
    v: np.ndarray
    ddq: np.ndarray
    com: np.ndarray
    momentum: np.ndarray
    height: np.ndarray
    pelvis: tuple[np.ndarray, np.ndarray, np.ndarray]
    torso: tuple[np.ndarray, np.ndarray, np.ndarray]

    @classmethod
    def still(cls, robot: Robot, q: np.ndarray) -> SampledTrajectory:
        """One row: stay at ``q``, the robot's present configuration."""
        one, turn = np.zeros((1, 3)), robot.pose
        pelvis, torso = (turn(frame).rotation[None].copy() for frame in (robot.spec.base_body, robot.spec.torso_body))
        return cls(
            start=0.0,
            q=q[None].copy(),
            v=np.zeros((1, robot.nv)),
            ddq=np.zeros((1, robot.n_joints)),
            com=np.stack([robot.com[None], one, one]),
            momentum=np.stack([one, one]),
            height=np.array([[q[2]], [0.0], [0.0]]),
            pelvis=(pelvis, one, one),
            torso=(torso, one, one),
        )

    def row(self, s: float) -> int:
        """Nearest row; the ends are held."""
        return int(min(max(round((s - self.start) / GRID), 0), len(self.q) - 1))


@dataclass(frozen=True)
class CentroidalTrack:
    """Where the mass of a trajectory goes, on the grid of `SampledTrajectory`.

    Attributes:
        start, end: Of the path parameter [s]; the last row is the first one at or after the end.
        com, momentum: As in `SampledTrajectory`.
        turns: Orientations of pelvis and torso at every `COARSE`-th row, shape (2, m, 3, 3).
        q: Configurations there, shape (m, nq). v: Velocities there, shape (m, nv).
        palms, pushes: Both palms [m] and the forces on them that are counted on [N], shape (n, 2, 3); None without any.
    """

    start: float
    end: float
    com: np.ndarray
    momentum: np.ndarray
    turns: np.ndarray
    q: np.ndarray
    v: np.ndarray
    palms: np.ndarray | None = None
    pushes: np.ndarray | None = None

    def pushed(self, steps: np.ndarray, knots: KnotTrajectory) -> CentroidalTrack:
        """Track with the forces on the palms that its knots, at K parameters [s], count on."""
        if knots.pushes is None:
            return self
        s, K = np.minimum(self.start + GRID * np.arange(self.com.shape[1]), steps[-1]), len(steps)
        values = np.hstack([knots.T_palms[:, :, :3, 3].reshape(K, 6), knots.pushes])
        palms, pushes = np.split(np.stack([np.interp(s, steps, x) for x in values.T], axis=1), 2, axis=1)
        return replace(self, palms=palms.reshape(-1, 2, 3), pushes=pushes.reshape(-1, 2, 3))


@dataclass(frozen=True)
class BodyState:
    """Where a trajectory is, for the next one to continue.

    Attributes:
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        pushes: Forces on the left and the right palm that it counts on, world axes, shape (6,), [N].
    """

    q: np.ndarray
    v: np.ndarray
    pushes: np.ndarray = field(default_factory=lambda: np.zeros(6))

    @classmethod
    def still(cls, q: np.ndarray, nv: int) -> BodyState:
        """Trajectory at rest at ``q``."""
        return cls(q.copy(), np.zeros(nv))

    def counted(self, told: np.ndarray, dt: float) -> np.ndarray | None:
        """Forces told at K knots, (K, 6) [N], ``dt`` [s] apart, as a plan from here counts on them; None if on none.

        It begins with what is counted on here: nobody leans at once.
        """
        left = np.maximum(1.0 - dt * np.arange(len(told)) / LEAN_TIME, 0.0)
        pushes = told + left[:, None] * (self.pushes - told[0])
        return pushes if np.abs(pushes).max() > PUSH_MIN else None


def curve_through(steps: np.ndarray, q: np.ndarray, v_start: np.ndarray) -> CubicBSpline:
    """The cubic B-spline that begins at ``q[0]`` with velocity ``v_start`` and has q[1:] as control points.

    Its acceleration changes linearly between the knots, where it is exactly the one that the optimiser judges: a
    curve through the points would swing up to three times as much. It rests one step after the last knot.
    """
    dt, q = steps[1] - steps[0], _one_sided(q)
    rate = dt * _configuration_rate(q[0], v_start)
    before, first = q[1] - 2.0 * rate, 1.5 * q[0] - 0.5 * q[1] + 0.5 * rate
    points = np.vstack([before, first, q[1:], q[-1], q[-1]])
    return CubicBSpline(steps[0], dt, points)


def centroidal_along(curve: CubicBSpline, start: float, end: float, momenta: Centroidal) -> CentroidalTrack:
    """Where the mass and the trunk go along a curve from ``start`` to ``end``: all that the floor's part depends on."""
    grid = np.arange(start, end + GRID, GRID)
    n = -(-(len(grid) - 1) // COARSE) + 1
    q, v, _, _ = _states(curve, np.minimum(grid[np.minimum(COARSE * np.arange(n), len(grid) - 1)], end))
    com, com_velocity, momentum, turns = momenta(q, v)
    com_acceleration, momentum_rate = (np.gradient(x, COARSE * GRID, axis=0) for x in (com_velocity, momentum))
    values = np.hstack([com, com_velocity, com_acceleration, momentum, momentum_rate])
    parts = _between(values, len(grid)).reshape(len(grid), 5, 3).swapaxes(0, 1).copy()
    # The last row is held for as long as nothing new comes: at rest, whatever the plan did last.
    parts[1:, -1] = 0.0
    return CentroidalTrack(float(start), float(end), parts[:3], parts[3:], turns, q, v)


def track_along(curve: CubicBSpline, centroidal: CentroidalTrack) -> SampledTrajectory:
    """The posture on the grid of where the mass goes: everything from one smooth curve.

    Positions, velocities and accelerations that did not belong together would lead the robot off the plan.
    """
    start, n = centroidal.start, centroidal.com.shape[1]
    q, v, dq, ddq = _states(curve, np.minimum(start + GRID * np.arange(n), centroidal.end))
    spin, change = _angular_rates(centroidal.turns, COARSE * GRID)
    # Neighbours are close, so normalised quaternions will do between rotations.
    quat = [_same_side(x) for x in matrix_to_quaternion(centroidal.turns, "xyzw")]
    parts = np.split(_between(np.hstack([*spin, *change, *quat]), n), np.cumsum([3] * 4 + [4]), axis=1)
    quat = np.stack(parts[4:])
    R = quaternion_to_matrix(quat / np.linalg.norm(quat, axis=2, keepdims=True), "xyzw")
    bodies = list(zip(R, parts[:2], parts[2:4], strict=True))
    track = SampledTrajectory(
        start=start,
        q=q,
        v=v,
        ddq=ddq[:, 7:].copy(),
        com=centroidal.com,
        momentum=centroidal.momentum,
        height=np.stack([q[:, 2], dq[:, 2], ddq[:, 2]]),
        pelvis=bodies[0],
        torso=bodies[1],
    )
    for rates in (track.v, track.ddq, *track.pelvis[1:], *track.torso[1:]):
        rates[-1] = 0.0
    track.height[1:, -1] = 0.0
    return track


def _states(curve: CubicBSpline, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Configurations (n, nq) with unit quaternions, velocities (n, nv), and the curve's own derivatives, at ``s``."""
    n, nq = len(s), curve.coefficients.shape[2]
    states = np.empty((n, nq)), np.empty((n, nq - 1)), np.empty((n, nq)), np.empty((n, nq))
    _along_curve(float(curve.start), float(curve.step), curve.coefficients, s, *states, np.empty((3, 3)))
    return states


def _between(values: np.ndarray, n: int) -> np.ndarray:
    """Values (m, C) at every `COARSE`-th row of the grid, linear in between: at the first ``n`` rows of it."""
    share = np.linspace(0.0, 1.0, COARSE, endpoint=False)[:, None]
    between = values[:-1, None] + share * np.diff(values, axis=0)[:, None]
    return np.vstack([between.reshape(-1, values.shape[1]), values[-1]])[:n]


def _angular_rates(R: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Angular rates and accelerations, (n, K, 3) each, world axes, of rotations (n, K, 3, 3) ``dt`` apart."""
    turn = matrix_to_rotvec(R[:, 1:] @ np.swapaxes(R[:, :-1], 2, 3)) / dt
    spin = np.concatenate([turn[:, :1], 0.5 * (turn[:, 1:] + turn[:, :-1]), turn[:, -1:]], axis=1)
    return spin, np.gradient(spin, dt, axis=1)


def _configuration_rate(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Derivative of the configuration (nq,) for a velocity (nv,), Pinocchio convention."""
    x, y, z, w = q[3:7]
    R = pin.Quaternion(q[3:7]).toRotationMatrix()
    turn = 0.5 * np.array([[w, -z, y], [z, w, -x], [-y, x, w], [-x, -y, -z]]) @ v[3:6]
    return np.concatenate([R @ v[:3], turn, v[6:]])


def _one_sided(q: np.ndarray) -> np.ndarray:
    """Configurations (K, nq) with neighbouring quaternions on the same side."""
    q = q.copy()
    q[:, 3:7] = _same_side(q[:, 3:7])
    return q


def _same_side(quat: np.ndarray) -> np.ndarray:
    """Quaternions (K, 4) with signs that make neighbours close."""
    flips = np.cumprod(np.where(np.sum(quat[1:] * quat[:-1], axis=1) < 0.0, -1.0, 1.0))
    return quat * np.concatenate([[1.0], flips])[:, None]
