"""What came nearest to its bound during a run: torques, joint positions, balance, feet."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, hypot

import numpy as np

from wholebody.robot.contact_schedule import Contacts, ContactSchedule
from wholebody.robot.plant import Plant
from wholebody.robot.support_polygon import SupportPolygon, convex_polygon

POSITION_TOLERANCE = 2e-3
"""How far a joint may pass its position limit before it counts [rad]; chosen: MuJoCo's limits are springs."""
TIPPING_DISTANCE = 1e-3
"""Distance of the centre of pressure from the edge of the soles below which the robot tips over that edge [m]; chosen,
no trial is on record."""


@dataclass(frozen=True)
class LimitExcess:
    """A bound that was passed, in the unit of the bound.

    Attributes:
        first: When it was passed first [s].
        seconds: How long in all [s].
        worst: Worst value.
        bound: The bound.
    """

    first: float
    seconds: float
    worst: float
    bound: float


@dataclass
class StepMade:
    """A step of the robot.

    Attributes:
        foot: ``left`` or ``right``.
        time: When it was set down [s].
        x, y: Where its sole was by then, world [m].
        heading: Of the sole [rad].
        slip: How far it slid until it was lifted again, or the run ended [m].
        load: Largest load of both soles within `LANDING` of that [N].
    """

    foot: str
    time: float
    x: float
    y: float
    heading: float
    slip: float = 0.0
    load: float = 0.0


LANDING = 0.1
"""Time after a foot is set down in which its landing presses on the floor [s]; chosen: the peak is there in 30 ms."""
TOUCHES = 0.005
"""Height above the lowest point of both soles up to which one touches the floor [m]; chosen: a swing is at 5 cm."""


class LimitMonitor:
    """Looks at the plant after every control period; a foot that is up by the schedule is no fault.

    Attributes:
        torques: Motors asked for more than their effort limit, by joint [N m]. Fingers are left out: pressing with all
            they have is how they hold things.
        positions: Joints past a position limit, by joint [rad].
        margin: Least distance of the centre of pressure from the edge of the soles [m].
        creep: Largest horizontal distance of a sole that stands from where it was when it began to [m].
        steps: Feet that were set down.
    """

    def __init__(self, plant: Plant) -> None:
        self._plant, spec = plant, plant.spec
        self._names = spec.joint_names
        self._effort, self._low, self._high = spec.effort_max, spec.position_min, spec.position_max
        self._effort_body = np.where(spec.is_finger, np.inf, self._effort)
        self._least, self._most = self._low - POSITION_TOLERANCE, self._high + POSITION_TOLERANCE
        self.torques: dict[str, LimitExcess] = {}
        self.positions: dict[str, LimitExcess] = {}
        self._edge: dict[str, LimitExcess] = {}
        self.margin, self.creep = np.inf, 0.0
        self._owner = np.repeat(np.arange(len(spec.feet)), [len(foot.points) for foot in spec.feet])
        self._soles, self._stands = plant.soles()[:, :2].copy(), (True, True)
        self._support = convex_polygon(plant.contact_points()[:, :2])
        self.steps: list[StepMade] = []
        self._last: dict[int, StepMade] = {}  # of each foot that stands where a step has set it down

    def look(self, time: float, contacts: ContactSchedule | None = None) -> None:
        """Take in the control period that ended at a time [s], with these contacts; both feet stand without any."""
        if contacts is not None and (now := contacts.at(time)).stands != self._stands:
            self._set_down(now, time)
        dt, asked, q = self._plant.control_dt, self._plant.torque_asked, self._plant.joint_positions()
        # Something to note is rare: `any` takes a third of the time of looking for it.
        over = asked > self._effort_body
        for i in np.flatnonzero(over) if over.any() else ():
            _note(self.torques, self._names[i], time, dt, asked[i], self._effort[i])
        past = (q < self._least) | (q > self._most)
        for i in np.flatnonzero(past) if past.any() else ():
            bound = self._low[i] if q[i] < self._low[i] else self._high[i]
            _note(self.positions, self._names[i], time, dt, q[i], bound)
        slid = [hypot(x, y) for x, y in (self._plant.soles()[:, :2] - self._soles).tolist()]
        self.creep = max(self.creep, *(way for way, on in zip(slid, self._stands, strict=True) if on))
        force, pressure = self._plant.foot_load()
        for foot, step in self._last.items():
            step.slip = max(step.slip, slid[foot])
            if time - step.time <= LANDING:
                step.load = max(step.load, float(force))
        if force <= 0.0:
            return
        margin = self._support.margin(pressure)
        if margin < TIPPING_DISTANCE and not all(self._stands):
            # A foot that lands before its time carries.
            margin = support_of(self._plant).margin(pressure)
        self.margin = min(self.margin, margin)
        if margin < TIPPING_DISTANCE:
            _note(self._edge, "pressure", time, dt, margin, TIPPING_DISTANCE)

    def _set_down(self, contacts: Contacts, time: float) -> None:
        """Feet stand so from a time on [s]: those that did not before, where they are now."""
        stands, soles, sides = contacts.stands, self._plant.soles(), [foot.side for foot in self._plant.spec.feet]
        for foot, (before, on) in enumerate(zip(self._stands, stands, strict=True)):
            if before and not on:
                self._last.pop(foot, None)
            if on and not before:
                self._soles[foot] = soles[foot, :2]
                heading = atan2(contacts.feet.R[foot, 1, 0], contacts.feet.R[foot, 0, 0])
                self._last[foot] = StepMade(sides[foot], time, *soles[foot, :2].tolist(), heading)
                self.steps.append(self._last[foot])
        self._stands = stands
        on = np.array(stands)[self._owner]
        self._support = convex_polygon(self._plant.contact_points()[on, :2])

    @property
    def edge(self) -> LimitExcess | None:
        """The centre of pressure at the edge of the soles [m], or None."""
        return self._edge.get("pressure")


def carrying(plant: Plant) -> np.ndarray:
    """Which corners of the soles are of one that touches the floor now, shape (c,)."""
    points = plant.contact_points()
    owner = np.repeat(np.arange(len(plant.spec.feet)), [len(foot.points) for foot in plant.spec.feet])
    low = points[:, 2] < points[:, 2].min() + TOUCHES
    return np.isin(owner, owner[low])


def support_of(plant: Plant) -> SupportPolygon:
    """Hull of the soles that touch the floor now."""
    return convex_polygon(plant.contact_points()[carrying(plant), :2])


def _note(found: dict[str, LimitExcess], name: str, time: float, dt: float, value: float, bound: float) -> None:
    old = found.get(name)
    if old is None:
        found[name] = LimitExcess(time, dt, float(value), float(bound))
        return
    worse = abs(value - bound) > abs(old.worst - old.bound)
    found[name] = LimitExcess(old.first, old.seconds + dt, float(value) if worse else old.worst, old.bound)
