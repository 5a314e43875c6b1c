"""``python -m tests.studies.lerobot_expert [TASK [EPISODES [FIRST]]] [--gate]``: the scripted expert on the robot.

It is driven as by `lerobot-record`. An episode counts if the task is done for its steps in a row within its time, then
`RESET` seconds lead back. Also told: how far palms are from where they were asked to be a step before.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from lerobot_robot_wholebody import WholebodyExpert, WholebodyExpertConfig, WholebodyG1, WholebodyG1Config

RESET, STEP = 2.5, 1.0 / 30.0


def phase(robot, expert, name, steps):
    """Drive one phase; RMS distance of palms from where they were asked to be, whether it is done, how far off [m]."""
    robot.begin(name)
    off, asked, held, done, best = [], None, 0, False, np.inf
    for _ in range(steps):
        robot.get_observation()
        if asked is not None:
            off.append(np.linalg.norm(robot.palms - asked, axis=1))
        if name == "episode":
            far = robot.task.far(robot.seen, robot.palms)
            held, best = held + 1 if far <= 0.0 else 0, min(best, far)
            done = done or held >= robot.task.held
        robot.send_action(expert.get_action())
        asked = expert.last.palms
        robot.let_pass(STEP)
    return float(np.sqrt(np.square(off).mean())), done, best


def main(task="reach", episodes="50", first="0", *options):
    with TemporaryDirectory() as folder:
        where, seed = {"calibration_dir": Path(folder)}, int(first)
        named = {"clock": "lockstep", "task": task, "seed": seed, "gate": "--gate" in options}
        robot = WholebodyG1(WholebodyG1Config(**named, **where))
        expert = WholebodyExpert(WholebodyExpertConfig(seed=seed, **where))
        expert.connect()
        robot.connect()
        count, lags = 0, []
        for number in range(int(episodes)):
            lag, done, best = phase(robot, expert, "episode", robot.task.steps)
            count += done
            lags.append(lag)
            said = f"{number}: {'done' if done else 'not done'}, {1e3 * best:.0f} mm from it"
            print(f"{said}, {1e3 * lag:.1f} mm RMS a step later, fell {robot.seen.fallen}", flush=True)
            if robot.seen.fallen:
                break
            phase(robot, expert, "reset", round(RESET / STEP))
        robot.disconnect()
    report = robot.report
    print(f"{task}, seed {seed}: done {count} of {number + 1}; a step later median {1e3 * np.median(lags):.1f} mm RMS")
    fell, lowered = report["fell_at"], report["lowering_from"]
    print(f"fell at {fell}, lowering from {lowered:.1f} s, refused {report['chunks']['refused']}")


if __name__ == "__main__":
    main(*sys.argv[1:])
