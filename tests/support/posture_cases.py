"""Wrist poses that a standing posture inside all bounds of the planner has, by forward kinematics."""

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio
from wholebody.planning.still_postures import EXCESS_NONE
from wholebody.trajopt.layout import COM_EDGE, LOWER
from wholebody.trajopt.problem import TrajectoryProblem
from wholebody.trajopt.robot_tables import RobotTables
from wholebody.trajopt.weights import tolerances

PELVIS = np.array([[-0.08, -0.06, -0.25], [0.08, 0.06, 0.02]])
"""Least and most that the pelvis is moved from the stance [m]."""
TURN = np.array([[-0.15, -0.3, -0.3], [0.15, 0.5, 0.3]])
"""The same for its rotation vector [rad]."""
FEET = 1e-5
"""Largest error of a foot [m]."""


class PostureCases:
    """Random postures inside all bounds at rest; it does not use the solver that is tested."""

    def __init__(self, spec, config):
        self.body = RobotTables(spec, config.planner.posture, config.friction, config.force_min)
        self.problem = TrajectoryProblem(self.body, config.planner.posture, 2)
        self.model = load_pinocchio(spec)
        self.data = self.model.createData()
        self.wrists = [self.model.getFrameId(tool.wrist_frame) for tool in spec.tools]
        self.soles = [self.model.getFrameId(foot.frame) for foot in spec.feet]

    def wrist_poses(self, q):
        """Both (4, 4), of a full configuration, by Pinocchio."""
        pin.framesForwardKinematics(self.model, self.data, q)
        return [self.data.oMf[i].homogeneous.copy() for i in self.wrists]

    def foot_error(self, q):
        pin.framesForwardKinematics(self.model, self.data, q)
        feet = np.array([self.data.oMf[i].translation for i in self.soles])
        return np.abs(feet - self.body.tables.p_feet).max()

    def edges(self, q):
        """Room of the centre of mass to the innermost edges, least of all [m]."""
        t = self.body.tables
        com = pin.centerOfMass(self.model, self.data, q)[:2]
        offsets = np.minimum(np.minimum(t.com_offsets, t.zmp_offsets), t.capture_offsets)
        return float((offsets - t.normals @ com).min())

    def torque_share(self, q):
        """Largest torque of waist and arms at rest, by the share that may be used."""
        tau = pin.computeGeneralizedGravity(self.body.model, self.body.data, self.body.body_of(q))[LOWER:]
        return float((np.abs(tau) / self.body.tables.tau_max).max())

    def excess(self, q):
        """Over each bound of the configuration (n,), in its unit; the feet are put back first."""
        problem = self.problem
        problem.begin(np.tile(np.eye(4), (2, 2, 1, 1)), np.tile(q[self.body.fingers], (2, 1)), np.zeros(35))
        problem.now.q[:] = self.body.body_of(q)
        problem.evaluate_still(anew=True)
        problem.evaluate_still(anew=True)
        return problem.now.violation[1, : COM_EDGE + len(self.body.tables.normals)]

    def keeps_bounds(self, q):
        """Whether a configuration keeps every bound, up to the part of its tolerance that is promised."""
        excess = self.excess(q)
        allowed = EXCESS_NONE * tolerances(len(self.body.tables.normals))[: len(excess)] + 1e-9
        return (excess <= allowed).all() and self.edges(q) >= -allowed[-1] and self.torque_share(q) <= 1.001

    def draw(self, generator):
        """A full configuration inside all bounds."""
        t = self.body.tables
        while True:
            q = self.body.q_full.copy()
            joints = generator.uniform(t.q_min, t.q_max)
            joints[: LOWER - 6] = t.q_stance[7 : LOWER + 1]
            pelvis = t.q_stance[:3] + generator.uniform(*PELVIS)
            turn = pin.Quaternion(pin.exp3(generator.uniform(*TURN))).coeffs()
            self.body.put(q, np.concatenate([pelvis, turn, joints]))
            inside = self.excess(q).max() <= 0.0
            self.body.put(q, self.problem.now.q[1])
            balanced = self.edges(q) >= 0.0 and self.torque_share(q) <= 1.0
            if inside and balanced and self.foot_error(q) < FEET:
                return q
