"""What is carried: loads that nobody tells the controller, at the reaches, in the ready pose, added and dropped.

``python -m tests.studies.loads reach --out loads.jsonl`` runs the cases of a family that the file has not yet, prints
one line each and appends it; ``--cases 0 5`` runs a part of them. The families:

reach    0.5, 1 and 2 kg in both hands at the five reaches; beside them, how far off a still robot has to be by
         ``benchmarks/statics.py --loads 0.5 1 2``
ready    1.5 and 2 kg in both hands, 3 and 5 kg in the left, in the stance
instants 2 kg in both hands at the reach (0.40, 1.40), in 27 runs: nine masses of 1.9 to 2.1 kg, and the first chunk at
         three ticks, so that other states meet the load
change   2 kg put into the left hand (20 cases) and dropped from it (20) at phases of the lissajous, 0.157 s apart
lean     1.5 and 2 kg put into the left hand (34 cases) or the right one (34) while the lissajous leans the robot most
grasp    a cylinder of 0.3, 0.6 and 1 kg on a table
hostile  the chunks of `tests.support.hostile_chunks` with 1 kg in the left hand
rolled   2 to 2.5 kg, which is told, in a hand that comes to be level: what plans say of it, and what becomes of it

The answer is 1 if one of them fell.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from itertools import product
from pathlib import Path

import mujoco
import numpy as np

from policy.recorded.replay import ReplayPolicy
from policy.scripted.library import reach, scripted_policy
from tests.support.carried import NOTHING, SPEC, Changed, levelled, still
from tests.support.carried import told as told_settings
from tests.support.hostile_chunks import Episode
from wholebody.episode.result import EpisodeResult
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker

REACHES = ((0.40, 0.30), (0.45, 0.60), (0.50, 1.00), (0.40, 1.40), (0.25, 1.50))
BOUNDS = {0.5: (0, 0, 0, 0, 0), 1.0: (34, 13, 20, 12, 0), 2.0: (94, 101, 102, 47, 0)}
"""How far off a still robot has to hold these masses in both hands, at the plan's margins [mm]; both hands alike."""
READY = ((1.5, 1.5), (2.0, 2.0), (3.0, 0.0), (5.0, 0.0))
PHASES = 20
MASSES, FIRST_CHUNKS = np.linspace(1.9, 2.1, 9), (1.0, 1.004, 1.008)
"""Of `instants`, in each hand [kg], and when its first chunk is asked for [s]."""
OBJECTS = (0.3, 0.6, 1.0)
LEANS, WEIGHTS = np.linspace(4.25, 5.05, 17), (1.5, 2.0)
"""Of `lean`, when a mass is put into a hand, and which [s], [kg]: the lissajous leans the robot by 30 degrees then."""
ROLLED = (2.0, 2.1, 2.15, 2.2, 2.25, 2.3, 2.35, 2.4, 2.45, 2.5)
"""Masses of `rolled` [kg]."""
CASES = {"reach": 15, "ready": len(READY), "instants": 27, "change": 2 * PHASES, "lean": 4 * len(LEANS)}
CASES |= {"grasp": len(OBJECTS), "hostile": 330, "rolled": len(ROLLED)}
"""How many there are of each family."""


def told(result: EpisodeResult, bound_mm: float = 0.0) -> dict:
    """What a line says of an episode."""
    late = result.times >= result.times[-1] - 1.0 if len(result.times) else slice(0)
    end, turn = 1e3 * result.errors[late].max(axis=0), np.rad2deg(result.turns[late].max(axis=0))
    return {
        "fell": result.fall is not None,
        "end_mm": np.round(end, 2).tolist(),
        "turn_deg": np.round(turn, 1).tolist(),
        "rms_mm": round(1e3 * result.rms, 2),
        "bound_mm": bound_mm,
        "fall": "" if result.fall is None else f"{result.fall.time:.2f} s {result.fall.cause}",
    }


