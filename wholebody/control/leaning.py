"""How a robot leans against forces on its hands, and how far these move the centre of pressure."""

from __future__ import annotations

from math import exp, hypot

import numpy as np
import pinocchio as pin

from wholebody.control.asked_forces import AskedForces
from wholebody.control.base import Controller
from wholebody.robot.touch import FORCE, LEAN_MAX, MOMENT, PUSH_MAX, SHARE

GRAVITY = 9.81
"""Acceleration of free fall [m/s^2]; definition."""
TIPPED_TIME = 0.1
"""Of the filter of how far forces move the centre of pressure [s]; chosen: the trunk is too heavy for faster ones."""
TIPPED_MAX = 0.08 + LEAN_MAX
"""Farthest that a force is taken to move the centre of pressure [m]; derived: from the middle of a sole to its edge,
and as far as the body leans."""
LEAN_TIME = 0.5
"""Time constant with which the body is told to lean further until it does lean as far as it is to [s]; chosen: the rest
of its posture holds it back, and a trunk takes 0.3 s."""
ROOM_MIN = 0.02
"""Least distance of the centre of mass from an edge that is counted on [m]; chosen: a quarter of a sole's half."""
UNFELT = 0.02
"""Distance by which something that no hand feels has to move the centre of pressure for the body to lean against it, by
what is beyond [m]; measured: masses and sensors of realistic robots feign 0.014 in the lissajous."""
LASTING = 0.6
"""Time for which it has to [s]; chosen: a push of 0.1 s is felt for half a second, and a load is known by then."""
LEAN_SHARE = 0.5
"""Share of the way to the edge of the support on the other side that the centre of mass is leant at most [no unit];
chosen: if the force is gone at once the body is still far enough from it."""
BRACED = 9.0
"""How many times more its place weighs where a force takes the centre of pressure to the edge [no unit]; measured: as
light as a hand, it was held half of the way back by hands and waist, and pulls of 1.15 times what statics allow took a
robot down (`tests.studies.touch pulls --first 26 --cases 3`)."""
WAIST_MAX, WAIST_ROOM = 0.95, 0.2
"""Share of its torque that the waist uses from which the body leans no further against that, and over how much of it it
comes to this [no unit]; derived: the share that motors are asked for, and chosen: a lean of 40 mm takes as much."""
EARLY = 0.5
"""Share of the lean against a force that is told before it is felt [no unit]; chosen: it may not come."""


