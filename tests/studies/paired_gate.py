"""``python -m tests.studies.paired_gate [--first N] [--count N] [--out FILE]``: the learned reach, gated and not.

Driven as by `lerobot-eval`: one target each 1/30 s, all of a chunk before the next look. Each seed is tried both ways,
a line of JSON a seed; what FILE has already is not tried again, so ranges of seeds can go to several processes, a file
each, and ``cat`` them. Told at the end: who is reached, and falls.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from lerobot_robot_wholebody.environment import G1Env
from policy.learned.act import ActNetwork
from policy.learned.reach import FIRST_SEED, WEIGHTS


def tried(env, network, seed):
    """How an episode ended."""
    seen, _ = env.reset(seed=FIRST_SEED + seed)
    over, steps, info, actions = False, 0, {}, []
    while not over:
        actions = actions or list(network.chunk(seen["agent_pos"], seen["environment_state"]))
        seen, _, done, late, info = env.step(actions.pop(0).astype(np.float32))
        over, steps = done or late, steps + 1
    far = np.linalg.norm(seen["environment_state"].reshape(2, 3), axis=1).max()
    return {"reached": info["is_success"], "fell": info["fell"], "steps": steps, "off": round(float(far), 4)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--out", type=Path, default=Path("paired_gate.jsonl"))
    parser.add_argument("--weights", type=Path, default=WEIGHTS, help="that training.export wrote")
    given = parser.parse_args()
    network = ActNetwork.load(given.weights)
    lines = given.out.read_text().splitlines() if given.out.exists() else []
    rows = {row["seed"]: row for row in map(json.loads, lines)}
    envs = {name: G1Env(gate=name == "gated") for name in ("free", "gated")}
    try:
        for seed in range(given.first, given.first + given.count):
            if seed not in rows:
                rows[seed] = {"seed": seed} | {name: tried(env, network, seed) for name, env in envs.items()}
                with given.out.open("a") as out:
                    out.write(json.dumps(rows[seed]) + "\n")
    finally:
        for env in envs.values():
            env.close()
    found = list(rows.values())
    for name in envs:
        reached, fell = (sum(row[name][what] for row in found) for what in ("reached", "fell"))
        print(f"{name}: {reached} of {len(found)} reached, {fell} fell")
    cost = [row["seed"] for row in found if row["free"]["reached"] and not row["gated"]["reached"]]
    print(f"reached without the gate only: {len(cost)}, seeds {cost}")


if __name__ == "__main__":
    main()
