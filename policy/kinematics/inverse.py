"""Joints along a path of wrist poses, for layouts and files that speak joints. The pelvis stays where it is."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.errors import ChunkError
from policy.kinematics.forward import IK_TOLERANCE, kinematics

MOTION_TOLERANCE = 1e-3
"""Largest pose error of a written motion, metres and radians in one norm: recordings are not better."""
ARMS = {"lhand": "left_arm", "rhand": "right_arm"}
"""Limb that moves each hand (`RobotSpec.limbs`)."""
_STARTS_ANYWHERE = 48
"""Local searches before a pose counts as out of reach; of 3000 poses in reach, from a far posture, two are missed."""
_SIDES = {"lhand": "left", "rhand": "right"}


def arm_joints(
    hand: str,
    T_base_hand: np.ndarray,
    q_body: np.ndarray,
    *,
    q_waist: np.ndarray | None = None,
    robot: RobotSpec | None = None,
) -> np.ndarray:
    """Joints of one arm along a path of wrist poses, each step started from the one before.

    Args:
        hand: ``lhand`` or ``rhand``.
        T_base_hand: Wrist in the pelvis, shape (H, 4, 4).
        q_body: Posture at the start, shape (m,), [rad].
        q_waist: Waist at each step if it moves, shape (H, 3) of the G1, [rad].
        robot: Whose arm; the G1's with Dex3 hands if None.

    Returns:
        Shape (H, n), n the joints of the arm, [rad].

    Raises:
        ChunkError: Naming the first step that the arm cannot reach from this pelvis and waist.
    """
    robot = robot or g1()
    arm, waist = robot.limbs[ARMS[hand]], robot.limbs["waist"]
    solved = np.empty((len(T_base_hand), len(arm)))
    q = np.array(q_body, dtype=float)
    for step, T in enumerate(T_base_hand):
        if q_waist is not None:
            q[waist] = q_waist[step]
        q, error = reach({hand: T}, arm, q, q_body, robot=robot)
        if not error <= IK_TOLERANCE:
            raise ChunkError(
                f"the {_SIDES[hand]} arm cannot reach its pose at step {step}: {error:.3g} (m and rad) remain, "
                f"{IK_TOLERANCE:g} is allowed; a joint layout has no torso to lean with, "
                "a wrist layout such as wbc32 leaves that to the controller",
                step=step,
                slot=f"{_SIDES[hand]}_arm",
            )
        solved[step] = q[arm]
    return solved


def upper_body_joints(
    T_base_lhand: np.ndarray, T_base_rhand: np.ndarray, q_body: np.ndarray, *, robot: RobotSpec | None = None
) -> np.ndarray:
    """Postures along two paths of wrist poses: by the arms alone where they can, else with the waist.

    Args:
        T_base_lhand: Left wrist in the pelvis, shape (H, 4, 4).
        T_base_rhand: Right wrist in the pelvis, shape (H, 4, 4).
        q_body: Posture at the start, shape (m,), [rad]; legs stay in it.
        robot: Whose body; the G1's with Dex3 hands if None.

    Returns:
        Shape (H, m), [rad].

    Raises:
        ChunkError: Naming the first step that waist and arms cannot reach from this pelvis.
    """
    robot = robot or g1()
    upper, waist = upper_body(robot), len(robot.limbs["waist"])
    both = upper[waist:]
    q, solved = np.array(q_body, dtype=float), np.empty((len(T_base_lhand), len(robot.body_joints)))
    for step, (T_l, T_r) in enumerate(zip(T_base_lhand, T_base_rhand, strict=True)):
        goals = {"lhand": T_l, "rhand": T_r}
        before = q
        q, error = _best(goals, both, before, [before[both]], robot)
        if not error <= IK_TOLERANCE:
            q, error = reach(goals, upper, before, q_body, robot=robot)
        if not error <= MOTION_TOLERANCE:
            raise ChunkError(
                f"waist and arms cannot reach the wrist poses at step {step}: {error:.3g} (m and rad) remain, "
                f"{MOTION_TOLERANCE:g} is allowed, with the pelvis where it is; "
                "a chunk file can say such poses, a motion cannot",
                step=step,
            )
        solved[step] = q
    return solved


def upper_body(robot: RobotSpec) -> np.ndarray:
    """Waist, left arm and right arm within the body joints."""
    return np.concatenate([robot.limbs[limb] for limb in ("waist", *ARMS.values())])


def leg_joints(
    T_base_soles: dict[str, np.ndarray], q_body: np.ndarray, *, robot: RobotSpec | None = None
) -> np.ndarray:
    """Posture whose legs put the soles where they are to be.

    Args:
        T_base_soles: Middles of the soles in the pelvis (4, 4), under the keys left and right.
        q_body: Posture to start from, shape (m,), [rad]; waist and arms stay in it.
        robot: Whose body; the G1's with Dex3 hands if None.

    Returns:
        Shape (m,), [rad].

    Raises:
        ChunkError: If the legs do not reach.
    """
    robot, q = robot or g1(), np.array(q_body, dtype=float)
    for side, T in T_base_soles.items():
        q, error = reach({side: T}, robot.limbs[f"{side}_leg"], q, q_body, robot=robot)
        if not error <= IK_TOLERANCE:
            raise ChunkError(
                f"the legs cannot hold the pelvis there: {error:.3g} (m and rad) remain, {IK_TOLERANCE:g} is allowed"
            )
    return q


def reach(
    goals: dict[str, np.ndarray],
    joints: np.ndarray,
    q: np.ndarray,
    q_first: np.ndarray,
    *,
    thorough: bool = True,
    robot: RobotSpec | None = None,
) -> tuple[np.ndarray, float]:
    """Posture nearest to some goals, from the step before, and where that fails from other starts.

    Args:
        goals: Wanted poses in the pelvis (4, 4), under the keys lhand, rhand, torso; of soles under left, right.
        joints: Which of the body joints may move.
        q: Posture at the step before, shape (m,), [rad].
        q_first: Posture at the start of the path, shape (m,), [rad].
        thorough: Search from all over the joint ranges before giving up (half a second), else from a few places.
        robot: Whose body; the G1's with Dex3 hands if None.

    Returns:
        Posture, shape (m,), [rad], and the norm of the remaining error [m and rad], at most `IK_TOLERANCE` if reached.
    """
    robot = robot or g1()
    starts = _starts(q, q_first, joints, robot)
    return _best(goals, joints, q, starts if thorough else starts[:12], robot)


def _best(
    goals: dict[str, np.ndarray], joints: np.ndarray, q: np.ndarray, starts: Sequence[np.ndarray], robot: RobotSpec
) -> tuple[np.ndarray, float]:
    """The first start that gets there, or the one that gets nearest."""
    best, least = q, np.inf
    for start in starts:
        trial = q.copy()
        trial[joints] = start
        found, error = kinematics(robot).solve(goals, joints, trial)
        if error < least:
            best, least = found, error
        if error <= IK_TOLERANCE:
            break
    return best, least


def _starts(q: np.ndarray, q_first: np.ndarray, joints: np.ndarray, robot: RobotSpec) -> list[np.ndarray]:
    """Where to start from: the step before, the first posture, the stance, straight arms, anywhere else."""
    given = [q[joints], np.asarray(q_first, dtype=float)[joints], robot.stance.joints[joints], np.zeros(len(joints))]
    return [*given, *_anywhere(robot)[:, joints]]


@lru_cache(maxsize=8)
def _anywhere(robot: RobotSpec) -> np.ndarray:
    """Postures of the body spread over the joint ranges, shape (n, m), [rad]; the same in every process."""
    n = len(robot.body_joints)
    shares = np.random.default_rng(0).uniform(0.1, 0.9, (_STARTS_ANYWHERE, n))
    return robot.position_min[:n] + shares * (robot.position_max[:n] - robot.position_min[:n])
