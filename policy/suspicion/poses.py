"""What poses in numbers may be instead: upside down, in millimetres, rotations of another layout, no command yet."""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_args

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.slot import Slot
from policy.action_spec.spec import ActionSpec
from policy.action_spec.wrist_codec import NETWORK_QUATERNION_TOLERANCE, frame_pose
from policy.findings import Finding
from policy.geometry.rotations import Rot6dLayout, angle_between, quaternion_to_matrix, rot6d_vectors

UPRIGHT, HALF = 0.5, 0.5
"""Least cosine of the tilt of a pelvis that stands or bends, and share of the rows in which it is less; chosen: 60
deg."""
HEIGHT_MAX = 5.0
"""Height of a pelvis from which it is in another unit [m]; chosen: no robot of 1.3 m jumps so."""
LOW, HIGH = 0.2, 1.3
"""Heights of the pelvis of a G1 on its feet [m]; chosen: crouched on the floor, and on its toes with a jump."""
SKEW, UNEVEN, STEPS_SHARE = 0.5, 0.35, 0.2
"""Cosine between both vectors of a rot6d, distance of their lengths from 1, and share of the steps, from which they are
no rotation; chosen: networks that were trained are below a tenth."""
FITS = 0.05
"""Cosine and difference of lengths of a layout that is named as the one that fits; chosen: what networks and
rounding leave."""
PLACEHOLDER_P, PLACEHOLDER_R = 1e-6, 1e-6
"""How near position and rotation are to the origin of their frame where there is no command yet [m, rad]; chosen."""
TURNED, NEARER = np.deg2rad(108.0), np.deg2rad(20.0)
"""Angle of the wrists from the stance, in the mean of both, from which another order of their quaternions is tried, and
by how much nearer that must be; measured: as `policy.suspicion.joint_table.GAIN`."""


def root_findings(T_world_base: np.ndarray, quaternion: np.ndarray) -> list[Finding]:
    """Hypotheses about the pelvis of a motion, poses (n, 4, 4), from quaternions x y z w (n, 4) as in the file."""
    return [*_upside_down(T_world_base, quaternion), *_height(T_world_base[:, 2, 3])]


def _upside_down(T: np.ndarray, quaternion: np.ndarray) -> Iterator[Finding]:
    up = T[:, 2, 2]
    if np.mean(up < UPRIGHT) < HALF:
        return
    tilt = np.rad2deg(np.arccos(np.clip(np.median(up), -1.0, 1.0)))
    other = quaternion_to_matrix(quaternion / np.linalg.norm(quaternion, axis=1)[:, None], "wxyz")[:, 2, 2]
    how = "upside down" if np.median(up) < -UPRIGHT else "lying"
    if np.mean(other < UPRIGHT) < HALF:
        yield Finding(
            "w_first", "error",
            f"the root is {how}, tilted by {tilt:.0f} deg in the median row; with w first (wxyz) it is upright",
            "--read-as w_first reads it so",
        )  # fmt: skip
    else:
        yield Finding(
            "root_tilt", "error", f"the root is {how}, tilted by {tilt:.0f} deg in the median row",
            "correct it, or --read-as as_named if the robot does lie",
        )  # fmt: skip


def _height(z: np.ndarray) -> Iterator[Finding]:
    middle = float(np.median(z))
    if abs(middle) > HEIGHT_MAX:
        metric = LOW <= 1e-3 * middle <= HIGH
        yield Finding(
            "millimetres", "error",
            f"the root is {middle:.4g} m high in the median row"
            + (f"; in millimetres it would be {1e-3 * middle:.3g} m" if metric else "") + ": positions are in metres",
            "--read-as millimetres reads it so" if metric else "correct its unit",
        )  # fmt: skip


def wrist_findings(spec: ActionSpec, actions: np.ndarray, anchor: Anchor) -> list[Finding]:
    """Hypotheses about the wrist slots of raw actions (H, A): finite, of the layout's width."""
    found: list[Finding] = []
    for side in ("left", "right"):
        position, rotation = spec.slot(f"{side}_wrist_position"), spec.slot(f"{side}_wrist_rotation")
        if position is None or rotation is None:
            continue
        if rotation.kind == "rot6d":
            found += _rot6d(rotation, actions[:, rotation.indices])
        if not found and position.mode == "absolute" and position.frame != "world":
            found += _placeholder(position, rotation, actions)
        if found:
            return found
    return list(_quaternion_order(spec, actions, anchor))