def run(family: str, case: int, supervisor: Supervisor) -> dict:
    """One case."""
    if family == "reach":
        mass, i = list(product(BOUNDS, range(len(REACHES))))[case]
        policy = reach(*REACHES[i])
        result = run_episode(policy, supervisor, MujocoPlant(SPEC, payload_kg=(mass, mass)), duration=policy.duration)
        return {"name": f"{mass:g} kg each at {REACHES[i]}"} | told(result, BOUNDS[mass][i])
    if family == "ready":
        policy, plant = still(4.0), MujocoPlant(SPEC, payload_kg=READY[case])
        return {"name": f"{READY[case]} kg in the stance"} | told(run_episode(policy, supervisor, plant, duration=4.0))
    if family == "instants":
        (begin, mass), policy = list(product(FIRST_CHUNKS, MASSES))[case], reach(*REACHES[3])
        plant, config = MujocoPlant(SPEC, payload_kg=(mass, mass)), EpisodeConfig(settle=begin)
        result = run_episode(policy, supervisor, plant, duration=policy.duration, config=config)
        return {"name": f"{mass:.3f} kg each at {REACHES[3]}, from {begin:g} s on"} | told(result, BOUNDS[2.0][3])
    if family == "change":
        plant, load = Changed(SPEC, payload_kg=(NOTHING, NOTHING)), (2.0, NOTHING)
        drops, phase = divmod(case, PHASES)
        plant.before, plant.after = (load, plant.before) if drops else (plant.before, load)
        plant.at = 4.0 + math.pi * phase / PHASES
        result = run_episode(scripted_policy("lissajous"), supervisor, plant, duration=8.0)
        return {"name": f"2 kg {'dropped' if drops else 'added'} at {plant.at:.2f} s"} | told(result)
    if family == "lean":
        side, mass, at = list(product((0, 1), WEIGHTS, LEANS))[case]
        plant = Changed(SPEC, payload_kg=(NOTHING, NOTHING))
        plant.after, plant.at = (mass, NOTHING)[:: 1 - 2 * side], float(at)
        result = run_episode(scripted_policy("lissajous"), supervisor, plant, duration=8.0)
        return {"name": f"{mass:g} kg put into the {('left', 'right')[side]} hand at {at:.2f} s"} | told(result)
    if family == "grasp":
        policy, plant = scripted_policy("grasp"), MujocoPlant(SPEC, scene="table_cylinder")
        body = plant.model.body("object")
        body.inertia[:] *= OBJECTS[case] / body.mass[0]
        body.mass[0] = OBJECTS[case]
        mujoco.mj_setConst(plant.model, mujoco.MjData(plant.model))
        result = run_episode(policy, supervisor, plant, duration=policy.duration, config=EpisodeConfig(hold=1.0))
        lifted = float(plant.objects()[0, 2])
        return {"name": f"grasp of {OBJECTS[case]} kg, at {lifted:.3f} m in the end"} | told(result)
    if family == "rolled":
        return rolled(ROLLED[case])
    episode = Episode(supervisor, MujocoPlant(SPEC, payload_kg=(1.0, 0.0)), case).run()
    return {"name": str(episode), "fell": episode.fall is not None}


def rolled(mass: float) -> dict:
    """A mass in the left hand, judged by plans and in MuJoCo."""
    config, policy = told_settings(mass), ReplayPolicy(levelled())
    fast = FastChecker(config)
    by_plans = fast.check(policy, "", policy.duration, odds=False)
    episode = EpisodeConfig(settle=0.1, hold=2.5, begin=fast.first_state(policy))
    checker = Checker(config=config, episode=episode, payload_kg=(mass, 0.0))
    truth, _ = checker.check(policy, "", policy.duration)
    worst = truth.violations[0] if truth.violations else None
    found = {
        "plans": by_plans.verdict,
        "simulated": truth.verdict,
        "worst": worst and f"{worst.code} {worst.value:.3g}",
    }
    return {"name": f"{mass} kg in a rolled hand", "fell": truth.fell} | found


def main() -> int:
    """Run what is not in the file yet; 1 if anything fell."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("family", choices=CASES)
    parser.add_argument("--cases", type=int, nargs=2, default=(0, math.inf), metavar=("FIRST", "END"))
    parser.add_argument("--out", type=Path, help="a line of JSON for each case")
    chosen = parser.parse_args()
    done, found, supervisor = {}, [], Supervisor(SPEC)
    if chosen.out is not None and chosen.out.exists():
        lines = [json.loads(line) for line in chosen.out.read_text().splitlines()]
        done = {(line["family"], line["case"]): line for line in lines}
    for case in range(int(chosen.cases[0]), int(min(chosen.cases[1], CASES[chosen.family]))):
        known = done.get((chosen.family, case))
        line = known or {"family": chosen.family, "case": case} | run(chosen.family, case, supervisor)
        found.append(line)
        if known is None and chosen.out is not None:
            with chosen.out.open("a") as file:
                file.write(json.dumps(line) + "\n")
        said = {key: value for key, value in line.items() if key not in ("family", "case", "name", "fell")}
        print(case, "FELL" if line["fell"] else "stands", line["name"], said, flush=True)
    fell = [line["case"] for line in found if line["fell"]]
    print(f"{len(fell)} of {len(found)} fell: {fell}")
    return int(bool(fell))


if __name__ == "__main__":
    sys.exit(main())
