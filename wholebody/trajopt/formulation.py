r"""The trajectory optimisation problem, term by term with Pinocchio: the specification of the compiled kernels.

Variables are the configurations ``q_1 .. q_{K-1}`` of K knots; ``q_0`` and ``v_0`` are given. The knots after the first
are control points of a cubic B-spline, so that with the time ``dt`` between them

    v_{k-1/2} = difference(q_{k-1}, q_k) / dt        between knots (`mid_velocities`)
    v_k = (v_{k-1/2} + v_{k+1/2}) / 2                at a knot
    a_k = (v_{k+1/2} - v_{k-1/2}) / dt

Both feet stay where `TrajectoryOptimizer.stand_on` says, which leaves 23 of 35 directions at each knot
(`free_directions`). The cost is

    sum_k  rho(palms) + |r_k / scale|^2 + sum_i max(0, c_ki / scale_i)^2

with residuals r (`configuration`, `dynamics`), bounds ``c <= 0`` (`bounds`, `floor`, and distances between bodies) and
losses rho of the palms that grow slower than squares far from the target (`configuration_cost`). Nothing else is a
constraint: there is always a solution, and `wholebody.trajopt.weights` says by how much one that is used may
exceed a bound. Where torques between knots count, each knot has two more (`wholebody.trajopt.kernels.between`).

Tests hold every value and derivative of the kernels equal to those here. Rotors are left out of the dynamics.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from wholebody.collision.floor_clearance import FloorClearance
from wholebody.collision.proximity import point_rates
from wholebody.robot.kernels.pendulum import natural_frequency
from wholebody.trajopt.arrays import Tables, TrajectoryWeights
from wholebody.trajopt.layout import FIRST_RATE, FREE_LOWER, LOWER, N_BODY, UPPER, WAIST
from wholebody.trajopt.robot_tables import RobotTables

Arrays = tuple[np.ndarray, np.ndarray]


class Formulation:
    """Terms of a motion whose feet are in place, and their derivatives with respect to velocities (35,) of the body.

    Args:
        body: The robot and its limits. spec: The robot.
    """

    def __init__(self, body: RobotTables, spec: RobotSpec) -> None:
        self.body, self.model = body, body.model.copy()
        # Pinocchio 3.4 leaves rotors out of these derivatives, 3.8 counts them.
        self.model.armature[:] = 0.0
        self.data = self.model.createData()
        names = [*(tool.palm_frame for tool in spec.tools), spec.torso_body, spec.base_body]
        self.frames = [self.model.getFrameId(name) for name in names]
        self.soles = [self.model.getFrameId(foot.frame) for foot in spec.feet]

    def free_directions(self, q: np.ndarray) -> np.ndarray:
        """Projector (35, 35) onto the velocities at ``q`` (36,) that leave both feet in place."""
        pin.computeJointJacobians(self.model, self.data, q)
        pin.updateFramePlacements(self.model, self.data)
        feet = [pin.getFrameJacobian(self.model, self.data, sole, pin.LOCAL) for sole in self.soles]
        J = np.vstack(feet)
        return np.eye(N_BODY) - np.linalg.pinv(J) @ J

    def mid_velocities(self, q: np.ndarray, v_start: np.ndarray, dt: float) -> tuple[np.ndarray, list, list]:
        """Velocities (K + 1, 35) between the knots (K, 36), and their derivatives (35, 35) by the knots at both ends.

        The first is that at the first knot, the last is zero: the plan ends at rest.
        """
        v_mid, by_prev, by_next = [v_start], [None], [None]
        for a, b in pairwise(q):
            share = FIRST_RATE if len(v_mid) == 1 else 1.0
            v_mid.append(share * pin.difference(self.model, a, b) / dt + (1.0 - share) * v_start)
            first, second = pin.dDifference(self.model, a, b)
            by_prev.append(-share * first / dt)
            by_next.append(share * second / dt)
        return np.array([*v_mid, np.zeros(N_BODY)]), [*by_prev, None], [*by_next, None]

    def configuration(self, q: np.ndarray, T_palms: np.ndarray) -> Arrays:
        """Residuals (50,) of a configuration, and the Jacobian (21, 35) of those that are not joints.

        They are position [m] and orientation [rad] of both palms off ``T_palms`` (2, 4, 4), the centre of mass off the
        stance's [m], the rotation vectors of torso and pelvis [rad], and pelvis height [m] and joints [rad] off the
        stance.
        """
        model, data, t = self.model, self.data, self.body.tables
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        J_com = pin.jacobianCenterOfMass(model, data, q)
        r, J = np.zeros(50), np.zeros((21, N_BODY))
        for i, frame in enumerate(self.frames):
            M = data.oMf[frame]
            F = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            if i < 2:
                r[6 * i : 6 * i + 3] = M.translation - T_palms[i, :3, 3]
                r[6 * i + 3 : 6 * i + 6] = pin.log3(M.rotation @ T_palms[i, :3, :3].T)
                J[6 * i : 6 * i + 6] = F
            else:
                r[8 + 3 * i : 11 + 3 * i], J[8 + 3 * i : 11 + 3 * i] = pin.log3(M.rotation), F[3:]
        r[12:14], J[12:14] = data.com[0][:2] - t.com_stance, J_com[:2]
        r[20], J[20] = q[2] - t.q_stance[2], F[2]
        r[21:] = q[7:] - t.q_stance[7:]
        return r, J

    def dynamics(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> Arrays:
        """Rows of the dynamics (27,) and their derivatives by configuration, velocity and acceleration, (3, 27, 35).

        They are the zero-moment point [m] times the vertical force, and that force, per weight; torques of waist and
        arms [N m]; accelerations of both soles in their planes [m/s^2]; horizontal force and moment about the vertical
        [m] through the origin of the world, per weight.
        """
        model, data, t = self.model, self.data, self.body.tables
        by = pin.computeRNEADerivatives(model, data, q, v, a)
        by_a = np.triu(by[2]) + np.triu(by[2], 1).T
        parts, tau = (by[0].copy(), by[1].copy(), by_a), data.tau.copy()
        wrench, D_wrench = self._wrench(q, tau, parts)
        weight = -t.mass * t.gravity[2]
        r, D = np.zeros(27), np.zeros((3, 27, N_BODY))
        r[:3], r[24:] = [-wrench[4], wrench[3], wrench[2]], wrench[[0, 1, 5]]
        for part in range(3):
            W = D_wrench[part]
            D[part, :3] = np.array([-W[4], W[3], W[2]]) / weight
            D[part, 3:20], D[part, 24:] = parts[part][LOWER:], W[[0, 1, 5]] / weight
        r[:3] /= weight
        r[24:] /= weight
        r[3:20] = tau[LOWER:]
        self._soles(q, v, r, D)
        return r, D

    def static_torque(self, q: np.ndarray) -> np.ndarray:
        """Torques (17,) of waist and arms at rest [N m]."""
        return pin.computeGeneralizedGravity(self.model, self.data, q)[LOWER:].copy()

    def capture_point(self, q: np.ndarray, v: np.ndarray, m: np.ndarray) -> np.ndarray:
        """Excess (E,) of the capture point over the edges of the support, `capture_time` ahead [m]; m: the dynamics."""
        t = self.body.tables
        pin.centerOfMass(self.model, self.data, q, v)
        com, speed = self.data.com[0], self.data.vcom[0]
        omega = natural_frequency(com[2])
        rate = speed[:2] + omega * (com[:2] * m[2] - m[:2])
        return t.normals @ (com[:2] + speed[:2] / omega + t.capture_time * rate) - t.capture_offsets

    def floor(self, q: np.ndarray, fingers: np.ndarray, keep: float, trigger: float) -> Arrays:
        """Excess (k,) [m] of the k bodies near the floor over the height to keep, and its Jacobian (k, 35)."""
        full, clearance = self.body.full, FloorClearance(self.body.spec, self.body.full, self.body.proximity.geometry)
        configuration, data = self.body.q_full.copy(), full.createData()
        self.body.put(configuration, q)
        configuration[self.body.fingers[self.body.finger_order]] = fingers
        pin.computeJointJacobians(full, data, configuration)
        points = clearance.lowest(data)
        low = points[:, 2] - keep < trigger
        up = np.tile([0.0, 0.0, 1.0], (low.sum(), 1))
        J, _ = point_rates(data, clearance.supports[low], points[low], up)
        return keep - points[low, 2], -self.body.rates_of(J)

    def _wrench(self, q: np.ndarray, tau: np.ndarray, parts: tuple[np.ndarray, ...]) -> tuple[np.ndarray, list]:
        """Wrench about the origin of the world, and its derivatives."""
        M = pin.XYZQUATToSE3(q[:7])
        X = M.toDualActionMatrix()
        wrench = X @ tau[:6]
        D = [X @ part[:6] for part in parts]
        # The base moves by a twist in its own axes, and takes the wrench along.
        for j in range(6):
            twist = M.act(pin.Motion(np.eye(6)[j]))
            D[0][:, j] += twist.cross(pin.Force(wrench)).vector
        return wrench, D

    def _soles(self, q: np.ndarray, v: np.ndarray, r: np.ndarray, D: np.ndarray) -> None:
        """Accelerations of the soles if pelvis and joints kept their velocities, into rows 20 to 23."""
        model, data = self.model, self.data
        u, w = v[:3], v[3:6]
        kept, turn = np.zeros(N_BODY), pin.skew(w)
        kept[:3] = -turn @ u
        pin.computeForwardKinematicsDerivatives(model, data, q, v, kept)
        for i, frame in enumerate(self.soles):
            _, by_q, by_v, by_a = pin.getFrameAccelerationDerivatives(model, data, frame, pin.LOCAL)
            rows = slice(20 + 2 * i, 22 + 2 * i)
            r[rows] = pin.getFrameAcceleration(model, data, frame, pin.LOCAL).linear[:2]
            D[0, rows], D[1, rows] = by_q[:2], by_v[:2]
            D[1, rows, :3] -= by_a[:2, :3] @ turn
            D[1, rows, 3:6] += by_a[:2, :3] @ pin.skew(u)


def bounds(
    t: Tables,
    r: np.ndarray,
    q: np.ndarray,
    v_mid: np.ndarray,
    a: np.ndarray,
    m: np.ndarray,
    static: np.ndarray,
    capture: np.ndarray,
) -> np.ndarray:
    """Excess over all bounds of one knot but those on distances, in the order of `weights.BOUNDS`.

    Args:
        t: Limits.
        r: Residuals of its configuration (50,).
        q: Configuration (36,).
        v_mid: Velocity before it (35,).
        a: Acceleration (35,).
        m: Rows of the dynamics (27,).
        static: Torques at rest (17,).
        capture: From `Formulation.capture_point`.
    """
    tilts = np.array([np.arccos(pin.exp3(turn)[2, 2]) for turn in (r[14:17], r[17:20])]) - t.limits[:2]
    return np.concatenate([
        tilts, [t.limits[2] - q[2]], np.maximum(q[7:] - t.q_max, t.q_min - q[7:]),
        np.abs(static[:WAIST]) / t.tau_max[:WAIST] - 1.0,
        t.normals @ (r[12:14] + t.com_stance) - t.com_offsets, [t.load_min - m[2]], np.abs(m[3:20]) / t.tau_max - 1.0,
        t.normals @ m[:2] - t.zmp_offsets * m[2], capture, np.abs(a[6:]) - t.acceleration_max,
        np.abs(v_mid[6:]) - t.speed_max, t.cone @ m[[0, 1, 2, 24, 25, 26]],
    ])  # fmt: skip


def configuration_cost(w: TrajectoryWeights, r: np.ndarray) -> float:
    """Cost of the residuals (50,) of one configuration.

    With e the error of a palm over ``give``, its position costs ``(give / scale)^2 log(1 + e^2)``, whose gradient is
    greatest at e = 1, and its orientation ``(give / scale)^2 2 (e - log(1 + e))``, whose gradient is bounded; both are
    squares near 0.
    """
    total = 0.0
    for palm in r[:12].reshape(2, 6):
        e = np.linalg.norm(palm[:3]) / w.position_give
        total += (w.position_give / w.position) ** 2 * np.log1p(e**2)
        e = np.linalg.norm(palm[3:]) / w.orientation_give
        total += (w.orientation_give / w.orientation) ** 2 * 2.0 * (e - np.log1p(e))
    squares = ((w.com, 12, 14), (w.torso, 14, 17), (w.pelvis, 17, 20), (w.height, 20, 21), (w.posture, 21, 50))
    return total + sum(weight * float(r[first:last] @ r[first:last]) for weight, first, last in squares)


def motion_cost(w: TrajectoryWeights, v_mid: np.ndarray, a: np.ndarray, m: np.ndarray) -> float:
    """Cost of velocity, acceleration and dynamics of one knot, without bounds."""
    legs, others = v_mid[6:LOWER], np.r_[v_mid[:6], v_mid[LOWER:]]
    squares = (
        (w.zmp, m[:2]), (w.waist, m[3 : 3 + WAIST]), (w.slide, m[20:24]), (w.smooth, a), (w.legs, legs),
        (w.speed, others),
    )  # fmt: skip
    return sum(weight * float(x @ x) for weight, x in squares)


def dense(free: np.ndarray) -> np.ndarray:
    """The free directions at K knots as columns (K, 35, 23); ``free`` (K, 6, 18) are those of base and legs."""
    N = np.zeros((len(free), N_BODY, FREE_LOWER + UPPER))
    N[:, :LOWER, :FREE_LOWER] = np.swapaxes(free, 1, 2)
    N[:, LOWER:, FREE_LOWER:] = np.eye(UPPER)
    return N


def reduced(k: int, D: np.ndarray, by_prev: list, by_next: list, N: np.ndarray, dt: float) -> np.ndarray:
    """Derivatives (27, 69) of the dynamics of knot k by the free directions ``N`` (K, 35, 23) of three knots.

    ``D`` (3, 27, 35) are those by configuration, velocity and acceleration.
    """
    K, zero = len(N), np.zeros((N_BODY, N.shape[2]))
    before = 0.5 * D[1] - D[2] / dt
    after = 2.0 * D[2] / dt if k == 0 else 0.5 * D[1] + D[2] / dt
    h = [by_prev[k] @ N[k - 1], by_next[k] @ N[k]] if k else [zero, zero]
    n = [by_prev[k + 1] @ N[k], by_next[k + 1] @ N[k + 1]] if k + 1 < K else [zero, zero]
    return np.hstack([-before @ h[0], D[0] @ N[k] + before @ h[1] - after @ n[0], after @ n[1]])
