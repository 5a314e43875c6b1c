"""A still, balanced posture of the whole body for two wrist poses: inverse kinematics inside all bounds of a plan.

It is the trajectory optimiser's problem at one configuration, without velocities: palms, bounds on configurations and
distances (`wholebody.planning.trajopt`). At rest the zero-moment point and the capture point are under the centre of
mass, so the innermost of their three edges holds. The search is local: Gauss-Newton steps on the active bounds, begun
from the stance and, where that gets stuck, from random postures whose seed is fixed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache

import numpy as np
import pinocchio as pin

from models.g1 import g1
from models.spec import RobotSpec
from policy.geometry.rotations import angle_between, nearest_rotation, rotation_residual
from wholebody.config import ControllerConfig, TrajectoryConfig
from wholebody.errors import InputError
from wholebody.planning.trajopt.layout import (  # fmt: skip
    BASE_HEIGHT,
    COM_EDGE,
    DISTANCE,
    LOWER,
    POSITION,
    STATIC,
    TILT,
    WAIST,
)
from wholebody.planning.trajopt.problem import TrajectoryProblem
from wholebody.planning.trajopt.robot_tables import RobotTables
from wholebody.planning.trajopt.weights import tolerances

POSITION_REACHED, ORIENTATION_REACHED = 1e-3, np.deg2rad(0.2)
"""Errors of a wrist up to which a target is reached [m, rad]."""
WITHIN = 0.01
"""Excess over a bound, in terms of its tolerance, that counts as none: 0.1 mm of a distance, 0.5 mrad of a joint."""
NEAR = 0.02
"""Room to a bound, in terms of its tolerance, up to which the bound is said to hold the posture back."""
PALM_SCALES = {"position": 1e-3, "position_give": 0.3, "orientation": 4e-3, "orientation_give": 0.5}
"""Scales of the palms, finer than a plan's, and the errors [m, rad] past which they pull no harder."""
GENTLE_SCALES = PALM_SCALES | {"position": 0.01, "orientation": 0.04}
"""The same where the targets are missed: the bounds are not to be bent."""
FIRM = 0.01
"""Factor on the scales of the bounds at the end, so that nothing wanted buys `WITHIN` of them."""
REACHING, RETREATING = ((1.0, 25), (FIRM, 25)), ((1.0, 40), (FIRM, 60))
"""Rounds: factor on the scales of the bounds and most steps, towards targets, and to the nearest posture if missed."""
STAGES, STAGE_STEPS = 12, 15
"""Targets between the stance and those that are missed, and most steps to each."""
STEP_MIN = 1e-6
"""Largest entry of a step that ends a round [m, rad]."""
LEVER = 0.25
"""Length at which an error of orientation counts as much as one of position [m]: a forearm."""
STARTS = 12
"""Most postures that the search begins at, the stance included."""
SPREAD = 0.5
"""Deviation of the random ones from the stance, as a share of each joint's range, for waist and arms."""
ROTATION_RESIDUAL_MAX = 1e-3
"""How far a target's matrix may be from a rotation, as `rotation_residual`; it is replaced by the nearest one."""


class Constraint(StrEnum):
    """A constraint of a still posture; the margins of a `Solution` are by these."""

    TILT = "tilt"
    PELVIS_HEIGHT = "pelvis_height"
    JOINT_POSITION = "joint_position"
    WAIST_TORQUE = "waist_torque"
    ARM_TORQUE = "arm_torque"
    DISTANCE = "distance"
    BALANCE = "balance"
    NOT_FOUND = "not_found"
    """No bound holds the posture back, yet no start led to the targets: out of reach of the arms, or missed."""


@dataclass(frozen=True)
class Solution:
    """A still posture with both feet where the stance has them.

    Attributes:
        reached: Whether both wrists are within 1 mm and 0.2 degrees of their targets and all bounds hold.
        joints: Position of each joint by name, fingers included [rad].
        q: The same with the pelvis, shape (nq,), Pinocchio convention.
        torques: At rest, of waist and arms by name [N m]. Those of the legs depend on how the feet share the load.
        margins: Least room to the bounds of each kind: [rad] of tilt and joints, [m] of pelvis height, distance
            beyond the one to keep and balance, share of the limit for torques; negative where exceeded.
        position_error, orientation_error: Of both wrists, [m] and [rad].
        reasons: What stands between the posture and the targets; empty where they are reached.
    """

    reached: bool
    joints: dict[str, float]
    q: np.ndarray
    torques: dict[str, float]
    margins: dict[Constraint, float]
    position_error: tuple[float, float]
    orientation_error: tuple[float, float]
    reasons: tuple[Constraint, ...]


