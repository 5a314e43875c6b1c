"""Which masses in the hands the program and the plans count on."""

from __future__ import annotations

from math import inf

import numpy as np

from wholebody.config import ControllerConfig
from wholebody.control.base import Controller
from wholebody.control.controller import WholeBodyController
from wholebody.control.reference_packet import PALM
from wholebody.control.touch import Touch
from wholebody.errors import ConfigError
from wholebody.estimation.load import LoadObserver
from wholebody.robot.hand_loads import Loads
from wholebody.types import RobotState

FOLLOWED_WITHIN = 0.004
"""Distance of a palm below its command up to which it follows it [m]; chosen: twice as much is more than loads that are
seen in time make."""
MOVED_SHARE = 0.3
"""Share of twice that distance by which a palm that is not held has moved meanwhile; chosen: a load that is put into a
hand makes it sink by all of it."""
SOURCES = ("observed", "told")
LASTING = 0.5
"""Time for which loads have to be a little lighter than in a plan before it is made anew [s]; chosen: what a robot that
is not its model seems to carry wavers with the pose of its arms, and a new plan costs hands on their way time."""
LIGHTER = 2.0
"""Multiple of such a little from which nothing is waited for [no unit]; chosen: 0.3 kg as shipped, more than masses
that are wrong by a tenth feign."""


class Carrying:
    """Hands the controller the masses that are told or observed, and says what plans are to count on.

    Args:
        controller: Whose program counts on them; only that of `WholeBodyController` in compiled form can observe.
        settings: Where loads come from, and how hands touch.

    Attributes:
        loads: What plans count on.
        observer: What sees masses and forces, or None.
        touch: What the hands touch.
    """

    def __init__(self, controller: Controller, settings: ControllerConfig) -> None:
        config = settings.loads
        if config.source not in SOURCES:
            raise ConfigError(f"loads.source is '{config.source}'; it must be one of {', '.join(SOURCES)}")
        self._controller, self._config = controller, config
        self.observer, self._learns = _observer(controller), config.source == "observed"
        self._known = [config.source == "told"] * 2
        self.touch = Touch(controller, settings.touch, self.observer)
        # Without torques in the program there is nothing to leave room in.
        self._reserve = config.reserve if isinstance(controller, WholeBodyController) else 0.0
        self._masses, self._followed, self._carried = np.zeros(2), [0.0, 0.0], [0.0, 0.0]
        """Masses that the program counts on [kg]; heights at which the palms were last where commanded [m], and masses
        that were known when they last were there and touched nothing [kg]."""
        self.loads = self._planned = Loads()
        self._now, self._due = -inf, inf
        """Time of the last state [s]; when what is followed is to be planned anew [s]."""

    def reset(self) -> None:
        """Count on the configured loads until others are observed; nothing is touched."""
        self.touch.reset()
        if self.observer is not None:
            self.observer.reset()
            self._known = [not self._learns] * 2
        self._planned, self._now, self._due = Loads(), -inf, inf
        self._count_on(self._config.left, self._config.right)

    def look(self, state: RobotState, row: np.ndarray, elapsed: float, age: float = 0.0, follows: bool = True) -> None:
        """Take in a state before the tick that answers it.

        Args:
            state: As measured.
            row: Packed reference of the last tick: where the palms are commanded to be.
            elapsed: Time since that tick [s].
            age: Time over which the state was carried on [s].
            follows: Whether the robot follows a plan.
        """
        observer, self._now = self.observer, state.time
        if observer is None:
            return
        news = observer.look(state, self._masses, age)
        self.touch.feel(state, follows)
        self.touch.look(row, state.time, elapsed, follows)
        if not news or not self._learns:
            return
        blocked, known, least = self._blocked(row), observer.known.tolist(), self._config.follow
        seen = [mass if mass > least else 0.0 for mass in observer.loads.tolist()]
        hands = zip(known, seen, self.loads.masses, blocked, self._presses(), self._carried, strict=True)
        left, right = (
            (min(seen, carried) if held else max(seen, carried) if presses else seen) if sure else mass
            for sure, seen, mass, held, presses, carried in hands
        )
        other = max(abs(left - self.loads.masses[0]), abs(right - self.loads.masses[1])) > least
        if other or known != self._known:
            self._known = known
            self._count_on(left, right)

    def _presses(self) -> list[bool]:
        """Whether each hand touches something with a force that it is told: what it rests on does not make it lighter.

        A hand that is told of none may have been relieved of what it carried.
        """
        return [share > 0.0 and self.touch.asked.size(hand) > 0.0 for hand, share in enumerate(self.touch.shares)]

    def _blocked(self, row: np.ndarray) -> list[bool]:
        """Whether something above each hand holds it: it no longer rises with its command, and does not sink either.

        What weighs on a hand is then not carried by it, nor was what seemed to when it began to.
        """
        palms, found = self._controller.palm_positions()[:, 2].tolist(), []
        for hand, z in enumerate(palms):
            short = float(row[PALM * hand + 11]) - z
            if short < FOLLOWED_WITHIN:
                self._followed[hand] = z
                if self.touch.shares[hand] == 0.0:
                    self._carried[hand] = self.loads.masses[hand]
            found.append(short > 2.0 * FOLLOWED_WITHIN and abs(z - self._followed[hand]) < MOVED_SHARE * short)
        return found

    @property
    def changed(self) -> bool:
        """Whether the plan that is followed has to be made anew: loads changed, or something holds a hand back."""
        return self._now >= self._due or self.touch.changed

    def planned(self) -> Loads:
        """What a plan that is asked for now counts on."""
        self._planned, self._due = self.loads, inf
        return self.loads

    def _count_on(self, left: float, right: float) -> None:
        self._masses[:] = left, right
        self._controller.carry((left, right))
        spare = [0.0 if known else self._reserve for known in self._known]
        self.loads = Loads((left, right), (spare[0], spare[1]))
        heavier, lighter, little = (
            self.loads.beyond(self._planned),
            self._planned.beyond(self.loads),
            self._config.replan,
        )
        if heavier >= little or lighter >= LIGHTER * little:
            self._due = self._now
        else:
            self._due = min(self._due, self._now + LASTING) if lighter >= little else inf


def _observer(controller: Controller) -> LoadObserver | None:
    """One that reads what the controller's tick computes, if that is all that it needs."""
    if not isinstance(controller, WholeBodyController) or controller.compiled is None:
        return None
    return LoadObserver(controller.spec, controller.robot, controller.compiled.tick)
