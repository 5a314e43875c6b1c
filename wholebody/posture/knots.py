"""What the plan's terms are at one knot: values and derivatives, from Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio, palm_frame_ids, stance_q
from models.spec import RobotSpec
from wholebody.config import PosturePlanConfig
from wholebody.posture import terms_core as core
from wholebody.posture.distances import Distances
from wholebody.reference.compiled import compiled
from wholebody.support import convex_polygon

N_BODY = 35
"""Velocities of the body without fingers."""
LEGS = slice(6, 18)
"""Velocities of the leg joints."""
N_FREE = N_BODY - 12
"""Directions in which it moves with both feet on the floor."""
FEET_TOLERANCE = 1e-6
"""To which the feet are put back [m, rad]."""
LOAD_MIN = 0.4
"""Least share of the weight that stays on the floor."""

# Rows of one knot that depend on its configuration: quadratic ones, then one-sided ones.
COM, TORSO, PELVIS, HEIGHT, JOINTS = slice(12, 14), slice(14, 17), slice(17, 20), slice(20, 21), slice(21, 50)
N_POSITION = 50
TILTS, LOWEST, JOINT_LIMITS = slice(0, 2), slice(2, 3), slice(3, 32)
N_DISTANCES = 16
"""Most pairs of bodies that count at one knot."""
DISTANCES = slice(32, 32 + N_DISTANCES)
EDGES = slice(32 + N_DISTANCES, None)
# Rows that depend on the motion: quadratic ones, then one-sided ones.
MOMENT, WAIST, SLIDE = slice(0, 2), slice(2, 5), slice(5, 9)
N_MOTION = 9
LOAD, TORQUES, ZMP_EDGES = slice(0, 1), slice(1, 18), slice(18, None)


class Knots:
    """Terms of the plan at single knots, for a robot whose feet stay where the stance has them.

    Configurations and velocities here are the body's, (36,) and (35,): the fingers are locked in the dynamics, and
    where the caller has them for the distances.

    Args:
        spec: The robot. config: Weights, limits and margins.

    Attributes:
        model: Pinocchio's model of the body.
        full: The model with fingers.
        body: Entries of the body in the full configuration. columns: The same in the full velocity.
        fingers: Entries of the fingers, hand by hand.
    """

    def __init__(self, spec: RobotSpec, config: PosturePlanConfig) -> None:
        self.spec, self.config = spec, config
        full = self.full = load_pinocchio(spec)
        self.q_full = stance_q(spec, full)
        names = list(full.names)
        locked = [i for i, name in enumerate(names) if "_hand_" in name]
        model = self.model = pin.buildReducedModel(full, locked, self.q_full)
        self.data, self._full_data = model.createData(), full.createData()
        kept = [i - 2 for i, name in enumerate(names) if i > 1 and i not in locked]
        self.body, self.columns = (np.concatenate([np.arange(n), n + np.array(kept)]) for n in (7, 6))
        self.fingers = np.array([7 + names.index(n) - 2 for tool in spec.tools for n in tool.finger_joints], int)
        self.q_stance = self.q_full[self.body].copy()
        self._set_frames()
        self._set_limits(list(model.names[2:]))
        self.mass = float(pin.computeTotalMass(full))
        self.weight = -self.mass * full.gravity.linear[2]
        self._move_to(self.q_stance)
        self._R_feet, self._p_feet = self._R[4:].copy(), self._p[4:].copy()
        self._com = pin.centerOfMass(model, self.data, self.q_stance)[:2].copy()
        corners = [
            R @ x + p for R, p, foot in zip(self._R_feet, self._p_feet, spec.feet, strict=True) for x in foot.points
        ]
        self.support = convex_polygon(np.array(corners)[:, :2])
        self._room = self.support.offsets - config.zmp_margin
        self._edges = self.support.offsets - config.com_margin
        self.n_edges = len(self._room)
        self.distances = Distances(spec, full, self.q_full, config.self_distance)

    def _set_frames(self) -> None:
        """Palms, torso, pelvis and feet: the joints that carry them and their places there."""
        spec, model = self.spec, self.model
        ids = palm_frame_ids(spec, model)
        ids = [*ids, *(model.getFrameId(name) for name in (spec.torso_body, spec.base_body))]
        ids += [model.getFrameId(foot.frame) for foot in spec.feet]
        frames = [model.frames[i] for i in ids]
        self._parents, self._soles = [frame.parentJoint for frame in frames], ids[-2:]
        self._local = (
            np.array([frame.placement.rotation for frame in frames]),
            np.array([frame.placement.translation for frame in frames]),
        )
        self._masks = np.zeros((len(ids), model.nv))
        for mask, parent in zip(self._masks, self._parents, strict=True):
            for joint in list(model.supports[parent])[1:]:
                start = model.joints[joint].idx_v
                mask[start : start + model.joints[joint].nv] = 1.0
        self._R, self._p = np.zeros((len(ids), 3, 3)), np.zeros((len(ids), 3))

    def _set_limits(self, names: list[str]) -> None:
        c, spec = self.config, self.spec
        order = np.array([spec.joint_names.index(name) for name in names])
        self._q_min, self._q_max = spec.position_min[order] + c.joint_margin, spec.position_max[order] - c.joint_margin
        self._q_min[[name.endswith("knee_joint") for name in names]] = c.knee_min
        elbows = [name.endswith("elbow_joint") for name in names]
        self._q_max[elbows] = np.minimum(self._q_max[elbows], c.elbow_max)
        self.speed_max = c.speed_share * spec.velocity_max[order]
        self.acceleration_max = np.minimum(c.acceleration, spec.acceleration_max[order])
        upper = ("waist", "shoulder", "elbow", "wrist")
        self._upper = np.array([6 + i for i, name in enumerate(names) if any(part in name for part in upper)])
        self._tau_max = c.torque_share * spec.effort_max[order[self._upper - 6]]
        self._limits = np.array([c.torso_tilt, c.pelvis_tilt, c.height_min])

    def _move_to(self, q: np.ndarray) -> None:
        self._J = pin.computeJointJacobians(self.model, self.data, q)
        placements = self.data.oMi
        T = np.array([placements[i].homogeneous for i in self._parents])
        compiled(core, "place")(T, *self._local, self._R, self._p)

    def settle(self, q: np.ndarray, N: np.ndarray) -> np.ndarray:
        """The nearest configuration with both feet in place; fills N (35, N_FREE), the directions that keep them there.

        Leaves the kinematics at that configuration.
        """
        step = np.zeros(self.model.nv)
        feet = compiled(core, "feet")
        for _ in range(6):
            self._move_to(q)
            error = feet(self._J, self._masks[4:], self._R[4:], self._p[4:], self._R_feet, self._p_feet, step, N)
            if error < FEET_TOLERANCE:
                break
            q = pin.integrate(self.model, q, step)
        return q

    def position(self, q: np.ndarray, T: np.ndarray, r: np.ndarray, J: np.ndarray) -> None:
        """Fill the quadratic rows r (N_POSITION,) and J (N_POSITION, 35); the kinematics are at ``q``.

        T (2, 4, 4) are the palm poses wanted.
        """
        J_com = pin.jacobianCenterOfMass(self.model, self.data, False)
        self._com_now = np.array(self.data.com[0][:2])
        compiled(core, "position")(
            self._J, self._masks, self._R, self._p, T, self._com_now, J_com, q, self.q_stance, self._com, r, J
        )

    def palms(self) -> tuple[np.ndarray, np.ndarray]:
        """Rotations (2, 3, 3) and positions (2, 3) of the palms where the kinematics are."""
        return self._R[:2], self._p[:2]

    def bounds(
        self, q: np.ndarray, quadratic: np.ndarray, r: np.ndarray, J: np.ndarray,
        sign: np.ndarray,
    ) -> None:  # fmt: skip
        """Fill the one-sided rows: ``sign r > 0`` is a violation. ``quadratic`` are the Jacobians of `position`."""
        compiled(core, "sided")(
            q, self._R, self._com_now, quadratic, self._limits, self._q_min, self._q_max, self.support.normals,
            self._edges, EDGES.start, r, J, sign,
        )  # fmt: skip

    def near(self, q: np.ndarray, q_fingers: np.ndarray, r: np.ndarray, J: np.ndarray) -> None:
        """Fill the rows DISTANCES of the one-sided rows r and J; further away than the trigger they are -1."""
        r[DISTANCES], J[DISTANCES] = -1.0, 0.0
        full = self.q_full
        full[self.body], full[self.fingers] = q, q_fingers
        pin.computeJointJacobians(self.full, self._full_data, full)
        near = self.distances.find(self._full_data, self.config.self_trigger, N_DISTANCES)
        if len(near):
            rates, _ = self.distances.rates(self._full_data, near)
            at = slice(DISTANCES.start, DISTANCES.start + len(near))
            r[at] = self.distances.margin[near] - self.distances.distance[near]
            J[at] = -rates[:, self.columns]

    def motion(self, q: np.ndarray, v: np.ndarray, a: np.ndarray, quadratic: tuple, sided: tuple) -> np.ndarray:
        """Fill the rows that depend on the motion.

        Args:
            q: Configuration (36,).
            v: Velocity (35,).
            a: Acceleration (35,).
            quadratic: Rows (N_MOTION,) and their derivatives by q, v and a, (3, N_MOTION, 35).
            sided: The same for the one-sided rows, and their signs.

        Returns:
            The zero-moment point (2,), [m].
        """
        by_q, by_v, by_a = pin.computeRNEADerivatives(self.model, self.data, q, v, a)
        R = pin.Quaternion(q[3:7]).toRotationMatrix()
        m = compiled(core, "motion")(
            np.ascontiguousarray(R), q[:3], self.data.tau, by_q, by_v, by_a, self._upper, self._tau_max,
            self.support.normals, self._room, LOAD_MIN, self.weight, *quadratic, *sided,
        )  # fmt: skip
        self._slide(q, v, *quadratic)
        return m[:2] / max(m[2], 0.05)

    def _slide(self, q: np.ndarray, v: np.ndarray, r: np.ndarray, D: np.ndarray) -> None:
        """Fill the row SLIDE: how each sole would accelerate over the floor if pelvis and joints kept their velocities.

        Contact models that correct velocities, MuJoCo's among them, let a sole slide with this times their time
        constant (10 ms there), always the same way: a sum of ``angular rate squared times length``.
        """
        model, data = self.model, self.data
        u, w = v[:3], v[3:6]
        kept = np.zeros(N_BODY)
        turn = pin.skew(w)
        kept[:3] = -turn @ u  # the pelvis keeps its velocity in world, not in its own axes
        pin.computeForwardKinematicsDerivatives(model, data, q, v, kept)
        for i, frame in enumerate(self._soles):
            _, by_q, by_v, by_a = pin.getFrameAccelerationDerivatives(model, data, frame, pin.LOCAL)
            rows = slice(SLIDE.start + 2 * i, SLIDE.start + 2 * i + 2)
            r[rows] = pin.getFrameAcceleration(model, data, frame, pin.LOCAL).linear[:2]
            D[0, rows], D[1, rows] = by_q[:2], by_v[:2]
            D[1, rows, :3] -= by_a[:2, :3] @ turn
            D[1, rows, 3:6] += by_a[:2, :3] @ pin.skew(u)
