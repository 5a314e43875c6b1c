"""A recording at the rate of a page: poses at instants, and of the margins the worst between two of them."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import pinocchio as pin

from models.conversion import Conversion
from models.moving_bodies import moving_joints, put
from wholebody.sim.record import Record

FPS = 30.0
"""Frames a second of a page [Hz]; chosen: poses are interpolated between them, and a minute is 0.4 MB."""


@dataclass(frozen=True)
class Frames:
    """Instants of a recording; n of them.

    Attributes:
        rows: Their control periods, shape (n,).
        starts: First control period since the frame before, shape (n,).
    """

    record: Record
    rows: np.ndarray
    starts: np.ndarray

    @classmethod
    def of(cls, record: Record) -> Frames:
        """The instants nearest to a regular grid, the last one included."""
        time = record["time"]
        grid = np.arange(time[0], time[-1] + 0.5 / FPS, 1.0 / FPS)
        rows = np.unique([*np.searchsorted(time, grid - 1e-9).clip(max=len(time) - 1), len(time) - 1])
        return cls(record, rows, np.concatenate([[0], rows[:-1] + 1]))

    @property
    def times(self) -> np.ndarray:
        """Shape (n,), [s]."""
        return self.record["time"][self.rows]

    def of_column(self, name: str) -> np.ndarray:
        """A column at the instants."""
        return self.record[name][self.rows]

    def most(self, values: np.ndarray) -> np.ndarray:
        """Largest value of each stretch of control periods; values of shape (periods, ...)."""
        return np.fmax.reduceat(values, self.starts, axis=0)

    def least(self, values: np.ndarray) -> np.ndarray:
        """Smallest value of each stretch."""
        return np.fmin.reduceat(values, self.starts, axis=0)


def in_mujoco(conversion: Conversion, model: mujoco.MjModel, q: np.ndarray, objects: np.ndarray | None) -> np.ndarray:
    """Configurations of robot (n, nq) and the scene's bodies (n, k, 7) as MuJoCo's, shape (n, model.nq)."""
    qpos = np.tile(model.qpos0, (len(q), 1))
    qpos[:, conversion.qpos_index] = q
    if objects is not None:
        moving = moving_joints(model)
        for row, poses in zip(qpos, objects, strict=True):
            put(model, row, moving, poses)
    return qpos


def placed(model: pin.Model, q: np.ndarray) -> pin.Data:
    """Joint placements of a configuration."""
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    return data
