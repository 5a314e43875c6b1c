"""All troubles at once: hands among furniture, loads, bumps, slow plans, rare or frequent chunks, a realistic robot.

``python -m tests.studies.mixtures --cases 0 40 --out FILE`` runs the cases that the file has not yet and prints
a line each: who fell, when, and what was drawn. Each study of one trouble alone has a world of its own; here every case
draws its world anew, with no regard to which of them it is that a controller was made for. The answer is 1 if one fell.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from models.scenes.registry import SCENES
from policy.scripted.policy import ScriptedPolicy
from policy.scripted.waypoints import Waypoint, waypoint_policy
from tests.support.felt import SPEC, robot_in
from wholebody.config import ControllerConfig
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.supervisor import Supervisor

WORKSPACE = np.array([0.20, 0.02, 0.45]), np.array([0.55, 0.45, 1.30])
"""Corners of the box in which the left hand's waypoints are drawn, the right one's mirrored [m]."""
BODIES = ("pelvis", "torso_link", *(tool.wrist_frame for tool in SPEC.tools))
BUMP_TIME, BUMP_MAX = 0.02, 4.0
"""Time of a bump [s], and its largest impulse [N s]; it comes in three cases of ten."""


def draw(case: int) -> dict:
    """What is drawn for a case."""
    rng = np.random.default_rng(case)
    return {
        "scene": str(rng.choice(SCENES)),
        "realistic": case if rng.random() < 0.5 else None,
        "load": round(float(rng.uniform(0.05, 0.8)), 2) if rng.random() < 0.4 else 0.0,
        "every": int(rng.choice([3, 6, 12, 25, 40])),
        "factor": float(rng.choice([0.3, 1.0, 2.0, 4.0])),
        "bump": [str(rng.choice(BODIES)), *np.round(_bump(rng), 1).tolist()] if rng.random() < 0.3 else None,
        "bump_at": round(float(rng.uniform(2.0, 9.0)), 2),
        "speed": round(float(np.exp(rng.uniform(np.log(0.08), np.log(0.6)))), 2),
    }


def _bump(rng: np.random.Generator) -> np.ndarray:
    direction = rng.normal(size=3)
    return direction / np.linalg.norm(direction) * rng.uniform(0.5, BUMP_MAX)


def motion(case: int, speed: float) -> ScriptedPolicy:
    """Both hands from place to place, each for itself, some a little past what is reached; turned by up to 0.6 rad."""
    rng, low_high = np.random.default_rng((case, 1)), WORKSPACE
    waypoints, time = [], 0.0
    before = np.array([0.26, 0.20, 0.86]), np.array([0.26, -0.20, 0.86])
    for _ in range(5):
        left, right = (rng.uniform(*low_high) for _ in range(2))
        palms = left, right * [1.0, -1.0, 1.0]
        far = max(float(np.linalg.norm(new - old)) for new, old in zip(palms, before, strict=True))
        time += max(0.6, far / speed)
        turns = rng.uniform(-0.6, 0.6, (2, 3))
        waypoints.append(Waypoint(time, *palms, turn_lhand=turns[0], turn_rhand=turns[1]))
        before = palms
        if rng.random() < 0.4:
            time += float(rng.uniform(0.2, 1.5))
            waypoints.append(Waypoint(time))
    return waypoint_policy("mixture", waypoints)


def run(case: int) -> dict:
    """What became of a case."""
    drawn = draw(case)
    plant, sensors = robot_in(drawn["scene"], drawn["realistic"], drawn["load"])
    usual = ControllerConfig()
    config = replace(usual, planning=replace(usual.planning, factor=drawn["factor"]))
    if drawn["bump"] is not None:
        body, *impulse = drawn["bump"]
        force, reset = np.array(impulse) / BUMP_TIME, plant.reset
        # `run_episode` resets the plant, which forgets its pushes.
        plant.reset = lambda *begin: (
            reset(*begin),
            plant.push(body, force, start=drawn["bump_at"], duration=BUMP_TIME),
        )[0]
    policy = motion(case, drawn["speed"])
    duration = min(policy.duration, 20.0)
    episode = EpisodeConfig(replace_every=drawn["every"])
    result = run_episode(policy, Supervisor(SPEC, config), plant, duration=duration, config=episode, sensors=sensors)
    fall = result.fall
    reasons = {str(reason): round(seconds, 1) for reason, seconds in result.reasons.items() if seconds >= 0.1}
    fell = {"fell": fall is not None, "fall": "" if fall is None else f"{fall.time:.2f} s {fall.cause}"}
    return {"case": case} | fell | {"reasons": reasons, "drawn": drawn}


def main() -> int:
    """Run what is not in the file yet; 1 if anything fell."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cases", nargs=2, type=int, default=(0, 40), help="first, and one past the last")
    parser.add_argument("--out", type=Path, help="a line of JSON for each case")
    chosen = parser.parse_args()
    known = {}
    if chosen.out is not None and chosen.out.exists():
        known = {line["case"]: line for line in map(json.loads, chosen.out.read_text().splitlines())}
    fell, cases = [], range(*chosen.cases)
    for case in cases:
        line = known.get(case) or run(case)
        if case not in known and chosen.out is not None:
            with chosen.out.open("a") as file:
                file.write(json.dumps(line) + "\n")
        print(json.dumps(line), flush=True)
        fell += [case] * line["fell"]
    print(f"{len(fell)} of {len(cases)} fell: {fell}")
    return int(bool(fell))


if __name__ == "__main__":
    sys.exit(main())
