"""How fast a reference may be: limits of speed, acceleration and jerk of the hands and the fingers."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from math import inf, isfinite

import numpy as np

from wholebody.errors import InputError
from wholebody.reference.kernels.smoother_memory import FINGERS, LIMITS

OUTER = (1.5, 5.0, 10.0)
"""Factor on each of speed, acceleration and jerk from what a motion is given to what is stopped as a jump; chosen, no
trial is on record."""


@dataclass(frozen=True)
class MotionLimits:
    """Limits of the norm of one motion; units are m or rad."""

    speed: float
    """[m/s] or [rad/s]"""
    acceleration: float
    """[m/s^2] or [rad/s^2]"""
    jerk: float
    """[m/s^3] or [rad/s^3]"""

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not (isfinite(value) and value > 0.0):
                raise InputError(f"{item.name} limit is {value}; a positive finite number is expected", field=item.name)

    def scaled(self, *factors: float) -> MotionLimits:
        """Every limit times a factor, one for all or one each."""
        speed, acceleration, jerk = factors if len(factors) > 1 else 3 * factors
        return MotionLimits(self.speed * speed, self.acceleration * acceleration, self.jerk * jerk)


@dataclass(frozen=True, kw_only=True)
class HandLimits:
    """Limits of one hand and of its fingers.

    The defaults of the position are what a fast but demandable motion needs several times over: the 1.1 m/s lissajous
    peaks at 5.8 m/s^2 and 32 m/s^3. Those of the orientation are as far above a brisk turn of the wrist (180 degrees in
    half a second: 12 rad/s, 72 rad/s^2), those of the fingers let a 1 Hz sine over the whole
    range of a joint pass (5.4 rad/s, 34 rad/s^2, 213 rad/s^3), and its start from rest within a step of a chunk.
    """

    position: MotionLimits = field(default_factory=lambda: MotionLimits(2.5, 20.0, 400.0))
    orientation: MotionLimits = field(default_factory=lambda: MotionLimits(12.0, 80.0, 2000.0))
    finger: MotionLimits = field(default_factory=lambda: MotionLimits(10.0, 180.0, 3000.0))
    finger_lower: tuple[float, ...] = (-inf,) * FINGERS
    """Lower limits of the joints in motor order [rad]; those that the hand does not have are -inf."""
    finger_upper: tuple[float, ...] = (inf,) * FINGERS
    """Upper limits of the joints in motor order [rad]; those that the hand does not have are inf."""

    @classmethod
    def of_fingers(cls, lower: np.ndarray, upper: np.ndarray) -> HandLimits:
        """The default limits of a hand whose n fingers have these ranges (n,) [rad].

        Raises:
            InputError: If there are more than `FINGERS`.
        """
        if len(lower) > FINGERS:
            raise InputError(f"a hand has {len(lower)} fingers; there is room for {FINGERS}", field="finger_lower")
        room = FINGERS - len(lower)
        return cls(finger_lower=(*lower.tolist(), *(-inf,) * room), finger_upper=(*upper.tolist(), *(inf,) * room))

    def within(self, q_finger: np.ndarray) -> np.ndarray:
        """Finger joints (..., n) [rad], brought into the range of the hand's first n."""
        n = q_finger.shape[-1]
        return np.clip(q_finger, self.finger_lower[:n], self.finger_upper[:n])

    def __post_init__(self) -> None:
        lower, upper = np.asarray(self.finger_lower, dtype=float), np.asarray(self.finger_upper, dtype=float)
        if lower.shape != (FINGERS,) or upper.shape != (FINGERS,):
            raise InputError(
                f"finger limits have shapes {lower.shape} and {upper.shape}; ({FINGERS},) is expected",
                field="finger_lower",
            )
        if not np.all(lower <= upper):
            joint = int(np.flatnonzero(~(lower <= upper))[0])
            raise InputError(
                f"finger joint {joint}: lower limit {lower[joint]} rad is not below the upper {upper[joint]} rad",
                field="finger_lower",
            )

    @property
    def motions(self) -> tuple[MotionLimits, MotionLimits, MotionLimits]:
        """Limits of position, orientation and fingers."""
        return self.position, self.orientation, self.finger

    def scaled(self, factor: float) -> HandLimits:
        """Every speed, acceleration and jerk times a factor; the range of the fingers is kept."""
        motions = {name: getattr(self, name).scaled(factor) for name in ("position", "orientation", "finger")}
        return replace(self, **motions)

    @property
    def outer(self) -> HandLimits:
        """What the last stage lets pass: knots are met whatever they demand, and recordings of people demand more."""
        return replace(self, position=self.position.scaled(*OUTER), orientation=self.orientation.scaled(*OUTER))

    def record(self) -> np.ndarray:
        """What the smoother reads, one record of `smoother_memory.LIMITS`, shape ``(1,)``."""
        record = np.zeros(1, LIMITS)
        groups = self.position, self.orientation, *[self.finger] * FINGERS
        for name in ("speed", "acceleration", "jerk"):
            record[name] = [getattr(group, name) for group in groups]
        record["finger_lower"], record["finger_upper"] = self.finger_lower, self.finger_upper
        return record
