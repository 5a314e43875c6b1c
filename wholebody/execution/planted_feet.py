"""Where plans and program take the feet to stand."""

from __future__ import annotations

import numpy as np

from models.pinocchio_model import stance_q
from models.spec import RobotSpec
from wholebody.control.base import Controller
from wholebody.robot.contact_schedule import Contacts, ContactSchedule
from wholebody.robot.feet import Feet
from wholebody.types import RobotState

SAME_PLACE, ANGLE = 0.005, 0.01
"""Difference between where a foot is taken to be and where it is measured up to which it stays so [m, rad]; derived:
soles creep by 4 mm in the lissajous, and an IMU that is wrong by 0.3 degrees turns both feet by 0.005 rad."""
SETTLED_TIME = 1.0
"""Time for which a foot that moved has to stay where it is to be taken to stand there [s]; chosen: longer than a robot
that tips stands on an edge of its soles."""
SLOPE_MAX = 0.2
"""Steepest floor that a robot is taken to stand on [rad]; chosen: half of the slope of the friction pyramid."""

EARLY, TILTED = 0.2, 0.15
"""Time since the start of an episode within which a robot that hangs is found out [s], and angle by which both soles
are tilted then, from where they were [rad]; measured: legs that meet no floor tilt them so after 48 to 56 ms, true and
realistic. Of a robot that stands they tilt by 0.065 at most, begun in a lean of 7 degrees."""


def taken_to_stand(spec: RobotSpec, nominal: ContactSchedule, measured: Feet) -> ContactSchedule:
    """Where plans take measured feet to be: where the stance has them, within `SAME_PLACE` and `ANGLE`.

    So it is too on a floor that is steeper than `SLOPE_MAX`.
    """
    there = measured.differ(nominal.feet(), SAME_PLACE, ANGLE) and measured.floor(spec).slope <= SLOPE_MAX
    return ContactSchedule.standing(measured) if there else nominal


class PlantedFeet:
    """The feet as measured: at once when an episode starts, later when a plan is asked for and they stand still.

    Feet that are where the stance has them, but for `SAME_PLACE` and `ANGLE`, are taken to be exactly there.

    Args:
        controller: Told where the robot stands.

    Attributes:
        contacts: Which feet stand where: both, for ever.
        stance: The stance on them, shape (nq,).
        hung: Whether the robot hung when its episode began: its legs met no floor.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller, robot = controller, controller.robot
        self._spec, self._model, self._data = controller.spec, robot.model, robot.scratch
        self._nominal = stance_q(self._spec, self._model)
        self._seen: tuple[float, Feet] | None = None
        self._began: float | None = None
        self._soles, self.hung = np.zeros((2, 3)), False
        self._take(Feet.at(self._spec, self._model, self._nominal, self._data), self._nominal)

    def reset(self, state: RobotState) -> ContactSchedule:
        """Begin where a measured state has them."""
        nominal, measured = Feet.at(self._spec, self._model, self._nominal, self._data), self._measured(state)
        self._seen, self._began, self._soles, self.hung = None, None, measured.R[:, :, 2], False
        self._take(nominal, self._nominal)
        self._controller.stand_on_floor(nominal)
        if measured.differ(nominal, SAME_PLACE, ANGLE):
            self.stand_on(measured)
        return self.contacts

    def hangs(self, state: RobotState) -> bool:
        """Whether a state at the beginning of an episode is that of a robot that hangs.

        By the torques of its legs it carries itself, because that is what they are asked for; but they tilt its soles.
        """
        self._began = state.time if self._began is None else self._began
        if not self.hung and state.time - self._began < EARLY:
            upright = np.einsum("ij,ij->i", self._measured(state).R[:, :, 2], self._soles)
            self.hung = bool(upright.max() < np.cos(TILTED))
        return self.hung

    @property
    def feet(self) -> Feet:
        """Both feet."""
        return self.contacts.feet()

    def planned(self, state: RobotState) -> ContactSchedule:
        """What a plan that is asked for now counts on; a foot that carries nothing is not where it will stand."""
        measured = self._measured(state)
        lifted = state.stands is not None and not all(state.stands)
        if lifted or not measured.differ(self.feet, SAME_PLACE, ANGLE):
            self._seen = None
        elif self._seen is None or measured.differ(self._seen[1], 0.5 * SAME_PLACE, 0.5 * ANGLE):
            self._seen = state.time, measured
        elif state.time - self._seen[0] >= SETTLED_TIME:
            self.stand_on(measured)
        return self.contacts

    def _measured(self, state: RobotState) -> Feet:
        return Feet.at(self._spec, self._model, state.q, self._data)

    def stand_on(self, feet: Feet) -> None:
        """Stand there from now on, if that is a floor to stand on."""
        self._seen = None
        if feet.floor(self._spec).slope <= SLOPE_MAX:
            self._take(feet, feet.stance(self._spec, self._model))
            self._controller.stand_on(Contacts(feet))

    def _take(self, feet: Feet, stance: np.ndarray) -> None:
        self.contacts, self.stance = ContactSchedule.standing(feet), stance