class PostureSolver:
    """Postures for wrist poses.

    Args:
        spec: The robot.
        config: Bounds and margins are those of its ``planner.posture``.
    """

    def __init__(self, spec: RobotSpec, config: ControllerConfig | None = None) -> None:
        config = config or ControllerConfig()
        self.spec, posture = spec, config.planner.posture
        body = self.body = RobotTables(spec, posture, config.friction, config.force_min)
        t = body.tables
        edges = np.minimum(np.minimum(t.com_offsets, t.zmp_offsets), t.capture_offsets)
        body.tables = t._replace(com_offsets=edges)
        self._exact, self._gentle = (replace(posture, **scales) for scales in (PALM_SCALES, GENTLE_SCALES))
        self._problem = TrajectoryProblem(body, posture, 2)
        n_edges = len(edges)
        tolerance = tolerances(n_edges)
        self._tolerances = tolerance[: COM_EDGE + n_edges]
        self._arm_tolerance = tolerance[COM_EDGE + n_edges + 1 + WAIST]
        self._fingers = np.tile(body.q_full[body.fingers], (2, 1))
        self._palm_offsets = [np.array(tool.palm_offset) for tool in spec.tools]

    def solve(self, T_world_lhand: np.ndarray, T_world_rhand: np.ndarray) -> Solution:
        """The posture for two poses (4, 4) of the wrists (``*_wrist_yaw_link``) in world, fingers as in the stance.

        World: midpoint of the soles, x forward, z up [m]. If they are not reached, it is the nearest one found inside
        the bounds.

        Raises:
            InputError: If a pose is not finite or no rigid transform.
        """
        targets = np.array([_pose(T_world_lhand, "T_world_lhand"), _pose(T_world_rhand, "T_world_rhand")])
        T_palms = targets.copy()
        for T, offset in zip(T_palms, self._palm_offsets, strict=True):
            T[:3, 3] += T[:3, :3] @ offset
        generator, missed = np.random.default_rng(0), []
        for start in range(STARTS):
            self._search(T_palms, self._start(generator if start else None), self._exact, REACHING)
            found = self._solution(targets)
            if found.reached:
                return found
            missed.append((self._score(found), found.q[self.body.body]))
        return self._nearest(T_palms, targets, min(missed, key=lambda scored: scored[0])[1])

    def _nearest(self, T_palms: np.ndarray, targets: np.ndarray, start: np.ndarray) -> Solution:
        """The best of the postures inside the bounds: from a start, from the stance, and on the way from it."""
        stance, inside = self.body.tables.q_stance, []

        def search(goal: np.ndarray, begin: np.ndarray, rounds: tuple[tuple[float, int], ...]) -> None:
            self._search(goal, begin, self._gentle, rounds)
            if self._violation().max() <= WITHIN:
                found = self._solution(targets)
                inside.append((self._score(found), found))

        search(T_palms, stance, ())
        palms = self._problem.now.palms[1, :, :3, 3].copy()
        last = stance
        for share in np.linspace(1.0 / STAGES, 1.0, STAGES):
            goal = T_palms.copy()
            goal[:, :3, 3] = palms + share * (T_palms[:, :3, 3] - palms)
            search(goal, last, ((FIRM, STAGE_STEPS),))
            last = inside[-1][1].q[self.body.body] if inside else stance
        for begin in (start, stance):
            search(T_palms, begin, RETREATING)
        return min(inside, key=lambda scored: scored[0])[1] if inside else self._solution(targets)

    def _score(self, found: Solution) -> float:
        """How far a posture is from the targets [m], and much more for what exceeds the bounds."""
        excess = max(0.0, float(self._violation().max()) - WITHIN)
        return 1e3 * excess + sum(found.position_error) + LEVER * sum(found.orientation_error)

    def _start(self, generator: np.random.Generator | None) -> np.ndarray:
        t = self.body.tables
        q = t.q_stance.copy()
        if generator is not None:
            upper = slice(LOWER - 6, None)
            low, high = t.q_min[upper], t.q_max[upper]
            q[7:][upper] = np.clip(
                q[7:][upper] + SPREAD * (high - low) * generator.standard_normal(len(low)), low, high
            )
        return q

    def _search(
        self, T_palms: np.ndarray, start: np.ndarray, weights: TrajectoryConfig, rounds: tuple[tuple[float, int], ...]
    ) -> None:
        """Leave the problem at the posture that a start leads to, all of its distances measured."""
        problem = self._problem
        problem.begin(np.tile(T_palms, (2, 1, 1, 1)), self._fingers, np.zeros(len(start) - 1))
        problem.now.q[:] = start
        for softness, steps in rounds:
            problem.set_weights(weights, softness)
            for _ in range(steps):
                problem.evaluate_still()
                if self._arrived():
                    problem.evaluate_still(anew=True)
                    if self._arrived():
                        return
                before = problem.now.q[1].copy()
                problem.still_step(1)
                if np.abs(problem.now.q[1] - before).max() < STEP_MIN:
                    break
        problem.evaluate_still(anew=True)

    def _violation(self) -> np.ndarray:
        return self._problem.now.violation[1, : len(self._tolerances)] / self._tolerances

    def _arrived(self) -> bool:
        r = self._problem.now.r[1, :12].reshape(2, 2, 3)
        position, orientation = np.linalg.norm(r, axis=2).max(axis=0)
        near = position < 0.5 * POSITION_REACHED and orientation < 0.5 * ORIENTATION_REACHED
        return bool(near and self._violation().max() < WITHIN)

    def _solution(self, targets: np.ndarray) -> Solution:
        body, excess, q = self.body, self._problem.now.violation[1], self._problem.now.q[1]
        full = body.q_full.copy()
        full[body.body] = q
        torque = pin.computeGeneralizedGravity(body.model, body.data, q)[LOWER:].copy()
        arm = np.abs(torque[WAIST:]) / body.tables.tau_max[WAIST:] - 1.0
        stop = COM_EDGE + len(body.tables.normals)
        spans = {
            Constraint.TILT: (TILT, BASE_HEIGHT),
            Constraint.PELVIS_HEIGHT: (BASE_HEIGHT, POSITION),
            Constraint.JOINT_POSITION: (POSITION, STATIC),
            Constraint.WAIST_TORQUE: (STATIC, DISTANCE),
            Constraint.DISTANCE: (DISTANCE, COM_EDGE),
            Constraint.BALANCE: (COM_EDGE, stop),
        }
        margins = {name: -float(excess[a:b].max()) for name, (a, b) in spans.items()}
        margins[Constraint.ARM_TORQUE] = -float(arm.max())
        wrists = self._problem.now.palms[1].copy()
        for T, offset in zip(wrists, self._palm_offsets, strict=True):
            T[:3, 3] -= T[:3, :3] @ offset
        position = np.linalg.norm(wrists[:, :3, 3] - targets[:, :3, 3], axis=1)
        orientation = angle_between(wrists[:, :3, :3], targets[:, :3, :3])
        ratio = {name: float((excess[a:b] / self._tolerances[a:b]).max()) for name, (a, b) in spans.items()}
        ratio[Constraint.ARM_TORQUE] = float(arm.max() / self._arm_tolerance)
        on_target = position.max() <= POSITION_REACHED and orientation.max() <= ORIENTATION_REACHED
        reached = bool(on_target and max(ratio.values()) <= WITHIN)
        reasons = () if reached else tuple(name for name, share in ratio.items() if share > -NEAR)
        names = list(body.full.names)[2:]
        upper = list(body.model.names)[2 + LOWER - 6 :]
        return Solution(
            reached=reached,
            joints=dict(zip(names, full[7:].tolist(), strict=True)),
            q=full,
            torques=dict(zip(upper, torque.tolist(), strict=True)),
            margins=margins,
            position_error=tuple(position.tolist()),
            orientation_error=tuple(orientation.tolist()),
            reasons=reasons or (() if reached else (Constraint.NOT_FOUND,)),
        )


