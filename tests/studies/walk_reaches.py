"""Palms 0.5 to 1.5 m away at 0.3 to 1.4 m height: the supervisor finds where to stand, walks there and reaches.

    python -m tests.studies.walk_reaches 0 8
    python -m tests.studies.walk_reaches 0 8 --realistic

A line a seed; the last one counts. The bar is 2 mm within 4 s + 4 s a metre of the way of the base. The state is true,
or estimated in a realistic world; palms are measured by the true joints, the base taken as the controller sees it.
"""

import argparse
from math import hypot

import numpy as np

from policy.geometry.rotations import rotvec_to_matrix
from policy.scripted.policy import ScriptedMotion, stance_pose, to_chunk
from tests.support.walks import worlds
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.fall import detect_fall
from wholebody.sim.plant import MujocoPlant

CONFIG = ControllerConfig(steps="reach")
NEAR, ASKED, LONGEST = 0.002, 0.4, 16.0
"""What counts as reached [m], time of the first chunk, and after which a run ends [s]."""


def pair(seed):
    """Palm points of a seed, (2, 3) [m], and the turn of both hands about the vertical [rad]."""
    rng = np.random.default_rng((39, seed))
    far, way, z = rng.uniform(0.5, 1.5), rng.uniform(-np.pi / 3, np.pi / 3), rng.uniform(0.3, 1.4)
    turn = way + rng.uniform(-0.3, 0.3)
    aside = 0.16 * np.array([-np.sin(turn), np.cos(turn), 0.0])
    middle = np.array([far * np.cos(way), far * np.sin(way), z])
    return np.stack([middle + aside, middle - aside]), turn


def chunk(palms, turn, seq, now):
    """A chunk whose hands are there from its first step on."""
    stance = stance_pose()
    R = rotvec_to_matrix(np.array([0.0, 0.0, turn]))
    hands = R @ stance.R_world_lhand, R @ stance.R_world_rhand
    motion = ScriptedMotion(*(np.tile(p, (50, 1)) for p in palms), *hands, stance.q_lhand, stance.q_rhand)
    return to_chunk(motion, "wbc32", seq, now, 30.0, 50)


def run(seed, realistic):
    spec, (palms, turn) = describe(CONFIG.robot), pair(seed)
    plant, sensors = worlds(seed, spec) if realistic else (MujocoPlant(spec), None)
    supervisor, state = Supervisor(spec, CONFIG), plant.reset()
    if sensors is not None:
        sensors.reset()
    measured = state if sensors is None else sensors.measure(state)
    supervisor.reset(measured, state.time)
    seq, next_chunk, reached, most, fall, dropped = 0, ASKED, None, 0.0, None, 0
    while state.time < LONGEST and fall is None and (reached is None or state.time < reached + 2.0):
        if state.time >= next_chunk:
            supervisor.accept(chunk(palms, turn, seq, state.time), state.time)
            seq, next_chunk = seq + 1, next_chunk + 0.5
        command = supervisor.step(measured, state.time)
        dropped += supervisor.last_tick.level.name != "FULL"
        if sensors is not None:
            sensors.estimator.expect(supervisor.contacts)
        state = plant.step(command)
        q = state.q.copy()
        q[:7] = measured.q[:7]
        supervisor.robot.place(q, state.v)
        places = [supervisor.robot.pose(tool.palm_frame).translation for tool in spec.tools]
        off = max(np.linalg.norm(a - b) for a, b in zip(places, palms, strict=True))
        if off < NEAR and reached is None:
            reached, most = state.time, 0.0
        most = max(most, off)
        measured = state if sensors is None else sensors.measure(state)
        fall = detect_fall(plant, state, supervisor.status.status)
    x, y, heading = supervisor.base
    return palms, (x, y, heading), reached, off, fall, dropped, supervisor.status


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    parser.add_argument("--realistic", action="store_true", help="seeds of realistic worlds, the state estimated")
    given = parser.parse_args()
    rows = []
    for seed in range(given.first, given.last):
        palms, base, reached, off, fall, dropped, status = run(seed, given.realistic)
        way = hypot(*base[:2])
        took = np.inf if reached is None else reached - ASKED
        rows.append((fall is not None, reached is not None, took <= 4.0 + 4.0 * way, took, way))
        x, y, z = palms.mean(axis=0)
        said = "" if fall is None else f"; fell: {fall.cause} at {fall.time:.2f} s"
        print(
            f"{seed}: palms ({x:.2f}, {y:.2f}, {z:.2f}), base ({base[0]:.2f}, {base[1]:.2f}, {base[2]:.2f}); "
            f"within 2 mm after {took:.2f} s of {4.0 + 4.0 * way:.2f}; {1e3 * off:.3f} mm at the end; {dropped} ticks "
            f"not whole; {status.reason}{said}",
            flush=True,
        )
    fell, there, soon, took, _ = np.array(rows, dtype=float).T
    print(
        f"{int(fell.sum())} of {len(rows)} fell, {int(there.sum())} within 2 mm, {int(soon.sum())} in time; "
        f"median {np.median(took):.2f} s"
    )


if __name__ == "__main__":
    main()
