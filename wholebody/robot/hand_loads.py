"""What the hands carry, in a model of the robot and in its table of bodies, changed while it runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from models.pinocchio_model import payload
from models.spec import RobotSpec
from wholebody.robot.body_table import inertia_row
from wholebody.robot.kernels.bodies import MASS

LOAD_MAX = 5.0
"""Largest mass in a hand that is believed or told [kg]; derived: held level, the wrist's 5 N m are spent at 2 kg; at
5 kg only an arm that hangs holds it."""


@dataclass(frozen=True)
class Loads:
    """Masses counted on in the left and right hand.

    Attributes:
        masses: [kg]
        reserve: Masses that plans leave room for besides [kg].
    """

    masses: tuple[float, float] = (0.0, 0.0)
    reserve: tuple[float, float] = (0.0, 0.0)

    @property
    def most(self) -> tuple[float, float]:
        """Loads with the reserve [kg]."""
        return self.masses[0] + self.reserve[0], self.masses[1] + self.reserve[1]

    def beyond(self, other: Loads) -> float:
        """The most by which a mass is larger than that of another one [kg]."""
        return max(a - b for a, b in zip(self.masses, other.masses, strict=True))


class HandLoads:
    """Masses in the left and right hand, as solid balls where `models.pinocchio_model.load_pinocchio` puts them.

    Args:
        spec: The robot.
        model: Pinocchio's model of it without loads, which `carry` changes.

    Attributes:
        present: Masses in left and right hand [kg].
    """

    def __init__(self, spec: RobotSpec, model: pin.Model) -> None:
        self._model, self._spec, self.present = model, spec, (0.0, 0.0)
        joints = [model.frames[model.getFrameId(tool.palm_body)].parentJoint for tool in spec.tools]
        self._bare = {joint: model.inertias[joint].copy() for joint in joints}
        self.mass = float(pin.computeTotalMass(model))

    def carry(self, loads: Sequence[float], *tables: np.ndarray) -> None:
        """Change model, and tables of its bodies (n, BODY), to these masses in the left and right hand [kg]."""
        for tool, mass in zip(self._spec.tools, loads, strict=True):
            joint, inertia = payload(self._model, tool, mass)
            loaded = self._bare[joint] if mass == 0.0 else self._bare[joint] + inertia
            self._model.inertias[joint] = loaded
            for table in tables:
                table[joint - 1, MASS:] = inertia_row(loaded)
        self.present = tuple(float(mass) for mass in loads)

    @property
    def total(self) -> float:
        """Mass of the robot with its loads [kg]."""
        return self.mass + sum(self.present)
