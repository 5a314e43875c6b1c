"""Pushes at the torso of a robot that stands, 0.1 s long, with and without a step that catches it; a line each.

    python -m tests.studies.recoveries recover --angles 0 45 135 180 --impulses 10 12 14 16
    python -m tests.studies.recoveries never --angles 0 45 135 180 --impulses 10 12 14 16
    python -m tests.studies.recoveries recover --realistic 0 1 2

Hands are still, the robot has 43 joints; the state is true, or estimated of realistic robots of some seeds. Angles are
of the push, 0 ahead, 90 to the left [degrees].
"""

import argparse
from itertools import product

import numpy as np

from tests.support.felt import SPEC, robot_in
from wholebody.config import ControllerConfig
from wholebody.execution.states import State
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.fall import detect_fall

PUSHED, AFTER = 0.5, 9.0
"""When it is pushed, and how long it is looked at [s]."""


def pushed(supervisor, plant, sensors, angle, impulse):
    """When and why it fell, or None; how it ended, its steps, and how far apart its feet stand at last [m]."""
    state = plant.reset()
    if sensors is not None:
        sensors.reset()
    measured = state if sensors is None else sensors.measure(state)
    supervisor.reset(measured, state.time)
    way = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle)), 0.0])
    plant.push("torso_link", 10.0 * impulse * way, start=PUSHED, duration=0.1)
    fall = None
    while state.time < AFTER and fall is None:
        command = supervisor.step(measured, state.time)
        if sensors is not None:
            sensors.estimator.expect(supervisor.contacts)
        state = plant.step(command)
        measured = state if sensors is None else sensors.measure(state)
        fall = detect_fall(plant, state, supervisor.status.status)
    walker = supervisor._stepping._walker
    walk = None if walker is None else walker.walk
    soles = supervisor._planted.feet.poses
    apart = float(np.linalg.norm(soles[0].translation[:2] - soles[1].translation[:2]))
    return fall, supervisor.state, 0 if walk is None else walk.made, apart


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("steps", choices=("never", "recover"))
    parser.add_argument("--angles", type=float, nargs="+", default=[0.0, 45.0, 90.0, 135.0, 180.0])
    parser.add_argument("--impulses", type=float, nargs="+", default=[10.0, 12.0, 14.0, 16.0])
    parser.add_argument("--realistic", type=int, nargs="+", default=[None], metavar="SEED")
    given = parser.parse_args()
    config, fell, tried = ControllerConfig(steps=given.steps), 0, 0
    for angle, impulse, seed in product(given.angles, given.impulses, given.realistic):
        plant, sensors = robot_in("floor", seed)
        fall, end, made, apart = pushed(Supervisor(SPEC, config), plant, sensors, angle, impulse)
        stood = end in (State.HOLDING, State.FOLLOWING, State.STANDING, State.RETURNING)
        said = f"falls at {fall.time:.2f} s: {fall.cause}" if fall else "stands" if stood else end.value
        fell, tried = fell + (fall is not None), tried + 1
        robot = "" if seed is None else f", robot {seed}"
        said = f"{said}; {made} steps, feet {apart:.2f} m apart"
        print(f"{given.steps} {angle:g} deg, {impulse:g} N s{robot}: {said}", flush=True)
    print(f"{fell} of {tried} fell")


if __name__ == "__main__":
    main()
