"""Clocks and stamps that step, stand still or are no numbers, and robots that see nothing for 3 s: resumable.

    python benchmarks/clocks.py wave|lissajous|realistic|more|hangs|tour [--seeds FIRST END] [--only PART] [--out FILE]

Each fault (of `CLOCK_FAULTS` in ``tests/support/faulty_loops.py``) begins at each of the phases that are the seeds, 20
in a period; `realistic` is the wave by a realistic robot of that seed, `more` has the wave with all other faults,
`hangs` both scripts with a loop that hangs, of a robot that takes no step and of one that may. In
`tour` one episode goes through all phases: faults that do not end by themselves end after half a period.
Errors are the palms' in the last half second asked for, 3 s after the fault is over or 6 s after it began.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.senses import DT, SPEC, Case, run_studies
from policy.scripted.library import scripted_policy
from tests.support.faulty_loops import CLOCK_FAULTS, FaultyClocks
from wholebody.config import ControllerConfig
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.estimation.state_estimator import StateEstimator
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.robot_errors import REALISTIC_ROBOT, RealisticPlant
from wholebody.sim.sensors import REALISTIC_READINGS, Sensors

FIRST, PERIOD, PHASES = 3.0, np.pi, 20
"""When the first fault begins [s], the period of wave and lissajous [s], and phases in it."""

MAIN = (
    "a state stamped 0.7 s ahead", "stamps 1 s ahead", "stamps 1 s back", "the clock 1 s ahead", "the clock no number",
    "states frozen for 3 s", "states no numbers for 3 s",
)  # fmt: skip
"""Faults that are tried at every phase of both scripts."""


HANGS = "the loop hangs for 0.2 s"
"""Fault of `hangs`."""


@cache
def supervisor(steps: str = "never") -> FaultyClocks:
    """One for all cases."""
    return FaultyClocks(SPEC, ControllerConfig(steps=steps))


def realistic_robot(seed: int) -> tuple[RealisticPlant, Sensors]:
    """The realistic robot of a seed, and what tells of it."""
    sensors = Sensors(SPEC, replace(REALISTIC_READINGS, seed=seed), DT, StateEstimator(SPEC))
    return RealisticPlant(SPEC, replace(REALISTIC_ROBOT, seed=seed), encoders=sensors), sensors


def faulty(script: str, name: str, seed: int, *, realistic: bool = False, steps: str = "never") -> dict[str, float]:
    """A script with one fault of the clocks, and what was said of it."""
    fault, loop = CLOCK_FAULTS[name], supervisor(steps)
    loop.fault, loop.since = fault, FIRST + seed % PHASES * PERIOD / PHASES - 0.5 * DT
    over = loop.since + (fault.seconds + 3.0 if np.isfinite(fault.seconds) else 6.0)
    plant, sensors = realistic_robot(seed) if realistic else (MujocoPlant(SPEC), None)
    policy = scripted_policy(script)
    result = run_episode(policy, loop, plant, duration=over - 1.0, config=EpisodeConfig(hold=2.0), sensors=sensors)
    late = result.errors[result.times > over - 0.5]
    told = sum(seconds for reason, seconds in result.reasons.items() if str(reason).startswith(("clock_", "state_")))
    return {"falls": float(result.fall is not None), "said_s": told} | (
        {"error_mm": 1e3 * float(late.max())} if late.size else {}
    )


def toured(script: str, name: str) -> dict[str, float]:
    """A script in which a fault begins once at every phase, 3 s after the one before was over at least."""
    fault, loop = CLOCK_FAULTS[name], supervisor()
    loop.fault = replace(fault, seconds=PERIOD / 2.0 if np.isinf(fault.seconds) else fault.seconds)
    apart = PERIOD * (np.ceil((loop.fault.seconds + 3.0) / PERIOD - 1.0 / PHASES) + 1.0 / PHASES)
    loop.since = FIRST + apart * np.arange(PHASES) - 0.5 * DT
    duration = float(loop.since[-1]) + loop.fault.seconds + 2.0
    result = run_episode(
        scripted_policy(script), loop, MujocoPlant(SPEC), duration=duration, config=EpisodeConfig(hold=2.0)
    )
    calm = np.array([((result.times > t - 0.5) & (result.times < t)) for t in loop.since[1:]]).any(axis=0)
    numbers = {"falls": float(result.fall is not None), "ended_s": float(result.times[-1])}
    return numbers | ({"error_mm": 1e3 * float(result.errors[calm].max())} if calm.any() else {})


def tour(seeds: range) -> Iterator[Case]:
    """Every fault, in both scripts; phases are no seeds here."""
    for name in MAIN:
        for script in ("wave", "lissajous"):
            yield f"tour, {name}", f"{script}, {name}", partial(toured, script, name)


def scripted(script: str, seeds: range) -> Iterator[Case]:
    """Every fault at every phase."""
    names, real = [name for name in CLOCK_FAULTS if name not in MAIN], script == "realistic"
    for name in names if script == "more" else MAIN:
        for seed in seeds:
            run = partial(faulty, "lissajous" if script == "lissajous" else "wave", name, seed, realistic=real)
            yield f"{script}, {name}", f"{script}, {name}, {seed}", run


def hangs(seeds: range) -> Iterator[Case]:
    """A loop that hangs at every phase of both scripts, without and with a step that catches the robot."""
    for steps in ("never", "recover"):
        for script in ("lissajous", "wave"):
            for seed in seeds:
                run = partial(faulty, script, HANGS, seed, steps=steps)
                yield f"{script}, hangs, steps {steps}", f"{script}, hangs, steps {steps}, {seed}", run


if __name__ == "__main__":
    kinds = {name: partial(scripted, name) for name in ("wave", "lissajous", "realistic", "more")}
    run_studies(kinds | {"hangs": hangs, "tour": tour}, __doc__)
