"""Postures at rest with both feet in the stance: the trajectory optimiser's problem without velocities.

Palms, bounds on configurations and distances are those of a plan (`wholebody.trajopt`). At rest the
zero-moment point and the capture point are under the centre of mass, so the innermost of their three edges holds.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import pinocchio as pin

from policy.geometry.rotations import angle_between, nearest_rotation, rotation_residual
from wholebody.config import TrajectoryConfig
from wholebody.errors import InputError
from wholebody.trajopt.layout import (  # fmt: skip
    BASE_HEIGHT,
    COM_EDGE,
    DISTANCE,
    LOWER,
    POSITION,
    STATIC,
    TILT,
    WAIST,
)
from wholebody.trajopt.problem import TrajectoryProblem
from wholebody.trajopt.robot_tables import RobotTables
from wholebody.trajopt.weights import tolerances

POSITION_REACHED, ORIENTATION_REACHED = 1e-3, np.deg2rad(0.2)
"""Errors of a wrist up to which a target is reached [m, rad]; definition."""
EXCESS_NONE = 0.01
"""Excess over a bound, in terms of its tolerance, that counts as none; chosen: 0.1 mm of a distance, 0.5 mrad of a
joint."""
ROTATION_RESIDUAL_MAX = 1e-3
"""Largest `rotation_residual` of a target, whose nearest rotation counts [no unit]; chosen: above float32 rounding."""
STEP_MIN = 1e-6
"""Largest entry of a step that ends a round [m, rad]; chosen: far below `POSITION_REACHED`."""
RANDOM, SPREAD = 10_000, 0.25
"""How many random postures there are, and their deviation from the stance as a share of each joint's range, for waist
and arms; measured: of 240 pairs of palms near the border, 183 held by some search, 12 starts hold 179, and 160 if any
random postures are taken instead of the nearest."""


class PostureLimit(StrEnum):
    """A kind of bound on a still posture; margins are by these.

    Attributes:
        unit: Of its margin.
        sentence: What it says where it holds a posture back.
    """

    unit: str
    sentence: str

    def __new__(cls, code: str, unit: str, sentence: str) -> PostureLimit:
        """A member with its unit and sentence."""
        limit = str.__new__(cls, code)
        limit._value_, limit.unit, limit.sentence = code, unit, sentence
        return limit

    TILT = "tilt", "rad", "torso or pelvis are tilted as far as they may"
    PELVIS_HEIGHT = "pelvis_height", "m", "the pelvis is as low as it may be"
    JOINT_POSITION = "joint_position", "rad", "a joint is at the end of its range"
    WAIST_TORQUE = "waist_torque", "of the limit", "the waist holds as much as it may"
    ARM_TORQUE = "arm_torque", "of the limit", "an arm holds as much as it may"
    DISTANCE = "distance", "m", "two bodies, or a hand and the floor, are as close as they may be"
    BALANCE = "balance", "m", "the centre of mass is as near to the edge of the soles as it may be"
    NOT_FOUND = "not_found", "", "no bound is in the way: out of reach of the arms, or the search missed it"


@dataclass(frozen=True)
class Round:
    """One round of a search: weights, factor on the scales of the bounds, most steps, and whether palms are turned."""

    weights: TrajectoryConfig
    softness: float
    steps: int
    oriented: bool = True


class StillPostures:
    """Search for K postures at rest, on memory that is kept.

    Args:
        body: The robot, whose centre of mass keeps to the innermost edges. config: Bounds and margins.
        K: Number of postures, at least 2.

    Attributes:
        tolerance: What a plan may exceed each bound by, in the unit of its margin.
    """

    def __init__(self, body: RobotTables, config: TrajectoryConfig, K: int) -> None:
        self.body, self.K = body, K
        self._problem = TrajectoryProblem(body, config, K)
        stop = COM_EDGE + len(body.tables.normals)
        self._spans = {
            PostureLimit.TILT: slice(TILT, BASE_HEIGHT),
            PostureLimit.PELVIS_HEIGHT: slice(BASE_HEIGHT, POSITION),
            PostureLimit.JOINT_POSITION: slice(POSITION, STATIC),
            PostureLimit.WAIST_TORQUE: slice(STATIC, DISTANCE),
            PostureLimit.DISTANCE: slice(DISTANCE, COM_EDGE),
            PostureLimit.BALANCE: slice(COM_EDGE, stop),
        }
        every = tolerances(stop - COM_EDGE)
        self._tolerances = every[:stop]
        self.tolerance = {name: float(every[span.start]) for name, span in self._spans.items()}
        self.tolerance[PostureLimit.ARM_TORQUE] = float(every[stop + 1 + WAIST])

    @property
    def q(self) -> np.ndarray:
        """Configurations of the body, shape (K, 36)."""
        return self._problem.now.q

    @property
    def enforced(self) -> np.ndarray:
        """Which bounds count, 0 or 1, as in `TrajectoryProblem`; to be changed in place."""
        return self._problem.enforced

    @property
    def T_palms(self) -> np.ndarray:
        """Palm poses in world, shape (K, 2, 4, 4)."""
        return self._problem.now.palms

    def excess(self) -> np.ndarray:
        """Largest excess over a bound in terms of its tolerance, arms' torques left out, shape (K,)."""
        n = len(self._tolerances)
        shares = self._problem.now.violation[:, :n] / self._tolerances
        return np.where(self.enforced[:n] > 0.0, shares, -1.0).max(axis=1)

    def margins(self, k: int) -> dict[PostureLimit, float]:
        """Least room of a posture to the bounds of each kind, negative where exceeded."""
        excess = self._problem.now.violation[k]
        margins = {name: -float(excess[span].max()) for name, span in self._spans.items()}
        share = np.abs(self.torques(k)[WAIST:]) / self.body.tables.tau_max[WAIST:]
        return margins | {PostureLimit.ARM_TORQUE: 1.0 - float(share.max())}

    def shares(self, k: int) -> dict[PostureLimit, float]:
        """Excess over the bounds of each kind, in terms of its tolerance, negative where there is room."""
        return {name: -room / self.tolerance[name] for name, room in self.margins(k).items()}

    def torques(self, k: int) -> np.ndarray:
        """Torques of waist and arms at rest, shape (17,), [N m]."""
        return pin.computeGeneralizedGravity(self.body.model, self.body.data, self.q[k])[LOWER:].copy()

    def place(self, q: np.ndarray, q_fingers: np.ndarray) -> None:
        """Put the feet of configurations (K, 36) back where the stance has them, and measure everything."""
        self._begin(np.tile(np.eye(4), (self.K, 2, 1, 1)), q, q_fingers)
        for _ in range(2):  # each puts the feet back by a few steps of Newton's method
            self._problem.evaluate_still(anew=True)

    def search(self, T_palms: np.ndarray, start: np.ndarray, q_fingers: np.ndarray, rounds: tuple[Round, ...]) -> None:
        """Leave all postures at the one that a start leads to, everything measured.

        Args:
            T_palms: Palm poses wanted, shape (2, 4, 4).
            start: Configuration of the body, shape (36,).
            q_fingers: Finger joints, shape (n_fingers,), hand by hand.
            rounds: One after the other, until the palms are at their targets and no bound is exceeded.
        """
        problem = self._problem
        self._begin(np.tile(T_palms, (self.K, 1, 1, 1)), start, q_fingers)
        for one in rounds:
            problem.set_weights(one.weights, one.softness)
            for _ in range(one.steps):
                problem.evaluate_still()
                if self._arrived(one):
                    problem.evaluate_still(anew=True)
                    if self._arrived(one):
                        return
                before = self.q[1].copy()
                problem.still_step(1)
                if np.abs(self.q[1] - before).max() < STEP_MIN:
                    break
        problem.evaluate_still(anew=True)

    def _begin(self, T_palms: np.ndarray, q: np.ndarray, q_fingers: np.ndarray) -> None:
        fingers = np.broadcast_to(q_fingers, (self.K, len(self.body.fingers)))
        self._problem.begin(T_palms, fingers, np.zeros(self.q.shape[1] - 1))
        self.q[:] = q

    def _arrived(self, one: Round) -> bool:
        position, turn = np.linalg.norm(self._problem.now.r[1, :12].reshape(2, 2, 3), axis=2).max(axis=0)
        turned = one.oriented and not turn < 0.5 * ORIENTATION_REACHED
        near = position < 0.5 * POSITION_REACHED and not turned
        return bool(near and self.excess()[1] < EXCESS_NONE)


