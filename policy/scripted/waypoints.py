"""Hand motions through poses at times, at rest at each, with minimum-jerk blends between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.hands import Side, grasp_posture
from policy.errors import PolicyError
from policy.geometry.rotations import matrix_to_rotvec, rotvec_to_matrix
from policy.geometry.se3 import bracket
from policy.scripted.policy import ScriptedMotion, ScriptedPolicy, minimum_jerk, stance_pose


@dataclass(frozen=True)
class Waypoint:
    """A pose of both hands at a time; what is None stays as at the waypoint before, at first as in the stance.

    Attributes:
        time: When to be there, at rest [s].
        lpalm, rpalm: Palm points in world, shape (3,), [m].
        turn_lhand, turn_rhand: Rotation from the stance in world axes, as a rotation vector (3,), [rad].
        lgrasp, rgrasp: Closing of the fingers, 0 open to 1 closed.
        lforce, rforce: Force that the world is expected to put on the palm, shape (3,), world axes, [N].
    """

    time: float
    lpalm: np.ndarray | None = None
    rpalm: np.ndarray | None = None
    turn_lhand: np.ndarray | None = None
    turn_rhand: np.ndarray | None = None
    lgrasp: float | None = None
    rgrasp: float | None = None
    lforce: np.ndarray | None = None
    rforce: np.ndarray | None = None


def one_hand(
    side: Side,
    time: float,
    palm: np.ndarray | None = None,
    closing: float | None = None,
    *,
    turn: np.ndarray | None = None,
    force: np.ndarray | None = None,
) -> Waypoint:
    """A waypoint of one hand; the other stays.

    Raises:
        PolicyError: If there is no such hand.
    """
    if side == "left":
        return Waypoint(time, lpalm=palm, turn_lhand=turn, lgrasp=closing, lforce=force)
    if side == "right":
        return Waypoint(time, rpalm=palm, turn_rhand=turn, rgrasp=closing, rforce=force)
    raise PolicyError(f"side {side!r} is unknown; it is 'left' or 'right'")


def waypoint_policy(
    name: str, waypoints: Sequence[Waypoint], *, orientation_free: bool = False, robot: RobotSpec | None = None
) -> ScriptedPolicy:
    """A scripted policy from the stance through waypoints; it stays at the last one.

    Args:
        name: What it is called.
        waypoints: In order.
        orientation_free: Whether the task does not depend on how the hands are turned.
        robot: Whose hands; the G1's with Dex3 hands if None.

    Raises:
        PolicyError: If the times do not increase from above 0.
    """
    times = np.array([0.0, *(waypoint.time for waypoint in waypoints)])
    if not (np.diff(times) > 0.0).all():
        raise PolicyError(f"{name}: waypoint times {times[1:].tolist()} s must increase from above 0")
    knots = _knots(waypoints, robot)

    def script(t: np.ndarray) -> ScriptedMotion:
        low, share = bracket(times, t)
        blend = minimum_jerk(share)[:, None]
        straight = {
            field: knots[field][low] + blend * (knots[field][low + 1] - knots[field][low])
            for field in ("p_world_lpalm", "p_world_rpalm", "q_lhand", "q_rhand", "f_world_lpalm", "f_world_rpalm")
        }
        turned = {}
        for field in ("R_world_lhand", "R_world_rhand"):
            R = knots[field]
            turns = matrix_to_rotvec(np.swapaxes(R[:-1], -1, -2) @ R[1:])
            turned[field] = R[low] @ rotvec_to_matrix(blend * turns[low])
        return ScriptedMotion(**straight, **turned)

    return ScriptedPolicy(name, script, float(times[-1]), orientation_free=orientation_free, robot=robot)


def _knots(waypoints: Sequence[Waypoint], robot: RobotSpec | None) -> dict[str, np.ndarray]:
    """Every field of `ScriptedMotion` at the stance and at each waypoint."""
    stance = stance_pose(robot)
    rows = [vars(stance)]
    for waypoint in waypoints:
        row = dict(rows[-1])
        for hand, side in (("l", "left"), ("r", "right")):
            names = f"{hand}palm", f"turn_{hand}hand", f"{hand}grasp", f"{hand}force"
            palm, turn, closing, force = (getattr(waypoint, name) for name in names)
            if palm is not None:
                row[f"p_world_{hand}palm"] = np.asarray(palm, dtype=float)
            if turn is not None:
                row[f"R_world_{hand}hand"] = rotvec_to_matrix(turn) @ getattr(stance, f"R_world_{hand}hand")
            if closing is not None:
                row[f"q_{hand}hand"] = grasp_posture(side, closing, robot)
            if force is not None:
                row[f"f_world_{hand}palm"] = np.asarray(force, dtype=float)
        rows.append(row)
    return {field: np.stack([row[field] for row in rows]) for field in rows[0]}
