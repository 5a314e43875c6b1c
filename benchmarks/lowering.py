"""Robots that are lowered in the middle of something, then left with their last command for a minute: resumable.

    python benchmarks/lowering.py true|realistic|raised [--seeds FIRST END] [--only PART] [--out FILE]

A seed draws the script, wave, lissajous or one of five reaches, and when it is ended by `Supervisor.lower`, 1 to 7 s
after its beginning. `contact_m_s` is the speed of the fastest body, feet left out, that touches anything. `raised` is
the realistic robot that stands up again instead.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path

import mujoco
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.clocks import realistic_robot
from benchmarks.senses import DT, REACHES, SPEC, Case, run_studies
from policy.base import Policy
from policy.scripted.library import reach, scripted_policy
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.standing import has_lost_standing
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.sensors import Sensors
from wholebody.types import JointCommand, RobotState

LONGEST, KEPT = 12.0, 60.0
"""Longest time until the robot is lowered, and for which its last command is kept then [s]."""


class Ended(Supervisor):
    """A supervisor that begins with a robot that does something already.

    Attributes:
        command: The last one.
    """

    command: JointCommand

    def step(self, state: RobotState, now: float | None = None) -> JointCommand:
        """As of `Supervisor`."""
        self.command = super().step(state, now)
        return self.command


class Watched:
    """A plant that is stepped, and what touched what in it."""

    def __init__(self, plant: MujocoPlant, sensors: Sensors | None) -> None:
        self.plant, self.sensors, self.contact, self.touched = plant, sensors, 0.0, set()

    def step(self, command: JointCommand) -> RobotState:
        """One control period; the true state."""
        state = self.plant.step(command)
        for pair in self.plant.contacts():
            self.touched.add(pair)
            for body in pair:
                if self.plant.is_robot(body) and "ankle" not in body:
                    self.contact = max(self.contact, self._speed(body))
        return state

    def measured(self, state: RobotState) -> RobotState:
        """What the controller is told of it."""
        return state if self.sensors is None else self.sensors.measure(state)

    def _speed(self, body: str) -> float:
        speed, model = np.zeros(6), self.plant.model
        kind, index = mujoco.mjtObj.mjOBJ_BODY, model.body(body).id
        mujoco.mj_objectVelocity(model, self.plant.data, kind, index, speed, 0)
        return float(np.linalg.norm(speed[3:]))


@cache
def supervisor() -> Ended:
    """One for all cases."""
    return Ended(SPEC)


def drawn(seed: int) -> tuple[Policy, float]:
    """A script, and for how long it is followed [s]."""
    rng = np.random.default_rng(seed)
    kind = int(rng.integers(2 + len(REACHES)))
    policy = scripted_policy(("wave", "lissajous")[kind]) if kind < 2 else reach(*REACHES[kind - 2])
    return policy, float(rng.uniform(1.0, 7.0))


def lowered(seed: int, *, realistic: bool, raised: bool = False) -> dict[str, float]:
    """One robot that is lowered, and kept or raised."""
    loop, (policy, seconds) = supervisor(), drawn(seed)
    plant, sensors = realistic_robot(seed) if realistic else (MujocoPlant(SPEC), None)
    before = run_episode(policy, loop, plant, duration=seconds, config=EpisodeConfig(hold=0.0), sensors=sensors)
    watched, state = Watched(plant, sensors), plant.step(loop.command)
    begin, fell = state.time, before.fall is not None
    loop.lower()
    while not fell and not loop.lowered and state.time < begin + LONGEST:
        state = watched.step(loop.step(watched.measured(state), state.time))
        fell = has_lost_standing(state)
    numbers = {"lowered": float(loop.lowered), "seconds": state.time - begin, "height_m": float(state.q[2])}
    if raised:
        return numbers | stood_up(watched, loop, state)
    q, end = state.q.copy(), state.time + KEPT
    while not fell and state.time < end:
        state = watched.step(loop.command)
        fell = has_lost_standing(state)
    moved = float(np.abs(state.q[7:] - q[7:]).max()) if not fell else np.inf
    fell = fell or not numbers["lowered"] or watched.contact > 0.5
    return {"falls": float(fell), "contact_m_s": watched.contact, "moved_mrad": 1e3 * moved} | numbers


def stood_up(watched: Watched, loop: Ended, state: RobotState) -> dict[str, float]:
    """Stand up from the crouch."""
    begin, fell = state.time, False
    loop.raise_()
    while not fell and loop.status.reason != "no_chunk" and state.time < begin + LONGEST:
        state = watched.step(loop.step(watched.measured(state), state.time))
        fell = has_lost_standing(state)
    seconds = state.time - begin
    return {"falls": float(fell or seconds > LONGEST - DT), "contact_m_s": watched.contact, "up_s": seconds}


def studied(kind: str, seeds: range) -> Iterator[Case]:
    """One case a seed."""
    for seed in seeds:
        yield kind, f"{kind}, {seed}", partial(lowered, seed, realistic=kind != "true", raised=kind == "raised")


if __name__ == "__main__":
    run_studies({kind: partial(studied, kind) for kind in ("true", "realistic", "raised")}, __doc__)
