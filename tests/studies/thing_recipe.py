"""``python -m tests.studies.thing_recipe DATASET TASK``: whether a policy of `make loop` does a task with a thing.

DATASET is the folder ``recorded`` of a loop. ACT learns it with the loop's settings as `reach_recipe` does, in a tenth
of the time of `lerobot-train`, from the episodes in which the expert did the task; then it does the task in the
environment, on seeds that were not recorded. Told of each: whether it is done, after how many steps, and falls.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from lerobot_robot_wholebody.environment import G1Env
from tests.studies.reach_recipe import ACTION, SHOWN, STATE, Trained
from training.export import write
from training.loop import ACT
from training.measure import done
from training.replay import episodes
from training.shown import shown_columns

FIRST_SEED = 100_000
"""Seed of the first try; as `make loop` evaluates."""


def tried(env: G1Env, policy: Trained, seed: int) -> tuple[bool, bool, int]:
    """Whether one try is done and whether the robot fell, and its steps."""
    seen, _ = env.reset(seed=seed)
    for step in range(env._max_episode_steps):
        if step % ACT["n_action_steps"] == 0:
            state, shown = (seen[name].astype(float)[None] for name in ("agent_pos", "environment_state"))
            chunk = policy.chunks(state, shown)[0].astype(np.float32)
        seen, _, ended, _, info = env.step(chunk[step % len(chunk)])
        if ended:
            break
    return info["is_success"], info["fell"], step + 1


def main() -> None:
    """Train, try, and tell."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("dataset", type=Path)
    parser.add_argument("task")
    parser.add_argument("--file", type=Path, help="where it is exported, as `training.export` does")
    for name, usual in (("steps", 2000), ("batch", 40), ("seed", 0), ("tries", 24)):
        parser.add_argument(f"--{name}", type=int, default=usual)
    given, begin = parser.parse_args(), time.process_time()
    _, names, recorded = episodes(given.dataset)
    shown = shown_columns(names)
    good = [(actions, states) for actions, states in recorded if done(states, names, given.task)]
    rows = [{ACTION: actions, STATE: states, SHOWN: states[:, shown]} for actions, states in good]
    policy = Trained(rows, given.steps, given.batch, given.seed)
    print(f"trained on {len(good)} of {len(recorded)} episodes, {time.process_time() - begin:.0f} s of CPU", flush=True)
    if given.file:
        write(given.file, policy.arrays())
    env, ends = G1Env(task=given.task), []
    try:
        for seed in range(FIRST_SEED, FIRST_SEED + given.tries):
            ends.append(tried(env, policy, seed))
            print(
                f"{seed}: {'done' if ends[-1][0] else 'not done'}, {ends[-1][2]} steps, fell {ends[-1][1]}", flush=True
            )
    finally:
        env.close()
    print(f"done {sum(one[0] for one in ends)} of {len(ends)}, {sum(one[1] for one in ends)} falls")


if __name__ == "__main__":
    main()
