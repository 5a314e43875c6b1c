"""How a robot that falls meets the floor: speeds and forces of its parts in MuJoCo."""

import mujoco
import numpy as np

PARTS = {
    "head": ("head",),
    "hands": ("_hand_", "wrist"),
    "arms": ("elbow", "shoulder"),
    "torso": ("torso", "logo"),
    "pelvis": ("pelvis", "hip_pitch", "hip_roll"),
    "knees": ("knee", "hip_yaw"),
}
"""Parts of the robot, and what the names of their bodies have in them; hands are palms, fingers and wrists, knees are
shins and thighs. Feet are on the floor anyway."""
AWAY = 0.05
"""Time without contact after which a body meets the floor again [s]."""


class Landings:
    """Watches a plant, a control period at a time.

    Attributes:
        speed: Largest speed towards the floor with which a part has met it, by part [m/s]; none that has not.
        force: Largest normal force of the floor on a part [N].
    """

    def __init__(self, plant):
        self._plant, self._model = plant, plant.model
        self._floor, self._before = plant.model.geom("floor").id, mujoco.MjData(plant.model)
        names = [plant.model.body(b).name for b in range(plant.model.nbody)]
        self._part = [next((part for part, words in PARTS.items() if any(w in name for w in words)), None)
                      for name in names]  # fmt: skip
        self.reset()

    def reset(self):
        """Forget what was."""
        self.speed, self.force, self._last = {}, {}, {}
        self.begin()

    def begin(self):
        """Before a step of the plant."""
        self._state = self._plant.data.qpos.copy(), self._plant.data.qvel.copy()

    def end(self):
        """After it: its contacts are those of the state before, which its forces have not braked yet."""
        data, now, met, force = self._plant.data, self._plant.data.time, [], {}
        for contact in data.contact:
            first, second = contact.geom
            if self._floor not in (first, second):
                continue
            body = int(self._model.geom_bodyid[second if first == self._floor else first])
            if (part := self._part[body]) is None:
                continue
            if contact.efc_address >= 0:
                force[part] = force.get(part, 0.0) + float(data.efc_force[contact.efc_address])
            if now - self._last.get(body, -np.inf) > AWAY:
                met.append((body, part, contact.pos.copy()))
            self._last[body] = now
        for part, one in force.items():
            self.force[part] = max(self.force.get(part, 0.0), one)
        if met:
            self._meet(met)
        self.begin()

    def _meet(self, met):
        before, velocity = self._before, np.zeros(6)
        before.qpos[:], before.qvel[:] = self._state
        mujoco.mj_fwdPosition(self._model, before)
        mujoco.mj_fwdVelocity(self._model, before)
        for body, part, point in met:
            mujoco.mj_objectVelocity(self._model, before, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
            down = -(velocity[5] + np.cross(velocity[:3], point - before.xpos[body])[2])
            self.speed[part] = max(self.speed.get(part, 0.0), float(down))
