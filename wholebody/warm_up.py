"""Compile everything that a control tick and a plan need, once: later runs load it from numba's cache on disk."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from models.g1 import g1
from models.pinocchio_model import stance_q
from policy.scripts import scripted
from wholebody.runtime import observe
from wholebody.supervisor import Supervisor
from wholebody.types import RobotState


def warm_up() -> float:
    """Plan one chunk and make a few ticks, without physics.

    Returns:
        How long it took [s]: about a minute with a cold cache, a few seconds with a warm one.
    """
    begin = perf_counter()
    spec = g1()
    supervisor = Supervisor(spec)
    state = RobotState(0.0, stance_q(spec, supervisor.robot.model), np.zeros(supervisor.robot.nv))
    supervisor.reset(state)
    supervisor.accept(scripted("wave").infer(observe(spec, supervisor, state)))
    for _ in range(3):
        supervisor.step(state)
    return perf_counter() - begin
