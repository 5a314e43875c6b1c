"""A robot on a rope at its torso, lifted and let down."""

from dataclasses import replace

import numpy as np

from wholebody.sim.plant import MujocoPlant
from wholebody.sim.robot_errors import RealisticPlant

STIFFNESS, DAMPING, LENGTH = 4e3, 4e2, 1.0
"""Of the rope [N/m, N s/m], and how far over the torso it hangs [m]; chosen: it gives by 8 cm under the robot."""
EYE = np.array([0.0, 0.0, 0.25])
"""Where it is tied, from the torso's centre of mass in its axes [m]; chosen: at the height of the shoulders."""


class OnRope:
    """A plant that begins ``height`` over the floor, its weight on the rope, and is let down from a time on.

    Attributes:
        height: Of the soles at first [m].
        down: From when on it is let down [s], how fast [m/s], and how far in all [m].
    """

    height, down = 0.1, (np.inf, 0.2, np.inf)

    def hoisted(self):
        """The state of an episode that begins in the air."""
        state = self.reset()
        q = state.q.copy()
        q[2] += self.height
        state = self.reset(replace(state, q=q))
        self._torso = self.model.body(self.spec.torso_body).id
        self._place = self._eye()
        return state

    def step(self, command):
        pull = self._pull()
        self.data.xfrc_applied[self._torso] = [*pull, *np.cross(self._eye() - self.data.xipos[self._torso], pull)]
        return super().step(command)

    def _eye(self):
        return self.data.xipos[self._torso] + self.data.xmat[self._torso].reshape(3, 3) @ EYE

    def _pull(self):
        since, speed, most = self.down
        let_down = min(max(self.data.time - since, 0.0) * speed, most)
        away, v, weight = self._eye() - self._place, self.data.cvel[self._torso, 3:], 9.81 * self.model.body_mass.sum()
        tight = weight - STIFFNESS * (away[2] + let_down)
        up = max(tight - DAMPING * v[2], 0.0) if tight > 0.0 else 0.0
        return np.array([-up * away[0] / LENGTH, -up * away[1] / LENGTH, up])


class Hoisted(OnRope, MujocoPlant):
    """The true robot on a rope."""


class RealisticHoisted(OnRope, RealisticPlant):
    """The realistic one."""