def scattered(body: RobotTables, q: np.ndarray, share: float, generator: np.random.Generator) -> np.ndarray:
    """A configuration of the body (36,) with waist and arms moved at random.

    Args:
        body: The robot.
        q: The configuration, shape (36,).
        share: Deviation as a share of each joint's range, which none leaves.
        generator: Of random numbers.
    """
    upper = slice(LOWER - 6, None)
    low, high = body.tables.q_min[upper], body.tables.q_max[upper]
    q, moved = q.copy(), share * (high - low) * generator.standard_normal(len(low))
    q[7:][upper] = np.where(body.real[upper], np.clip(q[7:][upper] + moved, low, high), 0.0)
    return q


class RandomPostures:
    """Random postures of a robot about the stance, their seed fixed, to begin a search at those near the targets."""

    def __init__(self, body: RobotTables) -> None:
        model, data, generator = body.model, body.data, np.random.default_rng(0)
        self._q = np.array([scattered(body, body.tables.q_stance, SPREAD, generator) for _ in range(RANDOM)])
        self._T_palms = np.empty((RANDOM, 2, 4, 4))
        for q, T in zip(self._q, self._T_palms, strict=True):
            pin.forwardKinematics(model, data, q)
            T[:] = [pin.updateFramePlacement(model, data, palm).homogeneous for palm in body.palms]

    def nearest(self, T_palms: np.ndarray, n: int, lever: float) -> np.ndarray:
        """The n postures whose worse palm is nearest to its pose, the nearest first, shape (n, 36).

        Args:
            T_palms: Poses wanted in world, shape (2, 4, 4).
            n: How many.
            lever: Length by which an error of orientation counts as one of position [m].
        """
        away = np.linalg.norm(self._T_palms[..., :3, 3] - T_palms[:, :3, 3], axis=-1)
        if lever:
            away = away + lever * angle_between(self._T_palms[..., :3, :3], T_palms[:, :3, :3])
        return self._q[np.argsort(away.max(axis=1), kind="stable")[:n]]


