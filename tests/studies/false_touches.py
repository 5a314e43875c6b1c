"""How often hands in free space are taken to touch something: lissajous and recorded motions, true or realistic robots.

``G1_MOTIONS=FOLDER python -m tests.studies.false_touches --seeds 0 2 --out FILE`` prints a line a motion and seed, the
seed of the realistic robot (none: the true one), and at last how many touches an hour there were; the file goes on
where it ended.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path

import numpy as np

from policy.recorded.replay import open_recording
from policy.scripted.library import scripted_policy
from tests.support.felt import Felt, robot_in, supervisor_of
from wholebody.episode.run import EpisodeConfig, run_episode

LISSAJOUS = 30.0
"""Time of the lissajous [s]."""


def touches(name: str, robot: int | None) -> dict:
    """What a motion in free space came to: seconds, touches said, and the longest [s]."""
    folder = Path(os.environ.get("G1_MOTIONS", "."))
    policy = scripted_policy(name) if name == "lissajous" else open_recording(folder / f"{name}.csv")
    seconds = LISSAJOUS if name == "lissajous" else policy.duration
    supervisor, found = supervisor_of()
    plant, sensors = robot_in("floor", robot)
    felt = Felt(plant, found)
    result = run_episode(policy, supervisor, plant, duration=seconds, config=EpisodeConfig(hold=1.0), sensors=sensors)
    said, times = felt.column(4), felt.column(0)
    begins = np.diff(said.astype(int), axis=0, prepend=0) > 0
    return {
        "seconds": round(float(times[-1]), 2),
        "touches": int(begins.sum()),
        "touching_s": round(float(said.any(axis=1).sum() * 0.002), 3),
        "fell": result.fall is not None,
    }


def main() -> None:
    """Run what is not in the file yet."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", nargs=2, type=int, help="of the realistic robot; the true one if not given")
    parser.add_argument("--motions", nargs="*", help="names; all of the folder, and the lissajous, if not given")
    parser.add_argument("--out", type=Path)
    chosen = parser.parse_args()
    files = sorted(file.stem for file in Path(os.environ.get("G1_MOTIONS", ".")).glob("*.csv"))
    seeds = [None] if chosen.seeds is None else list(range(*chosen.seeds))
    lines = []
    if chosen.out is not None and chosen.out.exists():
        lines = [json.loads(line) for line in chosen.out.read_text().splitlines()]
    done = {(line["motion"], line["seed"]) for line in lines}
    for seed in seeds:
        for name in chosen.motions or ["lissajous", *files]:
            if (name, seed) in done:
                continue
            lines.append({"motion": name, "seed": seed} | touches(name, seed))
            print(json.dumps(lines[-1]), flush=True)
            if chosen.out is not None:
                with chosen.out.open("a") as file:
                    file.write(json.dumps(lines[-1]) + "\n")
    count, hours = sum(line["touches"] for line in lines), sum(line["seconds"] for line in lines) / 3600.0
    print(f"{count} touches in {60.0 * hours:.1f} min: {count / hours:.1f} an hour")


if __name__ == "__main__":
    main()