def solve(T_world_lhand: np.ndarray, T_world_rhand: np.ndarray, config: ControllerConfig | None = None) -> Solution:
    """`PostureSolver.solve` for the G1 with its hands; the solver is kept for the last settings."""
    return _solver(config or ControllerConfig()).solve(T_world_lhand, T_world_rhand)


@lru_cache(maxsize=1)
def _solver(config: ControllerConfig) -> PostureSolver:
    return PostureSolver(g1(), config)


def _pose(T: np.ndarray, name: str) -> np.ndarray:
    try:
        T = np.array(T, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} is a {type(T).__name__}, not numbers; give a pose (4, 4) of a wrist") from error
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise InputError(f"{name} has shape {T.shape} or is not finite; give a finite pose (4, 4) of a wrist in world")
    residual = float(rotation_residual(T[:3, :3]))
    if not residual <= ROTATION_RESIDUAL_MAX or not np.allclose(T[3], [0.0, 0.0, 0.0, 1.0], atol=1e-9):
        raise InputError(
            f"{name} is no rigid transform: its rotation is off by {residual:.2g}, at most {ROTATION_RESIDUAL_MAX:g}, "
            f"and its last row is {T[3].tolist()}, which has to be [0, 0, 0, 1]"
        )
    T[:3, :3] = nearest_rotation(T[:3, :3])
    return T
