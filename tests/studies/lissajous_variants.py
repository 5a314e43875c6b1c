"""The lissajous's variants: how well they are followed, and whether where not, the hands asked for are in the way.

``python -m tests.studies.lissajous_variants --seeds 0 20 --out variants.jsonl`` runs the seeds 0 to 19, prints one line
each and appends it to the file; seeds that the file has already are left out. *Near* are the steps within `WINDOW` of
an instant at which the hulls of both hands, put where the script has them, are nearer to each other than a plan lets
them come. *Bound* is evidence that needs neither planner nor controller: hands turned as asked can only be parted by
moving them, and the one that moves more moves at least half of what the clearance lacks (`least_displacement`). Errors
below it at their instant are what the script asks for; a palm that turns away may have less.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from models import g1
from tests.support.lissajous_variants import SCORED, hand_distances, least_displacement, variant
from wholebody.config import TrajectoryConfig
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant

START = 3.0
"""When the curve begins that is scored: a second of standing, two on the way to it [s]."""
WINDOW = 0.2
"""Three knots of a plan, in which palms turn away and back [s]."""
BARS = 2.0, 6.0
"""RMS and at most [mm]."""

HEADINGS = (
    "Seed", "RMS [mm]", "at most [mm]", "hands asked apart [mm]", "bound at most [mm]",
    "steps over the bound, of those over 6 mm", "farthest of these from the overlap [s]",
)  # fmt: skip


def run(seed: int, robot: tuple[Supervisor, MujocoPlant]) -> dict:
    """Errors of one variant, those near an instant at which the hands asked for are too near each other apart."""
    policy, config = variant(seed), EpisodeConfig(hold=1.0)
    result = run_episode(policy, *robot, duration=policy.duration, config=config)
    inside = (result.times >= START) & (result.times < START + SCORED)
    times, errors = result.times[inside], 1e3 * result.errors[inside]
    asked, distances = hand_distances(policy)
    clearance = TrajectoryConfig().self_distance
    close = config.settle + asked[distances < clearance]
    bound = 1e3 * np.interp(times, config.settle + asked, least_displacement(distances, clearance))
    away = np.abs(times[:, None] - close).min(axis=1, initial=np.inf)
    worst, near = errors.max(axis=1), away <= WINDOW
    return {
        "seed": seed,
        "fell": result.fall is not None,
        "rms_mm": round(float(np.sqrt((errors**2).mean())), 3),
        "max_mm": round(float(worst.max()), 2),
        "turn_rms_deg": round(float(np.rad2deg(np.sqrt((result.turns[inside] ** 2).mean()))), 3),
        "time_factor": round(result.time_factor, 4),
        "hands_asked_mm": round(1e3 * float(distances.min()), 1),
        "overlap_share": round(float((distances < 0.0).mean()), 3),
        "bound_mm": round(float(bound.max()), 1),
        "max_over_bound_mm": round(float((worst - bound).max()), 2),
        "steps_over": int((worst > BARS[1]).sum()),
        "steps_over_and_bound": int((worst > np.maximum(BARS[1], bound)).sum()),
        "steps_over_near": int((worst[near] > BARS[1]).sum()),
        "steps_over_away_s": [round(float(x), 2) for x in away[worst > BARS[1]] if x > WINDOW],
        "max_elsewhere_mm": round(float(worst[~near].max(initial=0.0)), 2),
        "rms_elsewhere_mm": round(float(np.sqrt((errors[~near] ** 2).mean())) if (~near).any() else 0.0, 3),
    }


def main() -> None:
    """Run what is not in the file yet, and say how many keep the bars."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 20), metavar=("FIRST", "END"))
    parser.add_argument("--out", type=Path, help="a line of JSON for each seed")
    chosen, done, found = parser.parse_args(), {}, []
    if chosen.out is not None and chosen.out.exists():
        done = {line["seed"]: line for line in map(json.loads, chosen.out.read_text().splitlines())}
    robot = Supervisor(g1()), MujocoPlant(g1())
    for seed in range(*chosen.seeds):
        line = done.get(seed) or run(seed, robot)
        if seed not in done and chosen.out is not None:
            with chosen.out.open("a") as file:
                file.write(json.dumps(line) + "\n")
        found.append(line)
        print(" ".join(f"{name} {value}" for name, value in line.items()), flush=True)
    rms, most = (sum(line[name] <= bar for line in found) for name, bar in zip(("rms_mm", "max_mm"), BARS, strict=True))
    over = [line for line in found if line["max_mm"] > BARS[1]]
    farthest = max([WINDOW, *(x for line in over for x in line["steps_over_away_s"])])
    print(f"of {len(found)}: RMS of at most {BARS[0]} mm in {rms}, at most {BARS[1]} mm in {most}")
    print(f"| {' | '.join(HEADINGS)} |\n|{'---|' * len(HEADINGS)}")
    for line in found:
        beyond = f"{line['steps_over_and_bound']} of {line['steps_over']}"
        away = max(line["steps_over_away_s"], default=0.0)
        cells = (line[name] for name in ("seed", "rms_mm", "max_mm", "hands_asked_mm", "bound_mm"))
        print(f"| {' | '.join(map(str, cells))} | {beyond} | {away} |")
    print(f"the other {len(over)} exceed it up to {farthest} s from where the hands asked for are too near each other")


if __name__ == "__main__":
    main()
