"""How many times faster than real time controller and physics are together, on one core, and the memory they take."""

from __future__ import annotations

import resource
import sys
from dataclasses import dataclass, field
from time import thread_time_ns

import mujoco
import numpy as np

from models import g1
from policy.base import Policy
from policy.scripted.library import scripted_policy
from wholebody.episode.run import observe
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.types import RobotState

SETTLE = 1.0
"""Standing before the first chunk [s]; chosen: as in `EpisodeConfig`."""
REPLACE_EVERY = 25
"""Steps of a chunk after which the next one is asked for."""


@dataclass
class _Parts:
    """Thread CPU time of every tick [ns], and of every plan."""

    replayed: bool = True
    """Whether MuJoCo's steps are made once more, so that what they began with is kept."""
    controller: list[int] = field(default_factory=list)
    plant: list[int] = field(default_factory=list)
    plans: list[int] = field(default_factory=list)
    before: list[np.ndarray] = field(default_factory=list)
    """What MuJoCo's step began with: positions, speeds, accelerations of the step before and torques."""


def bench_loop(policy: str, seconds: float, *, hands: bool = True) -> dict:
    """Follow a scripted policy in MuJoCo and time controller and plant; planning is timed apart.

    A control period is `Supervisor.step` and `MujocoPlant.step`: everything between two states of the robot, with the
    position loops of the motors, but without tracking errors and recording. Thread CPU time.

    Args:
        policy: Name of a scripted policy.
        seconds: Simulated time after the settling time [s].
        hands: Whether the robot has its Dex3 hands.

    Returns:
        ``real_time``: control period over mean time of a period, once with the mean and once with the median (times
        between two interrupts of the machine); distributions of controller, plant, and MuJoCo's own steps once more
        by themselves [us]; ``plan_ms``: median time of a plan.
    """
    spec = g1(hands)
    supervisor, plant, parts = Supervisor(spec), MujocoPlant(spec), _Parts()
    _episode(scripted_policy(policy), supervisor, plant, seconds, parts)
    both = np.array(parts.controller) + np.array(parts.plant)
    return {
        "policy": policy,
        "ticks": len(both),
        "real_time": {
            "mean": round(1e9 * plant.control_dt / float(both.mean()), 2),
            "median": round(1e9 * plant.control_dt / float(np.median(both)), 2),
        },
        "controller_us": _summary(parts.controller),
        "plant_us": _summary(parts.plant),
        "physics_us": _summary(_replay(plant.model, parts.before)),
        "plan_ms": round(1e-6 * float(np.median(parts.plans)), 2) if parts.plans else None,
    }


def bench_memory(policy: str, ticks: int, *, hands: bool = True) -> dict:
    """Follow a scripted policy over and over again in MuJoCo: how much memory controller and plant take.

    Args:
        policy: Name of a scripted policy.
        ticks: How many, rounded up to whole runs of the policy; each run begins with the settling time.
        hands: Whether the robot has its Dex3 hands.

    Returns:
        ``first_mb``, ``last_mb``: the largest resident size of the process up to the end of the first run and of the
        last one [MB]; ``ticks`` made until then.
    """
    spec, script, sizes, made = g1(hands), scripted_policy(policy), [], 0
    supervisor, plant = Supervisor(spec), MujocoPlant(spec)
    while made < ticks:
        parts = _Parts(replayed=False)
        _episode(script, supervisor, plant, script.duration, parts)
        made += len(parts.controller)
        sizes.append(_largest_size())
    return {"policy": policy, "ticks": made, "runs": len(sizes), "first_mb": sizes[0], "last_mb": sizes[-1]}


def _largest_size() -> float:
    """Largest resident size of this process up to now [MB]; the system counts in KiB, macOS in bytes."""
    unit = 1 if sys.platform == "darwin" else 1024
    return round(1e-6 * unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, 1)


def _episode(policy: Policy, supervisor: Supervisor, plant: MujocoPlant, seconds: float, parts: _Parts) -> None:
    """Stand for the settling time, then follow a policy for a time [s] and fill in the parts."""
    state = plant.reset()
    supervisor.reset(state)
    while state.time < SETTLE - 1e-9:
        state = plant.step(supervisor.step(state))
    _follow(policy, supervisor, plant, state, seconds, parts)


def _follow(
    policy: Policy, supervisor: Supervisor, plant: MujocoPlant, state: RobotState, seconds: float, parts: _Parts
) -> None:
    """Follow a policy for a time [s], and fill in the parts."""
    data, end, due = plant.data, state.time + seconds, state.time
    policy.reset()
    while state.time < end - 1e-9:
        if state.time >= due - 1e-9:
            chunk = policy.infer(observe(plant.spec, supervisor, state))
            begin = thread_time_ns()
            supervisor.accept(chunk)
            parts.plans.append(thread_time_ns() - begin)
            due += REPLACE_EVERY / chunk.fps
        before = np.concatenate([data.qpos, data.qvel, data.qacc_warmstart])
        begin = thread_time_ns()
        command = supervisor.step(state)
        middle = thread_time_ns()
        state = plant.step(command)
        after = thread_time_ns()
        parts.controller.append(middle - begin)
        parts.plant.append(after - middle)
        if parts.replayed:
            parts.before.append(np.concatenate([before, data.ctrl]))


def _replay(model: mujoco.MjModel, before: list[np.ndarray]) -> list[int]:
    """MuJoCo's own steps alone, once more from the same states: their times [ns]."""
    data, times = mujoco.MjData(model), []
    for row in before:
        parts = np.split(row, np.cumsum([model.nq, model.nv, model.nv]))
        for array, part in zip((data.qpos, data.qvel, data.qacc_warmstart, data.ctrl), parts, strict=True):
            array[:] = part
        begin = thread_time_ns()
        mujoco.mj_step(model, data)
        times.append(thread_time_ns() - begin)
    return times


def _summary(nanoseconds: list[int]) -> dict[str, float]:
    a = 1e-3 * np.array(nanoseconds)
    least, p10, p50, p99 = np.percentile(a, [0, 10, 50, 99])
    return {"min": round(least, 1), "p10": round(p10, 1), "p50": round(p50, 1), "p99": round(p99, 1)}
