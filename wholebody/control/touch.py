"""Hands that touch: found from the torques of the arms, bounded in force, and never a reason to leave the plan."""

from __future__ import annotations

from math import exp, sqrt

import numpy as np

from policy.chunk import ActionChunk
from wholebody.config.touch import TouchConfig
from wholebody.control.asked_forces import AskedForces
from wholebody.control.base import Controller
from wholebody.control.leaning import GRAVITY, Leaning
from wholebody.control.own_forces import OwnForces
from wholebody.control.reference_packet import COM, PALM
from wholebody.estimation.body_push import EVERY, TIME_CONSTANT, BodyPush
from wholebody.estimation.load import LoadObserver
from wholebody.reference.surface import Surface, turned
from wholebody.robot.kernels.frames import PALM_FRAME
from wholebody.robot.touch import (
    AXIS_MAX,
    FORCE,
    HEADING,
    MOBILITY,
    MOMENT,
    PUSH_MAX,
    SHARE,
    TOLD_SHARE,
    arm_force,
    stretched,
    tipping_share,
)
from wholebody.types import Reason, RobotState, Status, StatusReport

RELEASED = 0.5
"""Share of the force from which a hand counts as touching below which it no longer does [no unit]; chosen: half."""
BEGIN, END = 0.01, 0.1
"""Times over which a hand becomes one that touches, and a free one again [s]; chosen: a stiff hand pushes hard within
10 ms, and one that is let go of is not to jump."""
FOLLOWING = Status.TRACKING, Status.SLOWED
"""What the supervisor does while it follows a chunk."""
INTO = 0.05
"""How far past a surface plans lead a palm [m]; chosen: with its stiffness, 30 N."""
MOVING, NORMAL_TIME, REST_TIME, FIRST_TIME = 0.02, 0.02, 0.06, 0.2
"""Speed of a palm from which it slides along what it touches [m/s]; time constants of its velocity and of the surface's
normal, and of that where it does not slide, and how long it is then looked for [s]; chosen: below, nothing tells
friction from pressure, and the first impact says little of the direction."""
HELD_BACK, STOPPED = 0.015, 0.05
"""Distance by which a palm is short of its command along its push [m], and speed along it [m/s], from which it is held
back; chosen: friction that is taken for a touch feigns no more."""
LED, PULLED, PULLED_END = 0.02, 0.06, 0.12
"""Distance against its push, from where it began to touch, from which a hand is led away, resists more than it may
push, and yields no more [m]; chosen: surfaces that stay lead no hand, and further away the body would go along."""
GONE_ON = 0.01
"""Distance along its push from where it last felt something within which a hand that was held back has left nothing
[m]; measured: led by its place at once, far short of it, realistic hands hit a wall again 15 times a second, with up to
167 N, and 1 of 200 robots fell."""
SLIDES = 0.7
"""Cosine of the angle between a push and the motion below which a palm slides [no unit]; chosen: friction of 1 is at
0.71, and one that runs into something goes along its push."""
UNTOLD_SHARE = 0.5
"""Share of the force that its arm has with which a hand pushes that is not told to [no unit]; measured: with all of it,
a realistic robot fell that pressed a table with both hands."""
BELIEVED = 150.0
"""Largest force on a palm that the program counts on [N]; chosen: twice what tips the robot."""
FORGIVEN = 0.06
"""Largest distance by which a palm that touches may be short of where it is commanded along its push [m]; chosen: past
it the body has gone where the hands cannot follow."""


