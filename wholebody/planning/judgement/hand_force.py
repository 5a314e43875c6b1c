"""Forces that hands are told to push with, against what the planned robot has for them."""

from __future__ import annotations

from math import cos, inf, sin

import numpy as np

from policy.chunk import ActionChunk
from wholebody.config import ControllerConfig
from wholebody.planning.judgement.limits import Limit, Margin
from wholebody.planning.plan import ChunkPlan
from wholebody.robot.state import Robot
from wholebody.robot.touch import LEAN_MAX, TOLD_SHARE, arm_force, push_limits, stance_axes, tipping_share
from wholebody.trajopt.robot_tables import RobotTables

POSTURE_SPACING = 0.1
"""Time between the postures that are looked at [s]; chosen: forces of tasks change slower."""
FORCE_MIN = 0.5
"""Force below which nothing is told [N]; chosen: what scripts leave of one that ends."""
GRAVITY = 9.81
"""Acceleration of free fall [m/s^2]; definition."""
HANDS = ("left hand", "right hand")


class HandForce:
    """Says how much of the forces that a chunk tells a planned robot can push with.

    At each posture of the plan it is the least of: what the controller is set to and the chunk allows; what the joints
    of the arm have beside gravity; what the soles' friction holds; and a share of what tips it, leant against the force
    as far as it leans. Forces on both hands count together: two that press against each other tip nothing.

    Args:
        robot: Used while it looks. config: Of the controller.
    """

    def __init__(self, robot: Robot, config: ControllerConfig) -> None:
        self._robot, self._most, self._friction = robot, config.touch.force_max, config.friction
        arms = [robot.joint_indices(robot.arm_joints(tool.side)) for tool in robot.spec.tools]
        effort = robot.spec.effort_max[robot.motor_to_pin]
        self._arms = [(tool.palm_frame, 6 + arm, effort[arm]) for tool, arm in zip(robot.spec.tools, arms, strict=True)]

    def of(self, chunk: ActionChunk, plan: ChunkPlan, body: RobotTables, loads: tuple[float, float]) -> Margin | None:
        """Least room that a plan leaves to the forces of its chunk; None without forces.

        Args:
            chunk: Tells forces on hands.
            plan: Of it.
            body: The robot that was planned.
            loads: Masses in the left and right hand [kg].
        """
        none, worst = np.zeros((len(chunk), 3)), None
        forces = [none if f is None else f for f in (chunk.f_world_lpalm, chunk.f_world_rpalm)]
        wanted, sizes = np.stack(forces, axis=1), np.linalg.norm(forces, axis=2).T
        sizes = np.where(sizes < FORCE_MIN, 0.0, sizes)
        self._robot.loads.carry(loads)
        heading = body.footing.feet.heading
        to_axes = stance_axes(np.array([cos(heading), sin(heading)]))
        spacing = max(round(POSTURE_SPACING * chunk.fps), 1)
        steps = set(range(0, len(chunk), spacing)) | set(sizes.argmax(axis=0).tolist())
        for k in sorted(step for step in steps if sizes[step].any()):
            q = plan.trajectory.q[plan.trajectory.row(plan.start + plan.rate * (k / chunk.fps - plan.start))]
            most, axes = push_limits(self._most, *([] if chunk.force_max is None else [chunk.force_max[k]]))
            along = np.abs(wanted[k] @ to_axes) / np.maximum(sizes[k], FORCE_MIN)[:, None]
            most = np.minimum(most, (axes / np.maximum(along, 1e-9)).min(axis=1))
            bounds = self._bounds(q, wanted[k], sizes[k], body, most)
            for hand in np.flatnonzero(sizes[k]).tolist():
                value, bound = float(sizes[k, hand]), bounds[hand]
                share = (bound - value) / max(bound, 1.0)
                one = Margin(
                    code=Limit.HAND_FORCE, subject=HANDS[hand], time=k / chunk.fps, step=k, value=value, bound=bound,
                    unit="N", margin=bound - value, share=share if share >= 0.0 else min(share, -1.0),
                )  # fmt: skip
                worst = one if worst is None or one.share < worst.share else worst
        return worst

    def _bounds(
        self, q: np.ndarray, told: np.ndarray, sizes: np.ndarray, body: RobotTables, most: np.ndarray
    ) -> list[float]:
        """Largest force of each hand along what it is told, (2, 3) and its sizes (2,) [N], in a configuration (nq,)."""
        robot = self._robot
        robot.update(q, np.zeros(robot.nv))
        weight, jacobians = GRAVITY * robot.mass, [robot.jacobian(frame)[:3] for frame, _, _ in self._arms]
        palms = np.array([robot.pose(frame).translation for frame, _, _ in self._arms])
        # Leaning moves the centre of mass away from the edge; a plan that counts on the force has done a part of that.
        support = body.footing.support
        lean = np.clip(LEAN_MAX + support.normals @ (robot.com[:2] - body.tables.com_stance), 0.0, LEAN_MAX)
        tips = tipping_share(told, palms, robot.com, weight, support.normals, support.offsets + lean)
        level, lift = float(np.hypot(*told[:, :2].sum(axis=0))), float(told[:, 2].sum())
        held = self._friction * weight / max(level + self._friction * lift, 1e-9)
        found = []
        for hand, (J, (_, arm, torques)) in enumerate(zip(jacobians, self._arms, strict=True)):
            if not sizes[hand]:
                found.append(inf)
                continue
            spends = arm_force((-told[hand] / sizes[hand]) @ J[:, arm], robot.nle[arm], torques)
            found.append(float(min(most[hand], spends, sizes[hand] * min(TOLD_SHARE * tips, held))))
        return found
