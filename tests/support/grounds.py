"""Floors that slope or sway, a foot that stands higher, feet that are turned: plants that begin in the stance there."""

import tempfile
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio, stance_q
from wholebody.robot.feet import Feet
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.robot_errors import RealisticPlant

SUNK = 6e-4
"""How deep MuJoCo's soles are in the floor when they carry the robot [m]: all corners touch at once."""
SLAB = '<mujoco><worldbody><geom type="box" size="{}" pos="{}" quat="{}"/></worldbody></mujoco>'


class Ground(MujocoPlant):
    """The world's vertical is that of gravity; its origin is midway between the soles.

    Args:
        spec: The robot.
        slope: Of the floor [rad]. direction: Towards which it rises, from x to y [rad].
        step: How much higher the left foot stands [m].
        turn: About the normal of each foot, both outwards [rad].
        sway: By how much the slope of the floor swings [rad], at a frequency of ``hz``.
        world: As of `MujocoPlant`.
    """

    def __init__(self, spec, *, slope=0.0, direction=0.0, step=0.0, turn=0.0, sway=0.0, hz=0.5, **world):
        self._axis, self._swings = np.array([np.sin(direction), -np.cos(direction), 0.0]), (slope, sway, hz)
        floor = pin.exp3(slope * self._axis)
        quat = pin.Quaternion(floor).coeffs()[[3, 0, 1, 2]]
        model = load_pinocchio(spec)
        self.feet = feet_on(spec, model, floor, step, turn)
        with tempfile.TemporaryDirectory() as folder:
            scene = "floor"
            if step:
                scene = str(Path(folder) / "slab.xml")
                middle = self.feet.poses[0].act(spec.feet[0].sole_center) - 0.5 * step * floor[:, 2]
                sizes = (0.11, 0.06, 0.5 * step), middle, quat
                Path(scene).write_text(SLAB.format(*(" ".join(f"{x:.12g}" for x in numbers) for numbers in sizes)))
            super().__init__(spec, scene=scene, **world)
        ground = self.model.geom("floor")
        ground.quat, ground.pos = quat, -0.5 * step * floor[:, 2]
        # MuJoCo has compiled a level floor: neither its pose nor the boxes around it are to be taken from that.
        self.model.geom_sameframe[ground.id] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE
        q, zero = self.feet.stance(spec, model), np.zeros(model.nv)
        q[:3] -= SUNK * floor[:, 2]
        self._conversion.to_mujoco(q, zero, self.model.key_qpos[0], np.zeros(self.model.nv))
        self.reset()

    def step(self, command):
        slope, sway, hz = self._swings
        if sway:
            floor = pin.exp3((slope + sway * np.sin(2.0 * np.pi * hz * self.data.time)) * self._axis)
            ground = self.model.geom("floor")
            ground.quat = pin.Quaternion(floor).coeffs()[[3, 0, 1, 2]]
            self.model.geom_sameframe[ground.id] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        return super().step(command)


class RealisticGround(RealisticPlant, Ground):
    """The same under a robot that differs from its model."""


def feet_on(spec, model, floor, step=0.0, turn=0.0):
    """Both feet on a floor through the origin with these axes (3, 3), where the stance has them else."""
    nominal = Feet.at(spec, model, stance_q(spec, model))
    R, p = [], []
    for side, foot, T in zip((1.0, -1.0), spec.feet, nominal.poses, strict=True):
        turned = floor @ pin.exp3(np.array([0.0, 0.0, side * turn])) @ T.rotation
        middle = floor @ (T.act(np.array(foot.sole_center)) + np.array([0.0, 0.0, 0.5 * side * step]))
        R.append(turned)
        p.append(middle - turned @ foot.sole_center)
    return Feet(np.array(R), np.array(p))
