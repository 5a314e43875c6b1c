"""``python -m tests.studies.environment_speed [EPISODES]``: how fast the environment is, with observations of state.

An episode is four seconds of the expert's reach. Counted is the CPU time of both processes, the environment's and the
robot's: simulated seconds over it are the multiple of real time of a process that has a core to itself. The rate on the
wall clock is told, too: started twice at once, both together say what a second process is worth.
"""

import sys
import time
from pathlib import Path

import numpy as np

from lerobot_robot_wholebody.environment import FPS, G1Env
from lerobot_robot_wholebody.target import palm_of, wrist_at
from lerobot_robot_wholebody.wholebody_expert import _Way
from policy.action_spec.codec import encode_valid
from policy.chunk import ActionChunk
from policy.geometry.se3 import inverse

SECONDS = 4.0


def cpu():
    """CPU time of this process [s]."""
    return time.process_time()


def robots_cpu(env):
    """CPU time of the robot's process [s]."""
    fields = Path(f"/proc/{env._robot._process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100.0


def main(episodes):
    env, rng, spent, robot, wall = G1Env(), np.random.default_rng(0), [], [], []
    for number in range(episodes):
        env.reset(seed=number)
        seen, numbers = env._seen.observation, env._numbers
        anchor = numbers.anchor(seen)
        T_stance_base = inverse(anchor.T_world_stance) @ anchor.T_world_base
        wrists = [T_stance_base @ anchor.poses[hand] for hand in ("lhand", "rhand")]
        palms = [palm_of(T, side, numbers) for T, side in zip(wrists, ("left", "right"), strict=True)]
        ways = [_Way.drawn(rng, *points) for points in zip(palms, env._task.goals, strict=True)]
        begin, since = (cpu(), robots_cpu(env)), time.monotonic()
        for step in range(round(SECONDS * FPS)):
            hands = zip(ways, wrists, ("left", "right"), strict=True)
            poses = [wrist_at(way.at(step / FPS), T[:3, :3], side, numbers) for way, T, side in hands]
            poses = [anchor.T_world_stance @ T for T in poses]
            rows = [part[None] for part in (*poses, seen.q_lhand, seen.q_rhand)]
            action = encode_valid(numbers.spec, ActionChunk(numbers.spec.id, 0, 0.0, 30.0, *rows), anchor)[0]
            env.step(action.astype(np.float32))
        spent.append(cpu() - begin[0])
        robot.append(robots_cpu(env) - begin[1])
        wall.append(time.monotonic() - since)
        print(f"{number}: {spent[-1]:.2f} s here, {robot[-1]:.2f} s of the robot's process", flush=True)
    env.close()
    total = np.array(spent) + np.array(robot)
    print(f"CPU a simulated second: median {np.median(total) / SECONDS:.3f} s, worst {total.max() / SECONDS:.3f} s")
    print(f"multiple of real time: median {SECONDS / np.median(total):.2f}, least {SECONDS / total.max():.2f}")
    print(f"on the wall clock: median {SECONDS / np.median(wall):.2f} simulated seconds a second")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10)
