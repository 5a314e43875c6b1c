"""Pushes at the torso of a robot that stands, 0.1 s long, with and without a step that catches it; a line each.

    python -m tests.studies.recoveries recover --angles 0 45 135 180 --impulses 10 12 14 16
    python -m tests.studies.recoveries never --angles 0 45 135 180 --impulses 10 12 14 16

Hands are still, the state is true, the robot has 43 joints. Angles are of the push, 0 ahead, 90 to the left [degrees].
"""

import argparse

import numpy as np

from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.execution.states import State
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.fall import detect_fall
from wholebody.sim.plant import MujocoPlant

PUSHED, AFTER = 0.5, 7.0
"""When it is pushed, and how long it is looked at [s]."""


def pushed(supervisor, plant, angle, impulse, look=None):
    """When and why it fell, or None; the steps that it took; how it ended."""
    state = plant.reset()
    supervisor.reset(state)
    way = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle)), 0.0])
    plant.push("torso_link", 10.0 * impulse * way, start=PUSHED, duration=0.1)
    fall = None
    while state.time < AFTER and fall is None:
        state = plant.step(supervisor.step(state))
        fall = detect_fall(plant, state, supervisor.status.status)
        if look is not None:
            look(supervisor, plant, state)
    walker = supervisor._stepping._walker
    return fall, 0 if walker is None or walker.walk is None else walker.walk.made, supervisor.state


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("steps", choices=("never", "recover"))
    parser.add_argument("--angles", type=float, nargs="+", default=[0.0, 45.0, 90.0, 135.0, 180.0])
    parser.add_argument("--impulses", type=float, nargs="+", default=[10.0, 12.0, 14.0, 16.0])
    given = parser.parse_args()
    config = ControllerConfig(steps=given.steps)
    spec = describe(config.robot)
    supervisor, plant = Supervisor(spec, config), MujocoPlant(spec)
    for angle in given.angles:
        for impulse in given.impulses:
            fall, made, end = pushed(supervisor, plant, angle, impulse)
            if walker := supervisor._stepping._walker:
                walker.walk = None
            stood = end in (State.HOLDING, State.FOLLOWING, State.STANDING, State.RETURNING)
            said = f"falls at {fall.time:.2f} s: {fall.cause}" if fall else "stands" if stood else end.value
            print(f"{given.steps} {angle:g} deg, {impulse:g} N s: {said}; {made} steps", flush=True)


if __name__ == "__main__":
    main()
