"""The robot's state in the numbers of an action layout."""

from __future__ import annotations

import dataclasses

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.codec import encode_valid
from policy.action_spec.spec import ActionSpec
from policy.chunk import ActionChunk
from policy.joints import LEFT_ARM, RIGHT_ARM, WAIST
from policy.observation import Observation


def state_layout(spec: ActionSpec) -> ActionSpec:
    """Layout of the state that goes with an action layout: the same slots, absolute.

    With the state in the slots of the action, relative actions line up with it number by number, and a 32-dimensional
    state fits a prompt of 200 tokens.
    """
    slots = tuple(dataclasses.replace(slot, mode="absolute", limits=None) for slot in spec.slots)
    return spec if slots == spec.slots else dataclasses.replace(spec, name=f"{spec.name}_state", slots=slots)


def state_numbers(layout: ActionSpec, observation: Observation, anchor: Anchor | None = None) -> np.ndarray:
    """The robot's state in the numbers of a layout, shape (layout.dim,).

    A ``base_velocity`` is 0: observations carry none.

    Args:
        layout: A state is absolute in every slot; slots that are relative say that nothing moves.
        observation: Measured joints and pelvis.
        anchor: ``Anchor.measured(observation)`` if there is one already.
    """
    anchor = Anchor.measured(observation) if anchor is None else anchor
    now = ActionChunk(
        spec_id=layout.id,
        seq=0,
        t_obs=observation.time,
        fps=layout.fps,
        T_world_lhand=(anchor.T_world_base @ anchor.poses["lhand"])[None],
        T_world_rhand=(anchor.T_world_base @ anchor.poses["rhand"])[None],
        q_lhand=anchor.q_lhand[None],
        q_rhand=anchor.q_rhand[None],
        q_larm=anchor.q_body[None, LEFT_ARM],
        q_rarm=anchor.q_body[None, RIGHT_ARM],
        q_waist=anchor.q_body[None, WAIST],
        base_height=anchor.T_world_base[2:3, 3],
    )
    return encode_valid(layout, now, anchor)[0]
