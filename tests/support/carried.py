"""What hands carry: nothing to do but to hold it, and a plant in which it changes."""

import math

import numpy as np

from models import g1
from policy.scripted.policy import ScriptedMotion, ScriptedPolicy, stance_pose
from wholebody.sim.plant import MujocoPlant

SPEC = g1()
NOTHING = 1e-4
"""Mass in a hand that can be changed later [kg]."""


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
