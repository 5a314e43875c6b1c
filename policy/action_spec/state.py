"""The robot's state in the numbers of an action layout."""

from __future__ import annotations

import dataclasses

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.codec import decode, encode_valid
from policy.action_spec.parts import lean, scalar, stack
from policy.action_spec.pelvis_path import pelvis_path
from policy.action_spec.slot import OF_TOUCH, Slot
from policy.action_spec.spec import ActionSpec
from policy.chunk import ActionChunk
from policy.errors import ChunkError, ObservationError
from policy.geometry.rotations import matrix_to_rpy, rpy_to_matrix
from policy.geometry.se3 import inverse
from policy.kinematics.forward import kinematics
from policy.kinematics.inverse import arm_joints, leg_joints, upper_body_joints
from policy.observation import Observation

STATE_OF = "_state"
"""Behind the name of a layout in the name of its state."""
STATE_MAX = 32
"""Numbers of state that π0 and π0.5 take unchanged (``max_state_dim``)."""


def state_layout(spec: ActionSpec) -> ActionSpec:
    """Layout of the state that goes with an action layout.

    The slots of the action, absolute, but for those of hands that touch something. Wrists in the stance frame do not
    say how the robot stands, so height and lean of the pelvis follow; where that makes more than `STATE_MAX` numbers,
    one closing number stands for the fingers of a hand. Of wbc32 that are 23 numbers.
    """
    aligned = aligned_state(spec)
    slots = aligned.slots
    if any(slot.name in OF_TOUCH for slot in slots):
        slots = _stacked([vars(slot) for slot in slots if slot.name not in OF_TOUCH])
    if any(slot.frame == "stance" and slot.kind == "position" for slot in slots):
        slots = _with_lean(slots)
    return aligned if slots == aligned.slots else _as_state(spec, slots)


def aligned_state(spec: ActionSpec) -> ActionSpec:
    """The slots of an action, absolute, and nothing else: relative actions line up with it number by number."""
    slots = tuple(dataclasses.replace(slot, mode="absolute", limits=None) for slot in spec.slots)
    return spec if slots == spec.slots and not spec.masked else _as_state(spec, slots)


def _as_state(spec: ActionSpec, slots: tuple[Slot, ...]) -> ActionSpec:
    return dataclasses.replace(spec, name=spec.name + STATE_OF, slots=slots, masked=False)


def _with_lean(slots: tuple[Slot, ...]) -> tuple[Slot, ...]:
    known = {slot.name for slot in slots}
    parts = [vars(slot) for slot in slots] + [part for part in lean() if part["name"] not in known]
    if sum(part["size"] for part in parts) > STATE_MAX:
        grasps = {f"{side}_hand": scalar(f"{side}_grasp", "1") for side in ("left", "right")}
        parts = [grasps.get(part["name"], part) for part in parts]
    return _stacked(parts)


def _stacked(parts: list[dict]) -> tuple[Slot, ...]:
    return stack(*({key: value for key, value in part.items() if key != "start"} for part in parts))


def observation_of(layout: ActionSpec, numbers: np.ndarray, time: float = 0.0) -> Observation:
    """An observation with these numbers of state, inverse of `state_numbers`, of a robot that stands in the stance.

    What the numbers do not say of the pelvis is the nominal stance's; legs that they do not say have it there. Other
    joints are the stance's, where the arms reach the wrists so, else the waist leans too.

    Args:
        layout: Absolute in every slot.
        numbers: State, shape (layout.dim,).
        time: Of the measurement [s].

    Raises:
        ObservationError: If the numbers are not of the layout, no state, or no posture of the robot.
    """
    anchor = Anchor.nominal(robot=layout.robot)
    try:
        now = decode(layout, np.atleast_2d(numbers), anchor)
        T = _pelvis_of(layout, numbers, now, anchor)
        stands = now.q_legs is None and any(slot.frame == "stance" for slot in layout.slots)
        q = _posture(now, _on_legs(anchor, T) if stands else anchor)
    except ChunkError as error:
        raise ObservationError(f"the state is none of '{layout.name}': {error}") from error
    return Observation(time, q, now.q_lhand[0], now.q_rhand[0], T)


