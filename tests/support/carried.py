"""What hands carry: nothing to do but to hold it, and a plant in which it changes."""

import math
from dataclasses import replace

import numpy as np

from models import g1
from policy.chunk import ActionChunk
from policy.geometry.rotations import rotvec_to_matrix
from policy.scripted.policy import ScriptedMotion, ScriptedPolicy, minimum_jerk, stance_pose
from tests.support.planted_causes import STIFF, TIME, chunk_of, moved
from wholebody.config import ControllerConfig, LoadConfig
from wholebody.sim.plant import MujocoPlant

SPEC = g1()
NOTHING = 1e-4
"""Mass in a hand that can be changed later [kg]."""
GOAL, ROLLED = [0.5, 0.2, 1.08], np.deg2rad(40.0)
"""Where the left hand is to hold a mass level [m], and how far it is rolled at first, where pitch and yaw of the wrist
share the load [rad]: level, 2 kg are all that pitch gives, and a hand begun so is dropped."""


def told(left: float) -> ControllerConfig:
    """Settings that tell of a mass in the left hand [kg], for a robot whose waist bears it."""
    return replace(STIFF, loads=LoadConfig(source="told", left=left))


def levelled() -> ActionChunk:
    """The left hand goes to the goal and comes to be level."""
    roll = (1.0 - minimum_jerk(TIME / 1.4)) * ROLLED
    R = rotvec_to_matrix(roll[:, None] * np.array([1.0, 0.0, 0.0])) @ stance_pose().R_world_lhand
    return chunk_of(moved(GOAL, 1.4), R_left=R)


def still(duration: float) -> ScriptedPolicy:
    """Both hands where they are in the stance."""
    stance = stance_pose()

    def script(t: np.ndarray) -> ScriptedMotion:
        palms = [np.tile(p, (len(t), 1)) for p in (stance.p_world_lpalm, stance.p_world_rpalm)]
        return ScriptedMotion(*palms, stance.R_world_lhand, stance.R_world_rhand, stance.q_lhand, stance.q_rhand)

    return ScriptedPolicy("still", script, duration)


class Changed(MujocoPlant):
    """A plant whose hands carry something else from a time on.

    Attributes:
        before, after: Masses in left and right hand [kg]. at: When they change [s].
    """

    before, after, at = (NOTHING, NOTHING), (NOTHING, NOTHING), math.inf

    def reset(self):
        """As the plant, with what is carried first."""
        state, self._changed = super().reset(), False
        self.hold(self.before)
        return state

    def step(self, command):
        """As the plant."""
        if not self._changed and self.data.time >= self.at:
            self.hold(self.after)
            self._changed = True
        return super().step(command)