class Leaning:
    """Leans the body against what its hands feel, away from the edges of the support that this brings near.

    Args:
        controller: Whose `lean`, `braced` and `tipped` are set.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self.reset()

    def reset(self) -> None:
        """Nothing is felt."""
        self._moved, self._counted, self._unfelt, self._further, self._lasted = *np.zeros((3, 2)), 0.0, 0.0
        controller = self._controller
        controller.lean[:] = controller.tipped[:] = controller.braced[:] = 0.0

    @property
    def settled(self) -> bool:
        """Whether nothing has been felt for long."""
        return max(hypot(*self._moved), hypot(*self._counted)) < 1e-4 and not self.unfelt

    @property
    def unfelt(self) -> bool:
        """Whether the body leans against something that no hand feels."""
        return self._lasted > LASTING

    @property
    def share(self) -> float:
        """How far the body is told to lean, a share of the farthest that it is to, from 0 to 1."""
        return min(hypot(*self._controller.lean) / LEAN_MAX, 1.0)

    def feel(self, wrench: np.ndarray, felt: np.ndarray, spent: float, elapsed: float) -> None:
        """Take in what pushes the whole robot, of which hands feel a part, or nothing.

        Args:
            wrench: Force [N] and moment about the world's origin [N m], shape (6,).
            felt: Force and moment on each palm that its arm feels, shape (2, 6), as late as `wrench` is.
            spent: Share of its torque that the waist uses: a body that leans from hands that stay bends.
            elapsed: Time since the last time [s].
        """
        palms, weight = self._controller.palm_positions(), GRAVITY * self._controller.robot.mass
        rest = wrench[3:] - felt[:, 3:].sum(axis=0)
        for palm, force in zip(palms, felt[:, :3], strict=True):
            rest -= pin.skew(palm) @ force
        moved = np.array([rest[1], -rest[0]]) / weight
        beyond = max(1.0 - UNFELT / max(hypot(*moved), 1e-9), 0.0)
        lasted = self._lasted + (elapsed if beyond > 0.0 else -elapsed)
        self._lasted = min(max(lasted, 0.0), 2.0 * LASTING)
        room = min(max((WAIST_MAX - spent) / WAIST_ROOM, 0.0), 1.0)
        self._unfelt = room * beyond * moved * self.unfelt

    def advance(self, rows: np.ndarray, asked: AskedForces, planned: np.ndarray, drawn: float, elapsed: float) -> None:
        """Take in what is felt now.

        Args:
            rows: What both hands feel, as in `wholebody.robot.touch`, shape (2, TOUCH).
            asked: Forces that chunks expect on the palms: before a hand feels its own, the body leans half of the way;
                and those that the plan counts on: it leans against them by itself.
            planned: Where the plan has the centre of mass, shape (2,), [m].
            drawn: Whether a hand is led away, from 0 to 1: a surface that stays pushes no harder than the hand.
            elapsed: Time since the last tick [s].
        """
        controller = self._controller
        com, palms, weight = controller.robot.com, controller.palm_positions(), GRAVITY * controller.robot.mass
        f, m = rows[:, FORCE:MOMENT], rows[:, MOMENT:PUSH_MAX].sum(axis=0)
        f = f + EARLY * (1.0 - rows[:, SHARE : SHARE + 1]) * asked.forces
        lift = min(f[0, 2] + f[1, 2], 0.5 * weight)
        moved, counts = (
            (palms[:, 2:] * x[:, :2] - x[:, 2:] * (palms[:, :2] - com[:2])).sum(axis=0) for x in (f, asked.counted)
        )
        moved = (moved + np.array([m[1], -m[0]])) / (weight - lift) + self._unfelt
        keep = exp(-elapsed / TIPPED_TIME)
        self._moved = keep * self._moved + (1.0 - keep) * moved
        self._counted = keep * self._counted + (1.0 - keep) * counts / (weight - lift)
        controller.tipped[:] = self._moved * min(1.0, TIPPED_MAX / max(hypot(*self._moved), 1e-9))
        wanted, edge = self._wanted(planned)
        unfelt = min(max(self._lasted / LASTING - 1.0, 0.0), 1.0)
        controller.braced[:] = BRACED * edge * max(drawn, unfelt)
        self._lean(wanted, com[:2] - planned, elapsed)

    def _wanted(self, planned: np.ndarray) -> tuple[np.ndarray, float]:
        """How far the centre of mass is to lean, shape (2,), [m], and how near the force brings an edge, from 0 to 1.

        Away from the edge that the force brings nearest, and along that edge, by a share of how far it moves the centre
        of pressure that is the share of the way to the edge. So a foot does not lose all of its load: what is drawn
        aside also turns, and one sole alone does not hold that.
        """
        support, rest, away, edge = self._controller.support, self._moved - self._counted, np.zeros(2), 0.0
        room = np.maximum(support.offsets - support.normals @ (planned + self._counted), ROOM_MIN)
        for _ in range(2):
            shares = support.normals @ rest / room
            nearest = int(shares.argmax())
            n, share = support.normals[nearest], min(float(shares[nearest]), 1.0)
            towards, other = float(n @ rest), LEAN_SHARE / float(np.max(-(support.normals @ n) / room))
            away -= min(share * towards, other) * n
            rest, edge = rest - towards * n, max(edge, share)
        return away, edge

    def _lean(self, wanted: np.ndarray, leant: np.ndarray, elapsed: float) -> None:
        """Have the centre of mass lean by so much (2,), told up to twice of it as long as it leans by less, (2,)."""
        size = max(float(wanted @ wanted), 1e-9)
        more = self._further + elapsed / LEAN_TIME * (1.0 - float(leant @ wanted) / size)
        self._further = min(max(more, 0.0), 1.0)
        self._controller.lean[:] = (1.0 + self._further) * wanted
