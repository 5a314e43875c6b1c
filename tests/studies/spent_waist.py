"""Who falls of robots that leave their plan where the waist cannot hold what is above it.

``python -m tests.studies.spent_waist`` puts the robot into random leans, arms ahead or raised, in which gravity asks
for 33 to 40 N m of the waist's pitch motor, which has 35 and of which plans use 31; there it is off its plan, at rest.
"""

from __future__ import annotations

import argparse

import mujoco
import numpy as np
import pinocchio as pin

from models import g1
from tests.support.body_cases import leaning
from wholebody.execution.states import Event
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.state import Robot
from wholebody.sim.fall import detect_fall
from wholebody.sim.plant import MujocoPlant

ASKED = 33.0, 40.0
"""Least and most that gravity asks of the waist's pitch motor [N m]."""


def posture(robot: Robot, pelvis: float, waist: float, shoulder: float, elbow: float, yaw: float) -> np.ndarray:
    """A lean, both arms alike: configuration (nq,); angles [rad]."""
    q = leaning(robot, pelvis, waist)
    angles = {"waist_yaw_joint": yaw}
    angles |= {f"{side}_shoulder_pitch_joint": shoulder for side in ("left", "right")}
    angles |= {f"{side}_elbow_joint": elbow for side in ("left", "right")}
    for name, angle in angles.items():
        q[7 + robot.joint_names.index(name)] = angle
    return q


def asked(robot: Robot, q: np.ndarray) -> float:
    """Torque that gravity asks of the waist's pitch motor [N m]."""
    gravity = pin.computeGeneralizedGravity(robot.model, robot.scratch, q)[6:]
    return float(abs(gravity[robot.joint_names.index("waist_pitch_joint")]))


def postures(robot: Robot, count: int, seed: int = 0) -> list[np.ndarray]:
    """So many of them, drawn."""
    rng, found = np.random.default_rng(seed), []
    while len(found) < count:
        q = posture(robot, *rng.uniform((0.4, 0.0, -2.7, 0.0, -0.8), (0.65, 0.4, -0.8, 1.4, 0.8)))
        if ASKED[0] < asked(robot, q) < ASKED[1]:
            found.append(q)
    return found


def fall(supervisor: Supervisor, plant: MujocoPlant, q: np.ndarray, seconds: float = 3.0) -> object | None:
    """How the robot falls that is off its plan there, or None."""
    plant.reset()
    plant._conversion.to_mujoco(q, np.zeros(supervisor.robot.nv), plant.data.qpos, plant.data.qvel)
    mujoco.mj_forward(plant.model, plant.data)
    state = plant.state()
    supervisor.reset(state)
    supervisor._states.on(Event.TAKEN_OVER)
    supervisor._reflex.stand(state, state.time)
    while state.time < seconds:
        state = plant.step(supervisor.step(state))
        if (found := detect_fall(plant, state, supervisor.status.status)) is not None:
            return found
    return None


def main() -> None:
    """Print a line each, and how many fell."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=40)
    supervisor, plant, robot = Supervisor(g1()), MujocoPlant(g1()), Robot(g1())
    found = []
    for i, q in enumerate(postures(robot, parser.parse_args().count)):
        found.append(fall(supervisor, plant, q))
        print(i, f"{asked(robot, q):.1f} N m:", found[-1] or "stands", flush=True)
    print(f"{sum(one is not None for one in found)} of {len(found)} fell")


if __name__ == "__main__":
    main()
