"""Centre of mass and momentum of the robot along a motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from wholebody.robot.body_table import body_table
from wholebody.robot.hand_loads import HandLoads
from wholebody.trajopt import entry_points


class Centroidal:
    """Computes them for many states at once.

    Args:
        spec: The robot. model: Of it, without loads.
        frames: Frames whose orientations are wanted too.
    """

    def __init__(self, spec: RobotSpec, model: pin.Model, frames: Sequence[int]) -> None:
        self._loads = HandLoads(spec, model.copy())
        table, parent = body_table(model)
        bodies = np.array([model.frames[i].parentJoint - 1 for i in frames])
        turns = np.array([model.frames[i].placement.rotation for i in frames])
        n = len(parent)
        self._tables = table, parent, bodies, turns
        self._scratch = np.zeros((n, 3, 3)), np.zeros((n, 3)), np.zeros((n, 6)), np.zeros((4, 10))

    def carry(self, loads: Sequence[float]) -> None:
        """Count on these masses in the left and right hand from now on [kg]."""
        self._loads.carry(loads, self._tables[0])

    def __call__(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Evaluate at configurations (K, nq), whose quaternions have length 1, and velocities (K, nv).

        Returns:
            Centre of mass, its velocity and the angular momentum about it, (K, 3) each, and the rotations of the
            frames, (n_frames, K, 3, 3).
        """
        K, frames = len(q), len(self._tables[2])
        out = np.empty((K, 3)), np.empty((K, 3)), np.empty((K, 3)), np.empty((frames, K, 3, 3))
        states = np.ascontiguousarray(q), np.ascontiguousarray(v)
        entry_points.centroidal(*self._tables, *states, *out, *self._scratch)
        return out
