"""Where the pelvis is at each step of a chunk, as far as its legs and its tilt say so.

The feet stay where they are. Legs that agree with that are a reference posture: they say where the pelvis is over the
soles, and so where arm joints put the hands. Legs that ask for a step are refused by name.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from policy.action_spec.anchor import Anchor, between_soles
from policy.action_spec.slot_values import joint_values, resolved
from policy.action_spec.spec import ActionSpec
from policy.errors import ChunkError
from policy.geometry.rotations import angle_between, matrix_to_rpy, rpy_to_matrix
from policy.geometry.se3 import inverse, make_transform
from policy.kinematics.forward import kinematics

STEP, TURN = 0.03, 0.15
"""How far one foot may move [m], and turn [rad], against the other in a chunk of a robot whose feet stay; chosen: what
compliance and calibration of a standing robot's legs show, well below any step."""
LEGS = {"left": "left_leg", "right": "right_leg"}
"""Limb of each side (`models.spec.RobotSpec.limbs`)."""
FEET_DIFFERENCE = 0.05
"""Difference from how the feet stand here, from which a chunk has a note [m]; chosen: past it balance is another."""
TILTED = 0.1
"""Difference of a tilt that is asked for from the pelvis's, from which a chunk has a note [rad]; chosen: as `STEP`."""


@dataclass(frozen=True)
class PelvisPath:
    """Pelvis of each step.

    Attributes:
        T_world_base: Shape (H, 4, 4), or (1, 4, 4) where it stays.
        q_legs: Leg joints, left then right, shape (H, 12) of the G1, [rad]; None where they are not given.
        notes: What is odd.
    """

    T_world_base: np.ndarray
    q_legs: np.ndarray | None
    notes: tuple[str, ...]


def pelvis_path(spec: ActionSpec, actions: np.ndarray, anchor: Anchor) -> PelvisPath:
    """Pelvis of each step of raw actions (H, A).

    Raises:
        ChunkError: If the legs ask for a step; names it.
    """
    legs = {side: joint_values(spec.slot(limb), actions, anchor) for side, limb in LEGS.items()}
    tilt = spec.slot("base_tilt")
    asked = None if tilt is None else resolved(tilt, actions, anchor)
    if any(q is not None for q in legs.values()):
        T, q_legs, notes = _over_feet(legs, len(actions), anchor)
        if asked is not None:
            off = float(np.abs(asked - tilt_of(T)).max())
            if off > TILTED:
                notes += (f"base_tilt differs by up to {off:.2g} rad from the pelvis that the legs put on the soles",)
        return PelvisPath(T, q_legs, notes)
    if asked is None:
        return PelvisPath(anchor.T_world_base[None], None, ())
    yaw = np.full(len(asked), matrix_to_rpy(anchor.T_world_base[:3, :3])[2])
    R = rpy_to_matrix(np.column_stack([asked, yaw]))
    return PelvisPath(make_transform(R, anchor.T_world_base[:3, 3]), None, ())


def tilt_of(T: np.ndarray) -> np.ndarray:
    """Roll and pitch (..., 2) [rad] of poses (..., 4, 4)."""
    return matrix_to_rpy(T[..., :3, :3])[..., :2]


def _over_feet(
    legs: dict[str, np.ndarray | None], steps: int, anchor: Anchor
) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Pelvis (H, 4, 4) whose soles stay where the anchor has them: the mean of what both legs say; and the legs."""
    q = np.tile(anchor.q_body, (steps + 1, 1))
    where = {side: anchor.robot.limbs[limb] for side, limb in LEGS.items()}
    for side, given in legs.items():
        if given is not None:
            q[1:, where[side]] = given
    T_base = kinematics(anchor.robot).soles(q)
    between = inverse(T_base["left"]) @ T_base["right"]
    first = between[1]
    moved = np.linalg.norm(between[1:, :3, 3] - first[:3, 3], axis=1)
    turned = angle_between(between[1:, :3, :3], first[:3, :3])
    worst = int(np.argmax(np.maximum(moved / STEP, turned / TURN)))
    if moved[worst] > STEP or turned[worst] > TURN:
        raise ChunkError(
            f"the legs ask for a step: at step {worst} one foot is {moved[worst]:.2f} m and "
            f"{np.rad2deg(turned[worst]):.0f} deg from where it was against the other, and feet stay here; "
            "--read-as hands_only judges the hands alone",
            step=worst,
            slot="left_leg",
        )
    notes, off = (), between[1, :3, 3] - between[0, :3, 3]
    if np.linalg.norm(off) > FEET_DIFFERENCE:
        notes += (
            f"the feet stand {np.linalg.norm(first[:3, 3]):.2f} m apart by the legs of the first step, "
            f"{np.linalg.norm(between[0, :3, 3]):.2f} m here: the pelvis is over the middle of both",
        )
    T_base_mid, q_legs = between_soles(T_base), np.hstack([q[1:, leg] for leg in where.values()])
    return anchor.T_world_base @ T_base_mid[0] @ inverse(T_base_mid[1:]), q_legs, notes
