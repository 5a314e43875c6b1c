"""The realistic robot of many seeds: how far its estimate drifts while it stands, and recorded motions. Resumable.

    python benchmarks/realistic.py drift [--seeds FIRST END] [--out FILE]
    G1_MOTIONS=FOLDER python benchmarks/realistic.py motions [--seeds FIRST END] [--out FILE]

Lissajous, reaches and hostile chunks of the same robot: ``benchmarks/senses.py``, whose options these have too.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.senses import Case, realistic_plant, run_studies, told

sys.path.insert(0, str(Path(__file__).parents[1]))

from policy.recorded.replay import open_recording
from wholebody.robot.standing import has_lost_standing
from wholebody.sim.robot_errors import REALISTIC_ROBOT
from wholebody.sim.sensors import REALISTIC_READINGS
from wholebody.verdict.check import Checker

SECONDS, EVERY = 61.0, 50
"""Length of standing [s], and number of errors that are kept a second; a minute counts, after the first second."""
BARRED = ("B_Fence1", "B_WiggleDance", "B_HandsChop", "J_ShortDance13_SingleLadies")
"""Recorded motions that are to be followed, by name; of the others it is asked that the robot stands."""


def standing(seed: int) -> dict[str, float]:
    """A minute of standing: how far the error of the estimated pelvis goes from what it was after a second."""
    supervisor = told()
    plant = realistic_plant(supervisor, seed)
    try:
        state = plant.reset()
        supervisor.reset(state)
        while state.time < SECONDS and not has_lost_standing(state):
            state = plant.step(supervisor.step(state))
        bias, offs = supervisor.sensors.estimator.gyro_bias.copy(), np.array(supervisor.pelvis)[EVERY:]
    finally:
        supervisor.sensors = None
    drift = np.abs(offs - offs[0])
    return {
        "falls": float(has_lost_standing(state)),
        "drift_mm": 1e3 * float(np.linalg.norm(drift[:, :3], axis=1).max()),
        "yaw_deg": float(np.rad2deg(drift[:, 3].max())),
        "gyro_bias_mrad_s": 1e3 * float(np.linalg.norm(bias)),
    }


def motion(name: str, seed: int) -> dict[str, float]:
    """A recorded motion, whole."""
    errors, readings = replace(REALISTIC_ROBOT, seed=seed), replace(REALISTIC_READINGS, seed=seed)
    policy = open_recording(Path(os.environ["G1_MOTIONS"]) / f"{name}.csv")
    verdict, _ = Checker(errors=errors, sensors=readings).check(policy, name, policy.duration)
    numbers = {"falls": float(verdict.fell), "damping_s": verdict.seconds.get("damping", 0.0)}
    return numbers | {"within_20mm": verdict.within_20mm, "time_factor": verdict.time_factor}


def drift(seeds: range) -> Iterator[Case]:
    """Standing."""
    for seed in seeds:
        yield "standing", f"standing, {seed}", partial(standing, seed)


def motions(seeds: range) -> Iterator[Case]:
    """Those that are to be followed, then the others of the folder."""
    files = sorted(file.stem for file in Path(os.environ["G1_MOTIONS"]).glob("*.csv"))
    others = [name for name in files if name not in BARRED]
    for group, names in (("to be followed", BARRED), ("others", others)):
        for seed in seeds:
            for name in names:
                yield f"{group}: {name}", f"{name}, {seed}", partial(motion, name, seed)


if __name__ == "__main__":
    run_studies({"drift": drift, "motions": motions}, __doc__)
