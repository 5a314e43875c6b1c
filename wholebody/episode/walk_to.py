"""A robot walked to a base in a simulation: `Supervisor.walk_to`, and its loop until the robot stands there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, remainder, tau

from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.execution.states import State
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.fall import Fall, detect_fall
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Reason, StatusReport

GOING = frozenset({State.RISING, State.WALKING, State.RECOVERING})
"""States in which a robot that was told to walk is on its way."""
SPARE, SLOWEST, SLOWEST_TURN = 15.0, 0.1, 0.15
"""Time to begin, end and be pushed [s], and mean speeds [m/s, rad/s] from which the longest time of a walk is found;
chosen: a third of what walks do."""


@dataclass(frozen=True, kw_only=True)
class WalkedTo:
    """Where a robot came that was told to walk to a base.

    Attributes:
        stands: Whether it stands there at the end, no step left to make; False for a walk that was refused.
        base: Where it stands: midway between its soles x, y [m] and heading [rad].
        off: Distance of that from where it was told to go [m].
        turned: The same of the heading [rad].
        seconds: Time that it took [s].
        steps: How often a foot was lifted.
        status: What was said: why a walk was refused, or the last of one that was made.
        fall: When and why it fell; None if it did not.
    """

    stands: bool
    base: tuple[float, float, float]
    off: float
    turned: float
    seconds: float
    steps: int
    status: StatusReport
    fall: Fall | None = None

    def __str__(self) -> str:
        """A line."""
        if self.status.reason is Reason.WALK_REFUSED:
            return f"does not walk: {self.status.detail}"
        if self.fall is not None:
            return f"fell after {self.seconds:.1f} s: {self.fall.cause}"
        x, y, heading = self.base
        end = f"({x:.2f}, {y:.2f}), heading {heading:.2f} rad, {1e3 * self.off:.0f} mm off"
        does = "stands at" if self.stands else "has not come to a stand; it is at"
        return f"{does} {end}, after {self.steps} steps and {self.seconds:.1f} s"


def walk_to(base: Sequence[float], supervisor: Supervisor | None = None, plant: MujocoPlant | None = None) -> WalkedTo:
    """Walk a robot to a base, and wait until it stands there.

    Without a supervisor and a plant, those of the default settings with ``steps: reach`` begin in the stance. In a loop
    of your own, call `Supervisor.walk_to` and go on stepping.

    Args:
        base: x, y [m] and heading [rad] in world, midway between the soles.
        supervisor: After `reset`, of a configuration with ``steps: reach``; its chunk, if any, goes on afterwards.
        plant: That it has followed so far; given with it.

    Returns:
        What became of it: a base that is too far away or not finite, and a supervisor that does not walk, are refused
        with the reason in ``status``, and nothing moves.

    Raises:
        StateError: For a supervisor that was never reset.
        InputError: For a base that is no numbers.
        TypeError: For one of supervisor and plant without the other.
    """
    if (supervisor is None) != (plant is None):
        raise TypeError("walk_to takes a supervisor and the plant that it drives, or neither")
    if supervisor is None or plant is None:
        config = ControllerConfig(steps="reach")
        spec = describe(config.robot)
        supervisor, plant = Supervisor(spec, config), MujocoPlant(spec)
        supervisor.reset(plant.reset())
    here = supervisor.base
    status = supervisor.walk_to(base)
    if status.reason is Reason.WALK_REFUSED:
        return WalkedTo(stands=False, base=here, off=0.0, turned=0.0, seconds=0.0, steps=0, status=status)
    x, y, heading = (float(number) for number in base)
    way, turn = hypot(x - here[0], y - here[1]), abs(remainder(heading - here[2], tau))
    longest = round((SPARE + way / SLOWEST + turn / SLOWEST_TURN) / plant.control_dt)
    state, ticks, steps, stood, fall = plant.state(), 0, 0, True, None
    while supervisor.state in GOING and ticks < longest and fall is None:
        state, ticks = plant.step(supervisor.step(state)), ticks + 1
        stands = all(supervisor.contacts.contacts[0].stands)
        steps, stood = steps + (stood and not stands), stands
        fall = detect_fall(plant, state, supervisor.status.status)
    x_end, y_end, heading_end = end = supervisor.base
    return WalkedTo(
        stands=fall is None and supervisor.state not in GOING,
        base=end,
        off=hypot(x - x_end, y - y_end),
        turned=abs(remainder(heading - heading_end, tau)),
        seconds=ticks * plant.control_dt,
        steps=steps,
        status=supervisor.status,
        fall=fall,
    )
