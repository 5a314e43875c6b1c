"""Pushes at the torso of a robot that stands, 0.1 s long, with and without a step that catches it; a line each.

    python -m tests.studies.recoveries recover --angles 0 45 135 180 --impulses 10 12 14 16
    python -m tests.studies.recoveries never --angles 0 45 135 180 --impulses 10 12 14 16
    python -m tests.studies.recoveries recover --realistic 0 1 2
    python -m tests.studies.recoveries recover --hands lissajous

The robot has 43 joints; its hands are still or follow a script, the state is true, or estimated of realistic robots of
some seeds. Angles are of the push, 0 ahead, 90 to the left [degrees].
"""

import argparse
from functools import partial
from itertools import product

import numpy as np

from policy.scripted.library import scripted_policy
from tests.support.felt import SPEC, robot_in
from wholebody.config import ControllerConfig
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.states import State
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.fall import detect_fall

PUSHED, AFTER = 0.5, 9.0
"""When it is pushed, and how long it is looked at [s]."""


def pushed_while(hands, supervisor, plant, sensors, angle, impulse):
    """What `pushed` tells, of a robot whose hands follow a script from 0.5 s on, and that is pushed 2 s later."""
    way, told = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle)), 0.0]), []

    def push(now, end):
        if now >= PUSHED + 2.0 and not told:
            told.append(now)
            plant.push("torso_link", 10.0 * impulse * way, start=now, duration=0.1)

    policy, config = scripted_policy(hands), EpisodeConfig(hold=1.0)
    result = run_episode(policy, supervisor, plant, duration=AFTER, config=config, sensors=sensors, progress=push)
    return result.fall, *ended(supervisor)


def ended(supervisor):
    """How it ended: its state, its steps, and how far apart its feet stand at last [m]."""
    walker = supervisor._stepping._walker
    walk = None if walker is None else walker.walk
    soles = supervisor._planted.feet.poses
    apart = float(np.linalg.norm(soles[0].translation[:2] - soles[1].translation[:2]))
    return supervisor.state, 0 if walk is None else walk.made, apart


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
    return fall, *ended(supervisor)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("steps", choices=("never", "recover"))
    parser.add_argument("--angles", type=float, nargs="+", default=[0.0, 45.0, 90.0, 135.0, 180.0])
    parser.add_argument("--impulses", type=float, nargs="+", default=[10.0, 12.0, 14.0, 16.0])
    parser.add_argument("--realistic", type=int, nargs="+", default=[None], metavar="SEED")
    parser.add_argument("--hands", metavar="SCRIPT", help="script that they follow; they are still without")
    given = parser.parse_args()
    push = pushed if given.hands is None else partial(pushed_while, given.hands)
    config, fell, tried = ControllerConfig(steps=given.steps), 0, 0
    for angle, impulse, seed in product(given.angles, given.impulses, given.realistic):
        plant, sensors = robot_in("floor", seed)
        fall, end, made, apart = push(Supervisor(SPEC, config), plant, sensors, angle, impulse)
        stood = end in (State.HOLDING, State.FOLLOWING, State.STANDING, State.RETURNING)
        said = f"falls at {fall.time:.2f} s: {fall.cause}" if fall else "stands" if stood else end.value
        fell, tried = fell + (fall is not None), tried + 1
        robot = "" if seed is None else f", robot {seed}"
        said = f"{said}; {made} steps, feet {apart:.2f} m apart"
        print(f"{given.steps} {angle:g} deg, {impulse:g} N s{robot}: {said}", flush=True)
    print(f"{fell} of {tried} fell")


if __name__ == "__main__":
    main()
