"""Pushes at the torso, 0.1 s long, beyond what is stood: how the robot meets the floor; a line each.

    python -m tests.studies.descents never
    python -m tests.studies.descents never --before
    python -m tests.studies.descents recover --angles 0 90 180 --shares 1.2
    python -m tests.studies.descents walking --realistic 0 1 2

With `walking` the robot goes 0.2 m/s ahead with `steps: reach`. `--before` lets it down by no descent, as before there
was one. Angles are of the push, 0 ahead, 90 to the left [degrees], its impulses shares of what is stood. `--none` has
pushes that are stood, 0.8 and 0.95 of it, and counts the descents. The last lines have medians and worst.
"""

import argparse

import numpy as np

from tests.support.landings import PARTS, Landings
from tests.support.walks import worlds
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.execution.states import State
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant

STOOD = {
    "never": ((0, 10), (45, 12), (67.5, 14), (90, 17), (112.5, 15), (135, 14), (180, 10)),
    "recover": ((0, 17), (45, 19), (67.5, 18), (90, 17), (112.5, 17), (135, 17), (180, 17)),
    "walking": ((0, 10), (180, 10)),
}
"""Angles [degrees] and the impulses at the torso that are stood there [N s], docs/walking.md; between them a line."""
PUSHED, LYING, LONGEST = {"never": 0.5, "recover": 0.5, "walking": 3.0}, 6.0, 8.0
"""When it is pushed, how long it is looked at from then on, and without a descent [s]."""
BAR = 1.0
"""Speed with which head and hands may meet the floor [m/s]."""


def stood(mode, angle):
    """Impulse that is stood in a direction [N s]."""
    angles, impulses = np.transpose(STOOD[mode])
    return float(np.interp(min(angle % 360.0, 360.0 - angle % 360.0), angles, impulses))


def pushed(mode, angle, impulse, *, seed=None, before=False, look=None):
    """How the floor is met by a robot that is pushed; the state that it ends in; whether it was let down."""
    config = ControllerConfig(steps="reach" if mode == "walking" else mode)
    spec = describe(config.robot)
    plant, sensors = (MujocoPlant(spec), None) if seed is None else worlds(seed, spec)
    supervisor, state = Supervisor(spec, config), plant.reset()
    if sensors is not None:
        sensors.reset()
    measured = state if sensors is None else sensors.measure(state)
    supervisor.reset(measured, state.time)
    supervisor._falling.descends = not before
    way = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle)), 0.0])
    start = PUSHED[mode]
    plant.push("torso_link", 10.0 * impulse * way, start=start, duration=0.1)
    landings, let_down = Landings(plant), False
    while state.time < start + (LYING if let_down or before else LONGEST):
        if mode == "walking" and 0.5 < state.time < start:
            supervisor.walk((0.2, 0.0, 0.0))
        command = supervisor.step(measured, state.time)
        if sensors is not None and config.steps != "never":
            sensors.estimator.expect(supervisor.contacts)
        landings.begin()
        state = plant.step(command)
        landings.end()
        measured = state if sensors is None else sensors.measure(state)
        let_down = let_down or supervisor.state is State.DESCENDING
        if look is not None:
            look(supervisor, plant, state)
    return landings, supervisor.state, let_down


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("mode", choices=tuple(STOOD))
    parser.add_argument("--angles", type=float, nargs="+", default=[22.5 * k for k in range(16)])
    parser.add_argument("--shares", type=float, nargs="+", default=[1.2, 1.6, 2.0, 2.5])
    parser.add_argument("--realistic", type=int, nargs="+", default=[None], metavar="SEED")
    parser.add_argument("--before", action="store_true")
    parser.add_argument("--none", action="store_true")
    given = parser.parse_args()
    rows, forces, descents = [], [], 0
    for angle in given.angles:
        for share in (0.8, 0.95) if given.none else given.shares:
            for seed in given.realistic:
                impulse = share * stood(given.mode, angle)
                landings, end, let_down = pushed(given.mode, angle, impulse, seed=seed, before=given.before)
                descents += let_down
                met = ", ".join(f"{part} {landings.speed[part]:.2f}" for part in PARTS if part in landings.speed)
                world = "" if seed is None else f", seed {seed}"
                print(f"{angle:g} deg, {impulse:.1f} N s{world}: {end.value}; {met or 'only feet'}", flush=True)
                if landings.speed:
                    rows.append([landings.speed.get(part, 0.0) for part in PARTS])
                    forces.append(max(landings.force.values()))
    print(f"{descents} descents, {len(rows)} met the floor")
    if rows:
        rows = np.array(rows)
        for part, speeds in zip(PARTS, rows.T, strict=True):
            never = f"never {np.mean(speeds == 0.0):.0%}"
            print(f"{part}: median {np.median(speeds):.2f} m/s, worst {speeds.max():.2f}, {never}")
        within = (rows[:, :2] <= BAR).all(axis=1)
        print(f"head and hands within {BAR:g} m/s: {within.sum()} of {len(rows)}")
        print(f"largest force: median {np.median(forces):.0f} N, worst {max(forces):.0f} N")


if __name__ == "__main__":
    main()
