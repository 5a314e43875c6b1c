"""What chunks say of how hands touch: forces that they are to feel, their limits and their stiffness."""

from __future__ import annotations

from math import cos, sin

import numpy as np

from policy.chunk import ActionChunk
from wholebody.config.touch import TouchConfig
from wholebody.robot.touch import AXIS_MAX, FORCE, HEADING, STIFFNESS, TOLD, TOLD_GIVE, push_limits, stance_axes

PRESSED_TIME, PRESSED_MORE = 0.3, 0.4
"""Time constant with which a hand at rest comes to feel the force that it is told [s], and the largest share by which
it is told more or less for that [no unit]; chosen: friction on a wiping hand makes a quarter, which changes slowly."""
AT_PLACE = 0.02
"""How far a hand may be from its place along its push without pushing harder or less for that [m]; chosen: more than
places of furniture are known to."""
STIFFEST = 2000.0
"""Largest stiffness of a hand that a chunk may ask for [N/m]; chosen: three times that as shipped, and stable."""


class AskedForces:
    """The forces, limits and stiffnesses that the present chunk says, as both hands follow them.

    Args:
        config: Settings, which hold where nothing is said; a chunk may lower the limit of a hand, and not raise it.
        rows: What both hands feel and push with, as in `wholebody.robot.touch`, shape (2, TOUCH), changed.

    Attributes:
        chunk: The last one that said something; None if none did.
        forces: That the world is expected to put on each palm now, world axes, shape (2, 3), [N].
        counted: Those that the plan counts on, which leans against them, shape (2, 3), [N].
        limits: Largest forces of both hands now, shape (2,), [N].
        axes: Largest along each axis of the stance, infinite without such limits, shape (2, 3), [N].
        by_axis: Whether axes have limits or stiffnesses of their own.
    """

    def __init__(self, config: TouchConfig, rows: np.ndarray) -> None:
        self._config, self._rows = config, rows
        self.reset()

    def reset(self) -> None:
        """Nothing is said."""
        self.chunk: ActionChunk | None = None
        self.forces, self.counted = np.zeros((2, 2, 3))
        self.limits, self.axes = push_limits(self._config.force_max)
        self.by_axis = bool(np.ndim(self._config.force_max) or np.ndim(self._config.stiffness))
        self._rows[:, STIFFNESS:AXIS_MAX] = np.divide(self._config.stiffness, self._config.mass)
        self._rows[:, AXIS_MAX:], self._more = (np.inf, np.inf, np.inf, 1.0, 0.0), [0.0, 0.0]

    @property
    def told(self) -> bool:
        """Whether any force is expected or counted on."""
        return bool(self.forces.any() or self.counted.any())

    def expect(self, chunk: ActionChunk) -> None:
        """Count from now on on what a chunk says; on nothing if it says nothing."""
        said = (chunk.f_world_lpalm, chunk.f_world_rpalm, chunk.force_max, chunk.stiffness)
        if self.chunk is not None or any(part is not None for part in said):
            self.chunk = chunk

    def listen(self, now: float) -> None:
        """Take over what is said of the present [s]; past the end of a chunk no force is expected."""
        chunk, config = self.chunk, self._config
        if chunk is None:
            return
        step = round((now - chunk.t_obs) * chunk.fps)
        over, step = step > len(chunk) - 1, min(max(step, 0), len(chunk) - 1)
        for hand, force in enumerate((chunk.f_world_lpalm, chunk.f_world_rpalm)):
            self.forces[hand] = 0.0 if force is None or over else force[step]
        self._rows[:, TOLD : TOLD + 3] = -self.forces / config.mass
        stiffness, said = config.stiffness, [] if chunk.force_max is None else [chunk.force_max[step]]
        if chunk.stiffness is not None:
            stiffness = np.minimum(chunk.stiffness[step], STIFFEST).reshape(2, -1)
        self._rows[:, STIFFNESS:AXIS_MAX] = np.divide(stiffness, config.mass)
        self.limits, self.axes = push_limits(config.force_max, *said)
        self.by_axis |= any(part is not None and part.ndim == 3 for part in (chunk.force_max, chunk.stiffness))

    def turn(self, heading: float) -> None:
        """Have the axes of the stance ahead along a heading [rad]."""
        self._rows[:, HEADING:] = cos(heading), sin(heading)

    def spring(self, hand: int, short: np.ndarray) -> np.ndarray:
        """Acceleration with which a hand is drawn to where it is commanded, ``short`` (3,) [m] away, (3,) [m/s^2]."""
        stiffness = self._rows[hand, STIFFNESS:AXIS_MAX]
        if not self.by_axis:
            return stiffness * short
        axes = stance_axes(self._rows[hand, HEADING:])
        return axes @ (stiffness * (short @ axes))

    def within(self, hand: int, push: np.ndarray) -> np.ndarray:
        """An acceleration (3,) [m/s^2] as each axis of the stance allows it."""
        axes, largest = stance_axes(self._rows[hand, HEADING:]), self.axes[hand] / self._config.mass
        return axes @ np.clip(push @ axes, -largest, largest)

    def size(self, hand: int) -> float:
        """Size of the force that is expected on a palm now [N]."""
        return float(np.linalg.norm(self.forces[hand]))

    def free(self, hand: int) -> None:
        """Forget what a hand made up for: it touches nothing."""
        self._more[hand] = 0.0

    def make_up(self, hand: int, short: np.ndarray, *, rests: bool, elapsed: float) -> np.ndarray:
        """Have a hand that rests on something push harder or less, until it feels the force (> 0) that it is told.

        One that is held back from its place by much is to feel up to `TOLD_GIVE` more, so that what gives way does.

        Args:
            hand: Which, that touches and is told of a force.
            short: From its palm to where that is commanded to be, shape (3,), [m].
            rests: Whether it does not move along the force.
            elapsed: Time since the last tick [s].

        Returns:
            With which acceleration it is told to push, shape (3,), [m/s^2].
        """
        row, told = self._rows[hand], self.size(hand)
        u = -self.forces[hand] / told
        if rests:
            away, stiffness, axes = float(u @ short), row[STIFFNESS:AXIS_MAX], stance_axes(row[HEADING:])
            least = stiffness.min()
            along = float(least + (u @ axes) ** 2 @ (stiffness - least))
            give = along * self._config.mass * (away - min(max(away, -AT_PLACE), AT_PLACE)) / told
            wanted, felt = 1.0 + min(max(give, -TOLD_GIVE), TOLD_GIVE), float(-u @ row[FORCE : FORCE + 3]) / told
            more = self._more[hand] + elapsed / PRESSED_TIME * (wanted - felt)
            self._more[hand] = min(max(more, -PRESSED_MORE), PRESSED_MORE)
        row[TOLD : TOLD + 3] *= 1.0 + self._more[hand]
        return row[TOLD : TOLD + 3]
