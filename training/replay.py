"""``python -m training.replay DATASET FILE [--tries N]``: replay recorded actions from hands that begin elsewhere.

Before each episode both hands are led aside, another way each time, and let stand there; then the actions are told one
each 1/30 s. An episode is a success where both wrists end within `REACHED` of where they ended when it was recorded.
Written is a row of `training.loop`'s table.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from pyarrow import parquet

from lerobot_robot_wholebody.environment import FPS, G1Env
from lerobot_robot_wholebody.tasks import SIDES
from policy.learned.reach import REACHED

ASIDE = np.array([0.08, 0.08, 0.12])
"""How far hands begin aside at most, both ways [m]; chosen: as far as they get from the stance without a lean."""
LED, STANDS = round(1.5 * FPS), round(0.5 * FPS)
"""Steps in which hands are led there, and for which they stand there; chosen."""


def episodes(folder: Path) -> tuple[list[str], list[str], list[tuple[np.ndarray, np.ndarray]]]:
    """Names of actions and states, and both of each episode, a row a step."""
    features = json.loads((folder / "meta" / "info.json").read_text())["features"]
    tables = [parquet.read_table(path) for path in sorted((folder / "data").rglob("*.parquet"))]
    columns = [
        np.concatenate([np.array(table[name].to_pylist()) for table in tables])
        for name in ("action", "observation.state", "episode_index")
    ]
    actions, states, number = columns
    parts = [(actions[number == one], states[number == one]) for one in np.unique(number)]
    return features["action"]["names"], features["observation.state"]["names"], parts


def wrists(names: list[str], rows: np.ndarray) -> np.ndarray:
    """Places of both wrists in rows (..., n), shape (..., 2, 3), [m]."""
    return rows[..., [[names.index(f"{side}_wrist_{axis}.pos") for axis in "xyz"] for side in SIDES]]


def main() -> None:
    """Replay, write the row."""
    parser = argparse.ArgumentParser(prog="python -m training.replay", description=__doc__)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("file", type=Path)
    parser.add_argument("--tries", type=int, default=20)
    given = parser.parse_args()
    action_names, state_names, recorded = episodes(given.dataset)
    places = [[action_names.index(f"{side}_wrist_{axis}.pos") for axis in "xyz"] for side in SIDES]
    env, off, falls = G1Env(), [], 0
    try:
        for number, (actions, states) in enumerate(recorded[: given.tries]):
            env.reset(seed=number)
            way = np.random.default_rng(number).uniform(-ASIDE, ASIDE, (2, 3))
            begin = np.tile(actions[0], (LED + STANDS, 1))
            begin[:, places] += np.minimum(np.arange(1, LED + STANDS + 1) / LED, 1.0)[:, None, None] * way
            for row in (*begin, *actions):
                seen, *_, info = env.step(row.astype(np.float32))
            ended = wrists(state_names, states[-1]), wrists(state_names, seen["agent_pos"].astype(float))
            off.append(float(np.linalg.norm(ended[0] - ended[1], axis=1).max()))
            falls += info["fell"]
            print(f"{number}: {1e3 * off[-1]:.0f} mm off at the end, fell {info['fell']}", flush=True)
    finally:
        env.close()
    share = 100.0 * float(np.mean(np.array(off) <= REACHED))
    given.file.write_text(json.dumps({"success": share, "episodes": len(off), "falls": int(falls), "off": off}))


if __name__ == "__main__":
    main()