def wrist_target(T: np.ndarray, name: str) -> np.ndarray:
    """A pose (4, 4) that a wrist is wanted at, with its nearest rotation.

    Raises:
        InputError: If it is no rigid transform; says what of it is wrong.
    """
    try:
        T = np.array(T, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} is a {type(T).__name__}, not numbers; give a pose (4, 4) of a wrist") from error
    if T.shape != (4, 4):
        raise InputError(f"{name} has shape {T.shape}; give a pose (4, 4) of a wrist in world")
    if not np.isfinite(T).all():
        row, column = np.argwhere(~np.isfinite(T))[0].tolist()
        raise InputError(f"{name}[{row}, {column}] is {T[row, column]}; give a finite pose (4, 4) of a wrist in world")
    if not np.allclose(T[3], [0.0, 0.0, 0.0, 1.0], atol=1e-9):
        raise InputError(f"{name} is no rigid transform: its last row is {T[3].tolist()}; [0, 0, 0, 1] is expected")
    residual = float(rotation_residual(T[:3, :3]))
    if not residual <= ROTATION_RESIDUAL_MAX:
        raise InputError(
            f"{name} is no rigid transform: its rotation {name}[:3, :3] is off by {residual:.2g}, at most "
            f"{ROTATION_RESIDUAL_MAX:g} is expected; give orthonormal columns that are right-handed (determinant 1)"
        )
    T[:3, :3] = nearest_rotation(T[:3, :3])
    return T
