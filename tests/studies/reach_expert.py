"""``python -m tests.studies.reach_expert [EPISODES]``: the scripted expert on the plugin's robot.

It is driven as by `lerobot-record`. An episode is reached if both palms are within `REACHED` of their goals at its end;
it has `SECONDS`, then `RESET` seconds lead back.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from lerobot_robot_wholebody import WholebodyExpert, WholebodyExpertConfig, WholebodyG1, WholebodyG1Config
from lerobot_robot_wholebody.target import palm_of
from lerobot_robot_wholebody.tasks import REACHED, SIDES

SECONDS, RESET, STEP = 3.5, 2.5, 1.0 / 30.0


def palms(robot):
    """Palms in the stance, shape (2, 3), [m]."""
    anchor = robot.numbers.anchor(robot.seen.observation)
    T = np.linalg.inv(anchor.T_world_stance) @ anchor.T_world_base
    hands = zip(("lhand", "rhand"), SIDES, strict=True)
    return np.array([palm_of(T @ anchor.poses[hand], side, robot.numbers) for hand, side in hands])


def phase(robot, expert, name, seconds):
    """Drive one phase; RMS distance of the palms from where they were asked to be a step before [m]."""
    robot.begin(name)
    off, asked = [], None
    for _ in range(round(seconds / STEP)):
        robot.get_observation()
        if asked is not None:
            off.append(np.linalg.norm(palms(robot) - asked, axis=1))
        robot.send_action(expert.get_action())
        asked = np.array(expert._last)
        robot.let_pass(STEP)
    robot.get_observation()
    return float(np.sqrt(np.square(off).mean()))


def main(episodes):
    with TemporaryDirectory() as folder:
        where = {"calibration_dir": Path(folder)}
        robot = WholebodyG1(WholebodyG1Config(clock="lockstep", task="reach", **where))
        expert = WholebodyExpert(WholebodyExpertConfig(**where))
        expert.connect()
        robot.connect()
        ends, lags = [], []
        for number in range(episodes):
            lags.append(phase(robot, expert, "episode", SECONDS))
            ends.append(float(np.linalg.norm(palms(robot) - robot.task.goals, axis=1).max()))
            print(f"{number}: {1e3 * ends[-1]:.1f} mm at the end, {1e3 * lags[-1]:.1f} mm RMS a step later", flush=True)
            phase(robot, expert, "reset", RESET)
        robot.disconnect()
    reached, report, ends = sum(end <= REACHED for end in ends), robot.report, 1e3 * np.array(ends)
    print(f"reached {reached} of {episodes}; at the end median {np.median(ends):.1f} mm, worst {ends.max():.1f} mm")
    print(f"a step later median {1e3 * np.median(lags):.1f} mm RMS; fell {report['fell']}, lowered {report['lowered']}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50)
