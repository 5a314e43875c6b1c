"""What the estimator and the observer of loads cost a tick: three loops on the same readings, a tick of each in turn.

    python benchmarks/estimator.py [--ticks N]

`tick` is the supervisor that is told state and loads, `observing` one that observes the loads, `estimating` what makes
the state of the readings. Prints times in microseconds, and how much the last two add to the first, in the median of
all ticks and in the fastest quarter, which a busy computer disturbs least.
"""

from __future__ import annotations

import argparse
import gc
from time import perf_counter_ns

import numpy as np

from models import g1
from wholebody.config import ControllerConfig, LoadConfig
from wholebody.estimation.state_estimator import StateEstimator
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.sensors import REALISTIC_READINGS, Sensors

WARM_UP = 500
"""Ticks that do not count."""


def times(ticks: int) -> dict[str, np.ndarray]:
    """Times of each part at each tick [us]."""
    spec, dt = g1(), 0.002
    told, observing = Supervisor(spec, ControllerConfig(loads=LoadConfig(source="told"))), Supervisor(spec)
    plant, estimator = MujocoPlant(spec), StateEstimator(spec)
    sensors = Sensors(spec, REALISTIC_READINGS, dt, estimator)
    state = plant.reset()
    told.reset(state)
    observing.reset(state)
    parts = {
        "tick": lambda: told.step(state, state.time),
        "observing": lambda: observing.step(state, state.time),
        "estimating": lambda: estimator.estimate(readings),
    }
    names, found = list(parts), {name: np.zeros(ticks) for name in parts}
    gc.disable()
    for k in range(-WARM_UP, ticks):
        readings, answers = sensors.read(state), {}
        for name in names[k % 3 :] + names[: k % 3]:
            begin = perf_counter_ns()
            answers[name] = parts[name]()
            took = perf_counter_ns() - begin
            if k >= 0:
                found[name][k] = 1e-3 * took
        state = plant.step(answers["observing"])
    return found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ticks", type=int, default=6000)
    found = times(parser.parse_args().ticks)
    for said, share in (("median", 50.0), ("fastest quarter", 25.0)):
        tick, observing, estimating = (float(np.percentile(found[name], share)) for name in found)
        added = (observing + estimating) / tick - 1.0
        print(f"{said}: tick {tick:.1f}, observing {observing:.1f}, estimating {estimating:.1f} us: {added:+.1%}")


if __name__ == "__main__":
    main()
