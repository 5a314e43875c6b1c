"""The steps of a walk that are planned: where they go, how quick they are, and how they lead the capture point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from wholebody.walking.dcm import Piece, bounded
from wholebody.walking.footsteps import LEFT, RIGHT, Footstep, base_of, footsteps
from wholebody.walking.gait import Gait, Phase
from wholebody.walking.guide import Guide
from wholebody.walking.places import Place
from wholebody.walking.readings import WalkReadings

KEPT = 0.25
"""Time before a landing from which its place is not planned anew [s]; chosen: the foot is on its way there."""
EASY = 0.01
"""Distance by which the capture point may be further from a plan than from the nearest one, and is as good as led to
it [m]; measured: stopped in mid-step whatever the distance, the robot landed with up to 1240 N, one step on."""
SLOWER = 1.2
"""Time of a step over that of the one before at most [no unit]; measured: stopped from 0.2 m/s aside, 3 of 6 realistic
robots fell where quick steps were followed by usual ones at once."""
COUNT = 4
"""Steps that are planned [no unit]; derived: what comes later changes the capture point now by less than 0.1 mm."""
SPARE = 0.02
"""Distance of the soles beyond the least one that steps aside leave on their narrow side [m]; chosen: room to move."""
CAUGHT = 0.8
"""Share of the way from the stance sole to the one that catches the robot at which its capture point is to be when that
lands [no unit]; chosen: between the soles of a long step there is little room beside the line from one to the other."""


class PlannedSteps:
    """Steps beside a base that may be told something else at any time, on feet that begin where they are.

    Attributes:
        gait: Times and lengths of the steps that are made now.
        state: Of the gait's table.
        guide: The base.
        soles: Where both stand, or are to be set down, left first.
        stance: The foot that carries, or is to.
        plan, dcm: Where the zero-moment point and the capture point are by the plan [m].
        caught: Whether the step that is being made, or was made last, is to catch the robot.
        marches: Whether it steps on although its base rests.
    """

    def __init__(self, soles: Sequence[Place], gait: Gait) -> None:
        self.gait, self._usual, self.guide = gait, gait, Guide(base_of(soles))
        self.state, self.soles, self.stance = Phase.STAND, list(soles), LEFT
        self.width = abs(soles[LEFT].point - soles[RIGHT].point)
        self.plan = self.dcm = self.guide.place.point
        self.caught = self.marches = False
        self._left = self._nominal_left = 0.0
        self._steps: list[Footstep] = []
        self._nominal, self._told = soles[LEFT], self.guide.told

    def _aside(self) -> float:
        """Speed to the side with which steps are to count [m/s]."""
        guide = self.guide
        return max(abs(guide.aim().way.imag), abs(guide.velocity.way.imag))

    def _quick(self) -> Gait:
        """The gait whose steps are so quick that the soles come no further apart on the way aside than is planned."""
        gait = self._usual
        room, way = gait.apart - gait.narrow - SPARE, 2.0 * self._aside() * gait.step
        share = room / way if way > room else 1.0
        if self.state is Phase.SWING:  # a step was made just now
            share = min(share, SLOWER * self.gait.swing / gait.swing)
        return replace(gait, swing=share * gait.swing, double=share * gait.double)

    def _plan_anew(self, seen: WalkReadings) -> None:
        """Plan the steps anew where the base is told something else, if the capture point is as good as led to that."""
        if self.caught or self.state not in (Phase.SWING, Phase.LAND) or self._told == self.guide.told:
            return
        before, left = self._steps, self._left + self.gait.swing
        if self.state is Phase.SWING:
            left = self._nominal_left
            if left <= KEPT:
                return
        if self._plan_steps(1 - self.stance, left, seen) > abs(seen.dcm - self.dcm) + EASY:
            self._steps = before
        else:
            self._nominal = self._steps[0].sole

    def _plan_steps(self, first: int, start: float, seen: WalkReadings) -> float:
        """Plan the fewest steps to which the capture point is as good as led; how far from that plan it is [m]."""
        gait, guide, plans = self.gait, self.guide, []
        self._told = guide.told
        width = max(self.width, gait.narrow + SPARE + self._aside() * gait.step)
        for least in (COUNT,) if self.marches else range(1, COUNT + 1):
            settings = {"start": start, "least": least, "most": COUNT}
            self._steps = footsteps(self.soles, first, guide, width, gait, **settings)
            off = 0.0 if self.state is Phase.SHIFT else abs(seen.dcm - bounded(self._pieces(), seen.omega))
            plans.append((off, self._steps))
            if off <= EASY or len(self._steps) == COUNT:
                break
        nearest = min(off for off, _ in plans)
        off, self._steps = next(plan for plan in plans if plan[0] <= nearest + EASY)
        return off

    def _middle(self) -> complex:
        return 0.5 * (self.soles[LEFT].point + self.soles[RIGHT].point)

    def _pieces(self) -> list[Piece]:
        """What the zero-moment point does from now on."""
        gait, left = self.gait, max(self._left, 0.0)
        if self.state not in (Phase.SHIFT, Phase.SWING, Phase.LAND):
            return [Piece(left, self.plan, self._middle())]
        carry = self.soles[self.stance].point
        pieces = [Piece(left, self.plan, carry)]
        if self.state is not Phase.SWING:
            pieces.append(Piece(gait.swing, carry, carry))
        for step in self._steps[:-1]:
            new = step.sole.point
            pieces += [Piece(gait.double, carry, new), Piece(gait.swing, new, new)]
            carry = new
        if self.caught:
            last = carry + CAUGHT * (self._steps[-1].sole.point - carry)
            return [*pieces, Piece(gait.settle, last, last)]
        end = 0.5 * (carry + self._steps[-1].sole.point)
        return [*pieces, Piece(gait.settle, carry, end)]
