"""The posture plan: whole-body inverse kinematics along the hands' path, by placo's `KinematicsSolver`.

Hard: feet on the floor, centre of mass inside the shrunk support, joint limits and speeds, distance between bodies.
Soft, from strong to weak: hand positions, hand orientations, centre of mass over the middle, trunk near the nominal
stance, joints near the nominal stance. Where the hands ask for too much, the plan says what can be had instead.
"""

from __future__ import annotations

import numpy as np
import pinocchio
import placo

from models.placo_model import load_placo, put_in_stance
from models.spec import RobotSpec
from wholebody.config import PosturePlanConfig
from wholebody.support import convex_polygon


class PosturePlanner:
    """Whole-body inverse kinematics with memory: each solution starts from the one before."""

    def __init__(self, spec: RobotSpec, config: PosturePlanConfig | None = None) -> None:
        self.spec, self.config = spec, config or PosturePlanConfig()
        c = self.config
        self.robot = load_placo(spec)
        for joint in spec.joints:
            low, high = joint.position_min + c.joint_margin, joint.position_max - c.joint_margin
            if joint.name.endswith("knee_joint"):
                low = c.knee_min
            if "_hand_" not in joint.name:
                self.robot.set_joint_limits(joint.name, low, high)
            self.robot.set_velocity_limit(joint.name, c.speed_share * joint.velocity_max)
        put_in_stance(spec, self.robot)
        self.q_stance = np.array(self.robot.state.q)
        solver = self.solver = placo.KinematicsSolver(self.robot)
        for joint in spec.joints:
            if "_hand_" in joint.name:
                solver.mask_dof(joint.name)
        self._add_feet(solver)
        self.hands = []
        for tool in spec.tools:
            task = solver.add_frame_task(tool.palm_frame, self.robot.get_T_world_frame(tool.palm_frame))
            task.configure(tool.side, "soft", c.position_weight, c.orientation_weight)
            self.hands.append(task)
        self.com = solver.add_com_task(np.append(self.robot.com_world()[:2], 0.0))
        self.com.mask.set_axises("xy", "custom")
        self.com.configure("com", "soft", c.com_weight)
        for frame, weight in ((spec.torso_body, c.torso_weight), (spec.base_body, c.pelvis_weight)):
            task = solver.add_orientation_task(frame, self.robot.get_T_world_frame(frame)[:3, :3])
            task.configure(frame, "soft", weight)
        height = solver.add_position_task(spec.base_body, self.robot.get_T_world_frame(spec.base_body)[:3, 3])
        height.mask.set_axises("z", "custom")
        height.configure("height", "soft", c.height_weight)
        posture = solver.add_joints_task()
        posture.set_joints(
            {j.name: a for j, a in zip(spec.joints, spec.stance.joint_positions, strict=True) if "_hand_" not in j.name}
        )
        posture.configure("posture", "soft", c.posture_weight)
        solver.add_regularization_task(c.damping)
        # The soles stay flat, so a foot's z axis is the vertical that the trunk is bounded against.
        for frame, tilt in ((spec.base_body, c.pelvis_tilt), (spec.torso_body, c.torso_tilt)):
            solver.add_cone_constraint(spec.feet[0].frame, frame, tilt).configure(f"{frame} tilt", "hard")
        solver.enable_joint_limits(True)
        solver.enable_velocity_limits(True)
        if c.self_distance <= 0:
            return
        self._watch_pairs()
        distance = solver.add_avoid_self_collisions_constraint()
        distance.self_collisions_margin, distance.self_collisions_trigger = c.self_distance, 0.06
        distance.configure("self distance", "hard")

    def _watch_pairs(self) -> None:
        """Keep only the pairs that hand motions can bring together: all 1163 cost 14 ms a step, these 0.5 ms."""
        geometry = self.robot.collision_model
        bodies = [shape.name.rpartition("_")[0] for shape in geometry.geometryObjects]
        watched = {frozenset(pair) for pair in watched_pairs()}
        pairs = [(pair.first, pair.second) for pair in geometry.collisionPairs]
        geometry.removeAllCollisionPairs()
        for first, second in pairs:
            if frozenset((bodies[first], bodies[second])) in watched:
                geometry.addCollisionPair(pinocchio.CollisionPair(first, second))

    def _add_feet(self, solver: placo.KinematicsSolver) -> None:
        corners = []
        for foot in self.spec.feet:
            T = self.robot.get_T_world_frame(foot.frame)
            solver.add_frame_task(foot.frame, T).configure(foot.frame, "hard", 1.0, 1.0)
            corners.append(foot.points @ T[:3, :3].T + T[:3, 3])
        polygon = convex_polygon(np.vstack(corners)[:, :2])
        self.support = polygon
        # placo wants the corners clockwise
        constraint = solver.add_com_polygon_constraint(
            [v.copy() for v in polygon.vertices[::-1]], self.config.com_margin
        )
        constraint.configure("com polygon", "hard")

    def plan(self, q: np.ndarray, T_palms: np.ndarray, dt: float) -> tuple[np.ndarray, int]:
        """Configurations along the path.

        Args:
            q: Start, shape (nq,), Pinocchio convention.
            T_palms: Palm poses in world, shape (H, 2, 4, 4).
            dt: Time between them [s].

        Returns:
            Configurations (H, nq), and the number of steps at which the solver found no solution and stayed.
        """
        self.robot.state.q = q
        self.robot.update_kinematics()
        self.solver.dt = dt / self.config.iterations
        out, failed = np.empty((len(T_palms), len(q))), 0
        for k, T in enumerate(T_palms):
            for task, target in zip(self.hands, T, strict=True):
                task.T_world_frame = target
            for _ in range(self.config.iterations):
                try:
                    self.solver.solve(True)
                except RuntimeError:
                    failed += 1
                self.robot.update_kinematics()
            out[k] = self.robot.state.q
        return out, failed


ARM_BODIES = ("elbow_link", "wrist_yaw_link", "hand_palm_link", "hand_thumb_1_link")
"""Bodies of one arm that reach the trunk, the legs and the other arm first."""


def watched_pairs() -> list[tuple[str, str]]:
    """Pairs of bodies that a hand motion of a standing robot can bring together."""
    pairs = []
    for side in ("left", "right"):
        bodies = (
            "torso_link",
            "pelvis_contour_link",
            f"{side}_hip_roll_link",
            f"{side}_hip_yaw_link",
            f"{side}_knee_link",
        )
        pairs += [(f"{side}_{arm}", body) for arm in ARM_BODIES for body in bodies]
        pairs += [("torso_link", f"{side}_{leg}") for leg in ("hip_roll_link", "hip_yaw_link", "knee_link")]
        pairs += [(f"{side}_{arm}", "head_link") for arm in ("shoulder_yaw_link", *ARM_BODIES)]
        pairs += [(f"{side}_shoulder_yaw_link", "torso_link")]
        pairs += [
            (f"{side}_{arm}", f"{side}_{leg}")
            for arm in ("shoulder_yaw_link",)
            for leg in ("hip_yaw_link", "knee_link")
        ]
    hands = ("wrist_yaw_link", "hand_palm_link", "hand_thumb_1_link")
    return pairs + [(f"left_{a}", f"right_{b}") for a in hands for b in hands]
