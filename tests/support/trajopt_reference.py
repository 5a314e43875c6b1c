"""The posture plan's terms as Pinocchio gives them: what the compiled ones are compared with."""

from itertools import pairwise

import numpy as np
import pinocchio as pin

from wholebody.collision.floor_clearance import FloorClearance
from wholebody.collision.proximity import point_rates
from wholebody.planning.trajopt.layout import FIRST, LOWER, N_BODY, UPPER, WAIST


def free_directions(m):
    """Directions that leave the feet, (K, 35, 23)."""
    N = np.zeros((len(m.q), N_BODY, m.free.shape[1] + UPPER))
    N[:, :LOWER, : m.free.shape[1]] = np.swapaxes(m.free, 1, 2)
    N[:, LOWER:, m.free.shape[1] :] = np.eye(UPPER)
    return N


class Reference:
    """Terms of a motion whose feet are in place."""

    def __init__(self, body, spec):
        self.body, self.model = body, body.model.copy()
        # The plan leaves rotors out, as Pinocchio 3.4 does in these derivatives; 3.8 counts them.
        self.model.armature[:] = 0.0
        self.data = self.model.createData()
        names = [*(tool.palm_frame for tool in spec.tools), spec.torso_body, spec.base_body]
        self.frames = [self.model.getFrameId(name) for name in names]
        self.soles = [self.model.getFrameId(foot.frame) for foot in spec.feet]

    def half_steps(self, q, v_start, dt):
        """Velocities (K + 1, 35) and their derivatives by both ends, two lists of (35, 35)."""
        half, back, forth = [v_start], [None], [None]
        for a, b in pairwise(q):
            # The curve begins at the first place with the first velocity: the control point there is not free.
            share = FIRST if len(half) == 1 else 1.0
            half.append(share * pin.difference(self.model, a, b) / dt + (1.0 - share) * v_start)
            first, second = pin.dDifference(self.model, a, b)
            back.append(-share * first / dt)
            forth.append(share * second / dt)
        return np.array([*half, np.zeros(N_BODY)]), [*back, None], [*forth, None]

    def configuration(self, q, T_palms):
        """Rows that depend on one configuration, and the Jacobian (21, 35) of those of frames and centre of mass."""
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

    def motion(self, q, v, a):
        """Rows of the motion (27,) and their derivatives by configuration, velocity and acceleration, (3, 27, 35)."""
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
        self._slide(q, v, r, D)
        return r, D

    def still(self, q):
        """Torques of waist and arms at rest."""
        return pin.computeGeneralizedGravity(self.model, self.data, q)[LOWER:].copy()

    def capture(self, q, v, m):
        """What the bounds on the capture point are exceeded by; m are the rows of the motion."""
        t = self.body.tables
        pin.centerOfMass(self.model, self.data, q, v)
        com, speed = self.data.com[0], self.data.vcom[0]
        omega = np.sqrt(9.81 / max(com[2], 0.2))
        rate = speed[:2] + omega * (com[:2] * m[2] - m[:2])
        return t.normals @ (com[:2] + speed[:2] / omega + t.capture_time * rate) - t.capture_offsets

    def floor(self, q, fingers, keep, trigger):
        """What heights over the floor are exceeded by, and their Jacobian (k, 35), of the bodies near it."""
        full, underside = self.body.full, FloorClearance(self.body.full, self.body.proximity.geometry)
        configuration, data = self.body.q_full.copy(), full.createData()
        configuration[self.body.body] = q
        configuration[self.body.fingers[self.body.finger_order]] = fingers
        pin.computeJointJacobians(full, data, configuration)
        points = underside.lowest(data)
        low = points[:, 2] - keep < trigger
        up = np.tile([0.0, 0.0, 1.0], (low.sum(), 1))
        J, _ = point_rates(data, underside.supports[low], points[low], up)
        return keep - points[low, 2], -J[:, self.body.columns]

    def _wrench(self, q, tau, parts):
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

    def _slide(self, q, v, r, D):
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

    def reduced(self, k, D, back, forth, N, dt):
        """Rows of knot k by the free directions of three knots, (27, 69)."""
        K, zero = len(N), np.zeros((N_BODY, N.shape[2]))
        before = 0.5 * D[1] - D[2] / dt
        after = 2.0 * D[2] / dt if k == 0 else 0.5 * D[1] + D[2] / dt
        h = [back[k] @ N[k - 1], forth[k] @ N[k]] if k else [zero, zero]
        n = [back[k + 1] @ N[k], forth[k + 1] @ N[k + 1]] if k + 1 < K else [zero, zero]
        return np.hstack([-before @ h[0], D[0] @ N[k] + before @ h[1] - after @ n[0], after @ n[1]])


def bounds(t, r, q, half, a, m, still, capture):
    """What the bounds of one knot are exceeded by, without distances; r are its rows, m those of its motion.

    ``still`` are the torques at rest.
    """
    tilts = np.array([np.arccos(pin.exp3(turn)[2, 2]) for turn in (r[14:17], r[17:20])]) - t.limits[:2]
    return np.concatenate([
        tilts, [t.limits[2] - q[2]], np.maximum(q[7:] - t.q_max, t.q_min - q[7:]),
        np.abs(still[:WAIST]) / t.tau_max[:WAIST] - 1.0,
        t.normals @ (r[12:14] + t.com_stance) - t.com_offsets, [t.load_min - m[2]], np.abs(m[3:20]) / t.tau_max - 1.0,
        t.normals @ m[:2] - t.zmp_offsets * m[2], capture, np.abs(a[6:]) - t.acceleration_max,
        np.abs(half[6:]) - t.speed_max, t.cone @ m[[0, 1, 2, 24, 25, 26]],
    ])  # fmt: skip