def _pelvis_of(layout: ActionSpec, numbers: np.ndarray, now: ActionChunk, anchor: Anchor) -> np.ndarray:
    """``T_world_base`` (4, 4) as far as the numbers say it."""
    T = pelvis_path(layout, np.atleast_2d(numbers), anchor).T_world_base[0].copy()
    if tilt := layout.slot("base_tilt"):
        # Measured, while that of the legs is as good as their joints.
        T[:3, :3] = rpy_to_matrix(np.append(tilt.to_si(numbers[tilt.indices]), matrix_to_rpy(T[:3, :3])[2]))
    if now.base_height is not None:
        T[2, 3] = now.base_height[0]
    return T


def _on_legs(anchor: Anchor, T_world_base: np.ndarray) -> Anchor:
    """The anchor with its pelvis elsewhere, on legs whose soles are where they are."""
    T_base_before, found = (
        inverse(T_world_base) @ anchor.T_world_base,
        kinematics(anchor.robot).soles(anchor.q_body[None]),
    )
    soles = {side: T_base_before @ T[0] for side, T in found.items()}
    return dataclasses.replace(
        anchor, T_world_base=T_world_base, q_body=leg_joints(soles, anchor.q_body, robot=anchor.robot)
    )


def _posture(now: ActionChunk, anchor: Anchor) -> np.ndarray:
    """Body joints (n,) of a chunk of one step [rad]."""
    q, robot, limbs = anchor.q_body.copy(), anchor.robot, anchor.robot.limbs
    if now.q_waist is not None:
        q[limbs["waist"]] = now.q_waist[0]
    if now.q_legs is not None:
        q[limbs["left_leg"]], q[limbs["right_leg"]] = np.split(now.q_legs[0], 2)
    T = {hand: anchor.T_base_world @ getattr(now, f"T_world_{hand}") for hand in ("lhand", "rhand")}
    if now.q_larm is None and now.q_rarm is None and now.q_waist is None:
        return upper_body_joints(T["lhand"], T["rhand"], q, robot=robot)[0]
    for hand, arm, given in (("lhand", "left_arm", now.q_larm), ("rhand", "right_arm", now.q_rarm)):
        q[limbs[arm]] = given[0] if given is not None else arm_joints(hand, T[hand], q, robot=robot)[0]
    return q


def state_numbers(layout: ActionSpec, observation: Observation, anchor: Anchor | None = None) -> np.ndarray:
    """The robot's state in the numbers of a layout, shape (layout.dim,).

    A ``base_velocity`` is 0: observations carry none.

    Args:
        layout: A state is absolute in every slot; slots that are relative say that nothing moves.
        observation: Measured joints and pelvis.
        anchor: Where the robot was measured to be, if that is known already.
    """
    anchor = Anchor.measured(observation, layout.robot) if anchor is None else anchor
    limbs = anchor.robot.limbs
    now = ActionChunk(
        spec_id=layout.id,
        seq=0,
        t_obs=observation.time,
        fps=layout.fps,
        T_world_lhand=(anchor.T_world_base @ anchor.poses["lhand"])[None],
        T_world_rhand=(anchor.T_world_base @ anchor.poses["rhand"])[None],
        q_lhand=anchor.q_lhand[None],
        q_rhand=anchor.q_rhand[None],
        q_larm=anchor.q_body[None, limbs["left_arm"]],
        q_rarm=anchor.q_body[None, limbs["right_arm"]],
        q_waist=anchor.q_body[None, limbs["waist"]],
        base_height=anchor.T_world_base[2:3, 3],
    )
    return encode_valid(layout, now, anchor)[0]
