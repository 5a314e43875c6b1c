"""A walk, tick by tick: which feet carry, where the zero-moment point is to be, and where the other foot is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import exp, inf

from wholebody.walking.adjustment import Landing, Step, adjust
from wholebody.walking.catch import Catch
from wholebody.walking.dcm import Piece, bounded, start_for
from wholebody.walking.footsteps import LEFT, RIGHT, Footstep, base_of, box, closed
from wholebody.walking.gait import TABLE, Gait, Phase
from wholebody.walking.landings import REACTION, TIMES, landings
from wholebody.walking.places import Place
from wholebody.walking.planned_steps import PlannedSteps
from wholebody.walking.pressure import Sole, between, on
from wholebody.walking.readings import WalkReadings, rise
from wholebody.walking.swing import FROZEN, Course, Swing

PULL = 4.0
"""Rate with which the zero-moment point brings the capture point back to its plan [1/s]; chosen, no trial is on
record."""
TAKEN = 0.6
"""Share of what the stance sole can take of an error of the capture point that is left to it, before the step is
changed [no unit]; chosen: the rest is for what comes on top."""
RELIEF, RELIEVED = 0.1, 0.3
"""Time before a foot is lifted in which its share of the load goes to 0 [s], and the share from which it goes down [no
unit]; chosen: 150 N a point are more than a foot carries then."""
TAKING = 0.05
"""Time in which a foot that was set down gets all of its share [s]; chosen, no trial is on record."""
LEAST = 0.01
"""Least share of the load of a foot that stands [no unit]; chosen: 5 N a point."""
TOUCHED = 0.6
"""Share of a swing from which a foot that touches stays where it is [no unit]; measured: earlier touches are scuffs."""
LATE = 0.08
"""Time for which a foot that met nothing when it was to land goes on down at most [s]; chosen: 2 cm at the speed that
it has then."""
UNEVEN = 0.008
"""Height by which the floor under the foot that is lifted has to be lower than that under the other one for the landing
to be counted on down there [m]; chosen: a foot that meets the floor early waits, one that meets it late falls."""
SHORTEST = 0.05
"""Time in which the weight goes over to a foot that landed late, at least [s]; chosen: `TAKING`."""
WAITS, BETWEEN = 0.4, 0.015
"""Time for which both feet carry at most after a landing while the capture point, between them up to so much beside, is
brought to its plan [s, m]; measured: pushed back by 10 N s on the spot, the robot fell from a foot lifted before."""
OVER = (0.02, 0.01)
"""Time after a landing from which the other foot may be lifted before its time, and how much further over the new sole
the capture point is then than it is to be [s, m]; measured: pushed towards that sole just before it landed, the robot
fell where the pressure went over from the old sole at its own pace, 4 of 4."""
CALM = 0.025
"""Distance of the capture point from the middle of the feet, or from its plan after a shift, at which a robot may go on
[m]; by trial: a realistic robot, whose masses are not as told, stays 15 mm beside it."""
CLOSING = 0.3
"""Time in which the weight is shifted to close the feet after a step that caught the robot [s]; measured: in 0.6 s the
centre of mass goes so far from a foot 0.45 m away that its leg, or the roll of its ankle, is at its end."""
PATIENCE, CALM_ENOUGH = 3.0, 0.04
"""Time that a robot takes to come to rest after its last step [s], after which it goes on from as far beside the middle
of the feet [m]; chosen: what is pushed on keeps beside it for ever, and 4 cm are well inside of two soles."""


class Walk(PlannedSteps):
    """The gait of a robot: steps as planned, and their places and times as its capture point asks for.

    Attributes:
        load: Share of its bounds that each foot carries, left first.
        swing: The foot that is up, or None.
        pressure: Where the zero-moment point is to be now, ``x + iy`` [m].
        apart: Whether the feet stay where a step that caught the robot has left them, since its torso leans.
        closes: Whether it closes feet that a step which caught the robot left further apart than any that is planned.
        made: Number of steps made.
        adjusted: How far the last step is moved from its plan [m].
        slope: By how much the floor of the step rises along world's axes, ``x + iy`` [m/m].
    """

    def __init__(self, seen: WalkReadings, sole: Sole, gait: Gait | None = None) -> None:
        super().__init__(seen.soles, gait or Gait())
        self._sole, self.load, self.swing, self.made, self.adjusted = sole, (1.0, 1.0), None, 0, 0.0
        self.pressure = self.plan
        self._elapsed, self._floor, self.slope, self.closes, self.apart = 0.0, 0.0, 0j, False, False

    @property
    def wanted(self) -> bool:
        """Whether there is a step to make."""
        if self.marches or not self.guide.rests:
            return True
        return not self.apart and not closed(self.soles, self.guide.place, self.width)

    @property
    def stands_on(self) -> list[Place]:
        """Soles, left first, one that is up where it is to land."""
        if self.state is not Phase.SWING:
            return self.soles
        return [self._steps[0].sole if foot == 1 - self.stance else self.soles[foot] for foot in (LEFT, RIGHT)]

    @property
    def left(self) -> float:
        """Time until the state is over [s]."""
        return self._left

    def advance(self, seen: WalkReadings, dt: float) -> None:
        """Go on by a period [s]."""
        self.guide.come(dt)
        going = self.state in (Phase.SWING, Phase.LAND, Phase.RECOVER)
        if going or (self.state is Phase.SETTLE and self._comes_to_rest()):
            self.guide.advance(dt)
        self._plan_anew(seen)
        if self._over(seen):
            if self.state is Phase.RECOVER:
                far = abs(self.soles[LEFT].point - self.soles[RIGHT].point) > self.gait.apart
                self.caught, self.apart, self.closes = False, seen.leans, far and not seen.leans
                self.gait = replace(self.gait, shift=CLOSING) if self.closes else self._usual
            self._enter(self._following(), seen)
        self._elapsed += dt
        self._left -= dt
        self._nominal_left -= dt
        if self.state is Phase.SWING:
            self._adjust(seen)
        self._follow_plan(seen, dt)
        self._share_load(self._may_leave(seen))
        if self.swing is not None:
            self._swing_on(seen, dt)

    def _swing_on(self, seen: WalkReadings, dt: float) -> None:
        """The foot that is up goes on; one that meets something on its way down stays there until it does no more."""
        foot, goal = 1 - self.stance, self._steps[0].sole
        done = min(self._elapsed / (self._elapsed + max(self._left, dt)), 1.0)
        if done >= TOUCHED and seen.touching is not None and seen.touching[foot]:
            self.swing = Swing.from_rest(seen.soles[foot], seen.heights[foot], self.swing.lean.x)
            return
        floor = self._floor + rise(self.slope, goal.point - self.soles[self.stance].point)
        self.swing = self.swing.advance(goal, floor, self.gait.lift, done, self._left, dt, self.slope)

    def _comes_to_rest(self) -> bool:
        """Whether the base stops while the robot settles, as its last step counted on."""
        return not self.guide.rests and self.guide.foresee([self._left])[0][1]

    def catch(self, seen: WalkReadings, step: Catch) -> None:
        """Catch the robot with a step, from both feet, at once."""
        self.gait, self.caught, self._first, self.soles = step.gait, True, step.foot, list(seen.soles)
        self.closes, self.plan = False, seen.dcm
        self._enter(Phase.SHIFT, seen)

    def _over(self, seen: WalkReadings) -> bool:
        """Whether the state ends now."""
        if self.state is Phase.STAND:
            return self.wanted
        if self._left > 0.0:
            return self.state is Phase.LAND and self._is_over_early(seen)
        if self.state is Phase.SWING and seen.touching is not None:
            return seen.touching[1 - self.stance] or self._left <= -LATE
        if TABLE[self.state].rests:
            there = self.guide.rests or self.state is not Phase.RECOVER
            calm = CALM if self._elapsed < PATIENCE else CALM_ENOUGH
            return there and abs(seen.dcm - self._middle()) < calm
        waits = WAITS if self.state is Phase.LAND else 2.0 * self.gait.shift
        return self.caught or self.closes or self._elapsed >= waits or self._may_leave(seen)

    def _is_over_early(self, seen: WalkReadings) -> bool:
        """Whether the capture point is over the new sole before its time: that one alone holds it best there."""
        if self.caught or self._elapsed < OVER[0]:
            return False
        stance, out = self.soles[self.stance], 1.0 if self.stance == LEFT else -1.0
        further = stance.seen(seen.dcm) - stance.seen(bounded(self._pieces()[1:], seen.omega))
        return out * further.imag > OVER[1]

    def _may_leave(self, seen: WalkReadings) -> bool:
        """Whether a foot may be lifted: not while the pressure of both is to bring the capture point to its plan."""
        off = abs(seen.dcm - self.dcm)
        if self.state is Phase.LAND:
            return off < CALM_ENOUGH or abs(between(self.soles, self._sole, seen.dcm) - seen.dcm) > BETWEEN
        return self.state is not Phase.SHIFT or self.closes or off < CALM

    def _following(self) -> Phase:
        row = TABLE[self.state]
        if self.state is Phase.SWING:
            return Phase.RECOVER if self.caught else row.then if len(self._steps) > 1 else row.done
        going = self.wanted or (self.caught and self.state is Phase.SHIFT)
        return row.then if going else row.done

    def _enter(self, state: Phase, seen: WalkReadings) -> None:
        """Go over into a state."""
        before = self.state
        if state in (Phase.SHIFT, Phase.LAND) and not self.caught and not self.closes:
            self.gait = self._quick()
        gait, late = self.gait, max(-self._left, 0.0) if before is Phase.SWING else 0.0
        self.state, self._elapsed, self._left = state, 0.0, getattr(gait, TABLE[state].lasts or "settle")
        self._left = max(self._left - late, min(self._left, SHORTEST))
        if before is Phase.SWING:
            self._set_down(seen)
        if state is Phase.SHIFT:
            self.soles = list(seen.soles)
            first = self._first if self.caught else self._first_foot()
            self.stance = 1 - first
            self._plan_steps(first, gait.swing, seen)  # the base rests while the weight is shifted
            if self.caught:
                self._steps = [Footstep(first, self.soles[first])]
            rest = self._pieces()[1:]
            piece = Piece(self._left, 0j, self.soles[self.stance].point)
            self.plan = start_for(seen.dcm, piece, bounded(rest, seen.omega), seen.omega)
        elif state is Phase.LAND:
            self.stance = 1 - self.stance
            self._plan_steps(1 - self.stance, self._left + gait.swing, seen)
        elif state is Phase.SWING:
            # The steps are those of the shift of weight before: the capture point has been led there.
            foot = 1 - self.stance
            self._nominal_left, self._nominal = self._left, self._steps[0].sole
            self.swing = Swing.from_rest(self.soles[foot], seen.heights[foot], seen.tilts[foot])
            self._floor, self.slope = seen.heights[self.stance], seen.slope
            lower = seen.heights[foot] - rise(seen.slope, self.soles[foot].point - self.soles[self.stance].point)
            if self._floor - lower > UNEVEN:
                self._floor = lower
            if self.caught:  # the base comes after the steps before, which have left no time to
                self.guide.go_to(base_of(self.soles))
        elif state is Phase.RECOVER:
            self.guide.go_to(base_of(self.soles))
            middle = self._middle()
            self.plan = start_for(seen.dcm, Piece(self._left, 0j, middle), middle, seen.omega)
        elif state is Phase.STAND:
            self.gait, self.closes, self._steps = self._usual, False, []

    def _first_foot(self) -> int:
        """The foot to begin with: the one on the side to which the base goes, the one behind of a base that rests."""
        velocity = self.guide.aim()
        if velocity.is_rest:
            left, right = (self.guide.place.seen(sole.point).real for sole in self.soles)
            return LEFT if left < right else RIGHT
        side = velocity.way.imag + 0.1 * velocity.turn
        return LEFT if side > 0.0 else RIGHT

    def _set_down(self, seen: WalkReadings) -> None:
        """The foot that was up stands where it is."""
        foot, self.swing = 1 - self.stance, None
        self.soles[foot] = seen.soles[foot]
        self.made += 1
        if not self.caught:
            self.guide.come_after(seen.soles[foot].point - self._nominal.point)

    def _adjust(self, seen: WalkReadings) -> None:
        """Move the landing to where and when the capture point asks for it."""
        self.plan = self.soles[self.stance].point
        if self._left <= FROZEN:
            return
        gait, foot, omega, axes = self.gait, 1 - self.stance, seen.omega, self.soles[self.stance]
        nominal, kept = self._nominal, self._left
        self._left, self._steps[0] = max(self._nominal_left, FROZEN), Footstep(foot, nominal)
        pieces = self._pieces()
        planned, end = (axes.seen(bounded(part, omega)) for part in (pieces, pieces[1:]))
        gone = exp(-omega * gait.double)
        share = (1.0 - gone) / (omega * gait.double)
        place, error = axes.seen(nominal.point), axes.seen(seen.dcm) - planned
        take = TAKEN * (1.0 - exp(-omega * self._left))
        felt = planned + complex(
            _beyond(error.real, take * self._sole.length), _beyond(error.imag, take * self._sole.width)
        )
        step = Step(place, self._left, (end - share * place) / gone)
        best = adjust(felt, step, self._landings(omega, self._left, kept), omega, gait.double)
        self._left = best.time if abs(best.time - kept) > 1e-9 else kept
        self._steps[0] = Footstep(foot, Place(axes.world(best.place), nominal.heading))
        self.adjusted = abs(best.place - place)

    def _landings(self, omega: float, *first: float) -> Iterator[Landing]:
        """Landings of the foot that is up, from the stance sole, at some times [s] before all others."""
        gait, axes, way = self.gait, self.soles[self.stance], self.swing.way
        soonest = max(gait.sooner * gait.swing - self._elapsed, FROZEN)
        latest = max(gait.later * gait.swing - self._elapsed, soonest)
        others = (soonest + k * (latest - soonest) / TIMES for k in range(TIMES + 1))
        times = (min(max(time, soonest), latest) for time in (*first, *others))
        seen = Course(axes.seen(way.x), *(axes.seen(axes.point + rate) for rate in (way.v, way.a)))
        corners = box(1 - self.stance, gait, gait.wide)
        reaction, most = (REACTION, inf) if self.caught else (0.0, first[-1])
        return landings(seen, corners, times, omega, reaction, most)

    def _follow_plan(self, seen: WalkReadings, dt: float) -> None:
        """Zero-moment point for this tick."""
        pieces = self._pieces()
        self.dcm = bounded(pieces, seen.omega)
        if self.state in (Phase.SHIFT, Phase.LAND) and self._left <= 0.0:
            self.plan = self.dcm
        wanted = self.plan + (1.0 + PULL / seen.omega) * (seen.dcm - self.dcm)
        if self.state is Phase.SWING:
            self.pressure = on(self.soles[self.stance], self._sole, wanted)
        else:
            self.pressure = between(self.soles, self._sole, wanted)
        if self.state is not Phase.SWING:
            self.plan = pieces[0].left(dt).start

    def _share_load(self, ready: bool) -> None:
        """Share of the load that each foot may have; none is relieved before the capture point is where it is to be."""
        load = [1.0, 1.0]
        if self.state is Phase.SWING:
            load[1 - self.stance] = 0.0
        elif self.state in (Phase.SHIFT, Phase.LAND) and self._left < RELIEF and ready:
            load[1 - self.stance] = max(RELIEVED * self._left / RELIEF, LEAST)
        if self.state is Phase.LAND and self._elapsed < TAKING:
            load[self.stance] = max(self._elapsed / TAKING, LEAST)
        self.load = tuple(load)


def _beyond(error: float, taken: float) -> float:
    """What of an error is left where so much of it is taken."""
    return max(error - taken, 0.0) + min(error + taken, 0.0)