class Touch:
    """What the hands touch, and how they push: the impedance that `wholebody.tasks.hand` follows.

    The force with which a hand pushes is bounded by a share of the one that would tip the robot
    (`wholebody.robot.touch.tipping_share`), and by what its arm has.

    Args:
        controller: Of the robot on its feet.
        config: Settings.
        observer: Sees the forces; without one nothing is found.

    Attributes:
        shares: How far the left and the right hand touches, 0 to 1.
        since: When each began to touch [s]; NaN while it does not.
        told: What chunks say of it.
        changed: Whether a hand is held back by something that the last plan did not know.
    """

    def __init__(self, controller: Controller, config: TouchConfig, observer: LoadObserver | None) -> None:
        self._controller, self._config, self._observer = controller, config, observer
        self._rows, robot, self.asked = controller.touch, controller.robot, AskedForces(config, controller.touch)
        self._leaning, self._body = Leaning(controller), BodyPush(robot)
        joints = [robot.joint_indices(robot.arm_joints(tool.side)) for tool in robot.spec.tools]
        self._arms = [6 + arm for arm in joints]
        elbow = robot.spec.parts("elbow")[robot.motor_to_pin]
        self._ends = [(1 + arm[0], 1 + arm[elbow[arm]][0]) for arm in joints]
        """Bodies of shoulder and elbow."""
        self._waist = np.flatnonzero(np.isin(robot.motor_to_pin, robot.spec.limbs["waist"]))
        self._own = OwnForces(controller, joints)
        self._torques = [robot.spec.effort_max[robot.motor_to_pin][arm] for arm in joints]
        self.reset()

    def reset(self) -> None:
        """Nothing is touched."""
        self._rows[:] = 0.0
        self._rows[:, MOBILITY] = 1.0 / self._config.mass
        self.shares, self.since = [0.0, 0.0], [float("nan")] * 2
        self._settled, self.changed, self._held = True, False, [False, False]
        self._leaning.reset()
        self._body.reset()
        self.asked.reset()
        self._into, self._palms, self._velocity, self._met, self._felt_at = np.zeros((5, 2, 3))
        self._felt, self._drawn = np.zeros((2, 6)), [0.0, 0.0]

    @property
    def forces(self) -> np.ndarray:
        """Force on each palm in world axes, shape (2, 3), [N]; zeros while it does not touch."""
        return self._rows[:, FORCE : FORCE + 3]

    @property
    def active(self) -> bool:
        """Whether a hand touches, or did a moment ago."""
        return not self._settled

    def feel(self, state: RobotState, follows: bool = True) -> None:
        """Take in what pushes the whole robot, of which hands may feel little; nothing where it follows no plan."""
        if self._observer is not None and self._body.look(state):
            keep, shares = exp(-EVERY / TIME_CONSTANT), np.array(self.shares)
            self._felt = keep * self._felt + (1.0 - keep) * shares[:, None] * self._observer.wrenches
            spent = (np.abs(state.tau) / self._controller.effort_max)[self._waist].max(initial=0.0)
            self._leaning.feel(follows * self._body.wrench, follows * self._felt, float(spent), EVERY)

    def look(self, row: np.ndarray, now: float, elapsed: float, follows: bool = True) -> None:
        """Take in what the observer saw of the last state.

        Args:
            row: Packed reference of the last tick.
            now: Present time [s].
            elapsed: Time since the last tick [s].
            follows: Whether the robot follows a plan: off any, hands are let go of and whirl, and no touch begins. Nor
                does one of an arm with a joint at the end of its range, whose stop pushes it.
        """
        observer, found = self._observer, self._config.force_found
        if observer is None:
            return
        left, right = observer.sizes
        self.asked.listen(now)
        if self.asked.by_axis:
            self.asked.turn(self._controller.contacts.feet.heading)
        calm = self._settled and not self._leaning.unfelt
        if self.asked.chunk is None and calm and left < found and right < found:
            return
        palms = self._controller.palm_positions()
        if self._settled or elapsed <= 0.0:
            self._palms, self._velocity[:] = palms, 0.0
        else:
            keep = exp(-elapsed / NORMAL_TIME)
            self._velocity = keep * self._velocity + (1.0 - keep) * (palms - self._palms) / elapsed
            self._palms = palms
        for hand, size in enumerate((left, right)):
            begins = self.shares[hand] == 0.0
            own = begins and (not follows or (size > found and self._own.at_stop(hand)))
            own |= size > found and self._own.on(hand)
            self._advance(hand, 0.0 if own else size, now, elapsed)
        self._count_on(observer.wrenches)
        self._leaning.advance(self._rows, self.asked, row[COM : COM + 2], max(self._drawn), elapsed)
        for hand in range(2):
            if self.shares[hand] > 0.0:
                self._find_normal(hand, now, elapsed)
                self._bound(hand, palms, row, elapsed)
            else:
                self.asked.free(hand)
                self._drawn[hand] = 0.0
            self._hold(hand, row)
        self._settled = max(self.shares) == 0.0 and self._leaning.settled and not self.asked.told
        if self._settled:
            self._leaning.reset()

    def expect(self, chunk: ActionChunk) -> None:
        """Count from now on on the forces, limits and stiffnesses of a chunk; on none if it has none."""
        self.asked.expect(chunk)

    def _advance(self, hand: int, size: float, now: float, elapsed: float) -> None:
        """Begin or end a touch by how hard a palm is pushed [N]."""
        share, touches = self.shares[hand], self.since[hand] == self.since[hand]
        if size > self._config.force_found:
            if not touches:
                self.since[hand], self._met[hand] = now, self._palms[hand]
            self._felt_at[hand] = self._palms[hand]
            share += elapsed / BEGIN
        elif size < RELEASED * self._config.force_found and not self._rebounds(hand):
            share -= elapsed / END
        share = min(max(share, 0.0), 1.0)
        if share == 0.0:
            self.since[hand], self._into[hand] = float("nan"), 0.0
        self.shares[hand] = self._rows[hand, SHARE] = share

    def _rebounds(self, hand: int) -> bool:
        """Whether a palm that feels nothing is at what held it back still: it comes back to that as softly."""
        return self._held[hand] and self._into[hand].dot(self._palms[hand] - self._felt_at[hand]) < GONE_ON

    def _count_on(self, wrenches: np.ndarray) -> None:
        """Tell the program of forces and moments (2, 6)."""
        sizes = np.linalg.norm(wrenches[:, :3], axis=1)
        believed = np.array(self.shares) * BELIEVED / np.maximum(sizes, BELIEVED)
        self._rows[:, FORCE:PUSH_MAX] = wrenches * believed[:, None]

    def _find_normal(self, hand: int, now: float, elapsed: float) -> None:
        """Direction into what a hand touches: that of its push, without friction, which is along its motion.

        Of a hand at rest friction is not known: after the first moment its direction stays, unless it pushes quite
        another way. Plans lead a hand by it, and would follow the friction that they make.
        """
        push, into, v = -self.forces[hand], self._into[hand], self._velocity[hand]
        size, speed, along = sqrt(push.dot(push)), sqrt(v.dot(v)), push.dot(v)
        if speed > MOVING and abs(along) < SLIDES * size * speed:
            push -= along / speed**2 * v
            time = NORMAL_TIME
        elif now - self.since[hand] < FIRST_TIME or push.dot(into) < SLIDES * size:
            time = REST_TIME
        else:
            return
        into[:] = turned(into, push, exp(-elapsed / time))

    def _hold(self, hand: int, row: np.ndarray) -> None:
        """Notice that a hand is held back: short of where it is commanded along its push, and at rest along that.

        One that is led away from where it was, as by a load that it sinks under, meets no surface that a plan could
        keep it out of.
        """
        at, into, palm = PALM * hand, self._into[hand], self._palms[hand]
        short = into.dot(row[at + 9 : at + 12] - palm)
        stays = into.dot(self._met[hand] - palm) < HELD_BACK
        rests = self.shares[hand] > 0.5 and short > HELD_BACK and abs(into.dot(self._velocity[hand])) < STOPPED
        self.changed |= stays and rests and not self._held[hand]
        self._held[hand] = stays and (rests or (self._held[hand] and self.shares[hand] > 0.0 and short > 0.0))

    @property
    def leaning(self) -> float:
        """How far the body leans against what it touches, a share of the farthest, from 0 to 1."""
        return self._leaning.share

    def met(self) -> tuple[Surface | None, Surface | None]:
        """What a plan that is asked for now is not to lead the hands into."""
        self.changed = False
        left, right = (
            Surface(palm + INTO * into, into.copy()) if held else None
            for held, palm, into in zip(self._held, self._palms, self._into, strict=True)
        )
        return left, right

    def _bound(self, hand: int, palms: np.ndarray, row: np.ndarray, elapsed: float) -> None:
        """Largest acceleration with which a hand pushes towards where it is commanded to be.

        A hand that is led away resists with up to what draws it, past the limits on what it may push: it cannot yield.
        """
        at, config, own = PALM * hand, self._config, self._rows[hand]
        push = self.asked.spring(hand, row[at + 9 : at + 12] - palms[hand])
        push += self._controller.palms[hand].kd * row[at + 12 : at + 15] + row[at + 18 : at + 21]
        if (told := self.asked.size(hand)) > 0.0:
            along = self.asked.forces[hand].dot(self._velocity[hand]) / told
            rests = self.shares[hand] == 1.0 and abs(along) < MOVING
            push = self.asked.make_up(hand, row[at + 9 : at + 12] - palms[hand], rests=rests, elapsed=elapsed)
        if self.asked.by_axis:
            push = self.asked.within(hand, push)
        if (size := sqrt(push.dot(push))) == 0.0:
            return
        share = config.tipping_share * (1.0 - 0.5 * self.shares[1 - hand])
        tips, spends = self.tipping_force(palms[hand], -push / size), self.arm_force(hand, push / size)
        most = min(self.asked.limits[hand], share * tips, UNTOLD_SHARE * spends)
        if told > 0.0:
            most = max(most, min(1.5 * told * config.mass, self.asked.limits[hand], TOLD_SHARE * tips, spends))
        felt, tick, (shoulder, elbow) = own[FORCE:MOMENT], self._controller.compiled.tick, self._ends[hand]
        ends = stretched(tick.p[shoulder], tick.p[elbow], tick.frame_p[PALM_FRAME + hand], felt)
        away = self._into[hand].dot(self._met[hand] - palms[hand])
        share = min(max((away - PULLED) / (PULLED_END - PULLED), ends, 0.0), 1.0)
        self._drawn[hand] = min(max((away - LED) / (PULLED - LED), ends, 0.0), 1.0)
        drawn = sqrt(felt.dot(felt))
        own[PUSH_MAX] = (most + share * max(drawn - most, 0.0)) / config.mass
        if self.asked.by_axis:
            largest = self.asked.axes[hand]
            own[AXIS_MAX:HEADING] = (largest + share * np.maximum(drawn - largest, 0.0)) / config.mass

    def tipping_force(self, palm: np.ndarray, direction: np.ndarray) -> float:
        """Force along a unit vector (3,) on a palm (3,) [m] that takes the centre of pressure to the edge [N]."""
        support, robot = self._controller.balance.support, self._controller.robot
        weight, edges = GRAVITY * robot.mass, (support.normals, support.offsets)
        return min(tipping_share(direction[None], palm[None], robot.com, weight, *edges), weight)

    def arm_force(self, hand: int, direction: np.ndarray) -> float:
        """Force of a palm along a unit vector (3,) at which a joint of its arm has no torque left [N]."""
        tick, arm, at = self._controller.compiled.tick, self._arms[hand], 6 * (PALM_FRAME + hand)
        J, touch = tick.J[at : at + 6, arm], tick.touch[hand]
        lever, spent = direction @ J[:3], tick.nle[arm]
        if touch[SHARE] > 0.0:
            spent = spent + touch[FORCE:PUSH_MAX] @ J  # the program has taken what it counts on off
        return arm_force(lever, spent, self._torques[hand])

    def forgiven(self, palms: np.ndarray, row: np.ndarray) -> np.ndarray:
        """Palm points (2, 3) as they would be if what they touch did not hold them back along their push [m]."""
        palms = palms.copy()
        for hand, (share, into) in enumerate(zip(self.shares, self._into, strict=True)):
            if share > 0.0:
                short = into.dot(row[PALM * hand + 9 : PALM * hand + 12] - palms[hand])
                palms[hand] += share * min(max(short, 0.0), FORGIVEN) * into
        return palms

    def status(self, otherwise: StatusReport) -> StatusReport:
        """What a person sees while a chunk is followed with a hand that touches, or else another status."""
        if self._settled or otherwise.status not in FOLLOWING:
            return otherwise
        said = [
            f"the {side} hand pushes with {sqrt(force.dot(force)):.0f} N since {since:.2f} s"
            for side, force, since, share in zip(("left", "right"), self.forces, self.since, self.shares, strict=True)
            if share > 0.5
        ]
        if not said and self._leaning.unfelt:
            said.append(f"something pulls with {np.linalg.norm(self._body.wrench[:3]):.0f} N that no hand feels")
        return StatusReport(Status.SLOWED, Reason.TOUCHING, ", ".join(said)) if said else otherwise