def _rot6d(slot: Slot, numbers: np.ndarray) -> Iterator[Finding]:
    if slot.mode == "relative_add":
        return

    def bad(layout: Rot6dLayout, skew: float = SKEW, uneven: float = UNEVEN) -> float:
        pair = rot6d_vectors(numbers, layout)
        sizes = np.linalg.norm(pair, axis=-1)
        cosine = np.abs((pair[:, 0] * pair[:, 1]).sum(axis=-1)) / np.maximum(sizes.prod(axis=-1), 1e-12)
        return float(np.mean((cosine > skew) | (np.abs(sizes - 1.0).max(axis=-1) > uneven)))

    share = bad(slot.rot6d_layout)
    if share <= STEPS_SHARE:
        return
    fitting = [layout for layout in get_args(Rot6dLayout) if bad(layout, FITS, FITS) <= 0.01]
    pair = rot6d_vectors(numbers, slot.rot6d_layout)
    sizes = np.linalg.norm(pair, axis=-1)
    cosine = (pair[:, 0] * pair[:, 1]).sum(axis=-1) / np.maximum(sizes.prod(axis=-1), 1e-12)
    angle = np.rad2deg(np.arccos(np.clip(cosine, -1.0, 1.0)))
    yield Finding(
        "rot6d_layout", "error",
        f"{slot.name} is no rot6d ({slot.rot6d_layout}) in {share:.0%} of rows: its vectors are {sizes.min():.2f} to "
        f"{sizes.max():.2f} long and {np.median(angle):.0f} deg apart, not of unit length and at right angles",
        f'name a layout with "rot6d_layout": "{fitting[0]}", which fits every step: `wholebody layouts --from` writes '
        "it" if fitting else "no layout fits: rot6d is the first two columns of a rotation matrix",
    )  # fmt: skip


def _quaternion_order(spec: ActionSpec, actions: np.ndarray, anchor: Anchor) -> Iterator[Finding]:
    slots = {hand: spec.slot(f"{side}_wrist_rotation") for side, hand in (("left", "lhand"), ("right", "rhand"))}
    if not all(slot and slot.kind == "quaternion" and slot.mode == "absolute" for slot in slots.values()):
        return
    away: dict[str, list[float]] = {"xyzw": [], "wxyz": []}
    for hand, slot in slots.items():
        numbers = actions[:, slot.indices]
        sizes = np.linalg.norm(numbers, axis=1)[:, None]
        if (np.abs(sizes - 1.0) > NETWORK_QUATERNION_TOLERANCE).any():
            return  # which decoding refuses
        R_hand = anchor.T_world_base[:3, :3] @ anchor.poses[hand][:3, :3]
        for order, angles in away.items():
            R = frame_pose(slot, anchor)[:3, :3] @ quaternion_to_matrix(numbers / sizes, order)
            angles.append(float(np.median(angle_between(R, R_hand))))
    given = slots["lhand"].quaternion_order
    other = "wxyz" if given == "xyzw" else "xyzw"
    was, would = (float(np.mean(away[order])) for order in (given, other))
    if was > TURNED and would < was - NEARER:
        yield Finding(
            "quaternion_order",
            "error",
            f"the wrists' quaternions as {given} are {np.rad2deg(was):.0f} deg from the stance in the median step, as "
            f"{other} {np.rad2deg(would):.0f} deg",
            f'name a layout with "quaternion_order": "{other}", which `wholebody layouts --from` writes, or --read-as '
            "as_named",
        )


def _placeholder(position: Slot, rotation: Slot, actions: np.ndarray) -> Iterator[Finding]:
    p, numbers = actions[:, position.indices], actions[:, rotation.indices]
    at_origin = np.abs(p).max(axis=1) <= PLACEHOLDER_P
    if not at_origin.any() or any(position.tcp_offset):
        return
    if not at_origin.all() and np.ptp(numbers[at_origin], axis=0).max(initial=0.0) > PLACEHOLDER_R:
        return
    rows = np.flatnonzero(at_origin)
    yield Finding(
        "placeholder", "error",
        f"{position.name} is at the origin of the {position.frame} in {len(rows)} rows, from row {rows[0]} on: "
        "no command yet, as exporters write it before the first one",
        "leave those rows out; --read-as as_named takes them as they are",
    )  # fmt: skip
