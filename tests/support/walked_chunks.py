"""Policies whose layouts have a base velocity: what they say, step for step, in numbers of the layout."""

import numpy as np

from models import g1
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.codec import decode, encode
from policy.action_spec.parts import scalar, stack, velocity, wrist
from policy.action_spec.spec import ActionSpec
from policy.chunk import ActionChunk

SPEC = g1()
ROOM = ActionSpec(
    name="in_the_room",
    robot=SPEC,
    slots=stack(
        *wrist("left", frame="world"),
        *wrist("right", frame="world"),
        scalar("left_grasp", "1", limits=((0.0, 1.0),)),
        scalar("right_grasp", "1", limits=((0.0, 1.0),)),
        velocity(),
    ),
)
"""A layout whose wrists are in world."""
LAYOUTS = {name: builtin(name) for name in ("wbc27", "gr00t_g1", "openhlm34")} | {"in_the_room": ROOM}


class Walks:
    """Says a velocity of the base until a time, then none; hands stay about the pelvis, or in the room, or move.

    Args:
        spec: The layout.
        velocity: Ahead, to the left [m/s] and about the vertical [rad/s].
        until: Time after the first observation [s].
        sway: How far both hands go up and down [m].
    """

    sees_robot = True

    def __init__(self, spec, velocity, until, sway=0.0, horizon=50, fps=30.0):
        self.spec, self.velocity, self.until, self.sway = spec, np.array(velocity, dtype=float), until, sway
        self.horizon, self.fps = horizon, fps
        self.reset()

    def reset(self, task=""):
        self._seq, self._begin, self._hands, self._legs = 0, None, None, {}

    def chunk(self, observation):
        """As it is meant, before the layout."""
        anchor = Anchor.measured(observation, SPEC)
        room = self.spec is ROOM
        if self._begin is None:
            self._begin = observation.time
            poses = [anchor.poses[hand] for hand in ("lhand", "rhand")]
            self._hands = [anchor.T_world_base @ T if room else T for T in poses]
        times = observation.time - self._begin + np.arange(self.horizon) / self.fps
        lift = np.zeros((self.horizon, 4, 4))
        lift[:] = np.eye(4)
        lift[:, 2, 3] = 0.5 * self.sway * (1.0 - np.cos(np.pi * times))
        place = np.eye(4) if room else anchor.T_world_base
        left, right = (place @ lift @ T for T in self._hands)
        fingers = [np.tile(q, (self.horizon, 1)) for q in (anchor.q_lhand, anchor.q_rhand)]
        velocity = self.velocity * (times < self.until)[:, None]
        return ActionChunk(
            self.spec.id, self._seq, observation.time, self.fps, left, right, *fingers, base_velocity=velocity
        ), anchor

    def infer(self, observation):
        chunk, anchor = self.chunk(observation)
        if self.spec.slot("base_yaw_rate") is not None and self.spec.slot("base_velocity") is None:
            chunk.base_velocity[:, :2] = 0.0
        self._seq += 1
        actions = encode(self.spec, chunk, anchor)
        # Legs that a policy says are a posture over the soles, not what these do in the midst of a step.
        for slot in filter(None, (self.spec.slot("left_leg"), self.spec.slot("right_leg"))):
            self._legs.setdefault(slot.name, actions[0, slot.indices].copy())
            actions[:, slot.indices] = self._legs[slot.name]
        return decode(self.spec, actions, anchor, seq=chunk.seq, t_obs=chunk.t_obs, fps=self.fps)
