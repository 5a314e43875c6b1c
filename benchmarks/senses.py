"""What bad readings, a realistic robot, delay, friction, other masses and uneven ground cost: studies, resumable.

    python benchmarks/senses.py STUDY [--seeds FIRST END] [--only PART] [--out FILE]

Studies: glitches, delay, realistic, hostile, friction, masses, ground (floors that slope, a foot that stands higher,
feet that are turned, a wrong IMU). Each case is a line of JSON in the file, which is ``senses_STUDY.jsonl`` if not
given; cases that it has are not run again. At the end: median and worst of each number.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pinocchio as pin

sys.path.insert(0, str(Path(__file__).parents[1]))

from models import g1
from policy.scripted.library import reach, scripted_policy
from tests.support.faulty_loops import FaultyStates, bent, not_a_number, pitched, zeros
from tests.support.grounds import Ground
from tests.support.hostile_chunks import Episode
from tests.support.resumable import finished
from wholebody.episode.run import run_episode
from wholebody.estimation.state_estimator import StateEstimator
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.robot_errors import REALISTIC_ROBOT, RealisticPlant, RobotErrors
from wholebody.sim.sensors import REALISTIC_READINGS, SensorConfig, Sensors
from wholebody.types import RobotState

SPEC, DT = g1(), 0.002
REACHES = ((0.40, 0.30), (0.45, 0.60), (0.50, 1.00), (0.40, 1.40), (0.25, 1.50))
PHASES = 3.0 + 1.05 * np.arange(20)
"""Times of glitches [s]: 20 phases of the lissajous, whose period is 3.14 s."""
GLITCHES = {"nan": not_a_number, "zeros": zeros, "pitch +70": pitched(1.2217), "pitch -70": pitched(-1.2217)}
GLITCHES |= {f"joint {joint} {angle:+g} rad": bent(joint, angle) for joint in (3, 14, 20) for angle in (3.0, -3.0)}
Case = tuple[str, str, Callable[[], dict[str, float]]]
"""Group, name, and what gives its numbers."""


class Told(Supervisor):
    """A supervisor that is told of a true state what sensors make of it, or an IMU that is wrong.

    Attributes:
        sensors: They, or None.
        turn: Of the true state, about the origin of world, into what the IMU says.
        own: Distances of the palms by the measured joints from the command, in the estimated pelvis [m].
        floor: Distances of the palms by the measured state from the true ones [m].
        pelvis: Errors of its measured position [m] and yaw [rad], four each.
    """

    sensors: Sensors | None = None
    turn = pin.SE3.Identity()

    def reset(self, state: RobotState, now: float | None = None) -> None:
        """Begin with what is told of a true state."""
        if self.sensors is not None:
            self.sensors.reset()
        self.own, self.floor, self.pelvis = [], [], []
        super().reset(self._told(state), state.time)

    def step(self, state: RobotState, now: float | None = None):
        """As of `Supervisor`."""
        told = self._told(state)
        command = super().step(told, state.time)
        if self.sensors is not None and round(state.time / DT) % 10 == 0:
            self._compare(state, told)
        return command

    def _told(self, state: RobotState) -> RobotState:
        if self.sensors is not None:
            return self.sensors.measure(state)
        T = self.turn * pin.XYZQUATToSE3(state.q[:7])
        return replace(state, q=np.concatenate([pin.SE3ToXYZQUAT(T), state.q[7:]]))

    def _compare(self, state: RobotState, told: RobotState) -> None:
        true, seen = self._palms(state.q), self._palms(told.q)
        asked = np.array([palm[:3, 3] for palm in self.palm_reference().values()])
        self.own.append(np.linalg.norm(asked - seen, axis=1))
        self.floor.append(np.linalg.norm(true - seen, axis=1))
        R_seen, R_true = (pin.Quaternion(q[3:7]).toRotationMatrix() for q in (told.q, state.q))
        self.pelvis.append(np.append(told.q[:3] - state.q[:3], pin.log3(R_seen @ R_true.T)[2]))

    def _palms(self, q: np.ndarray) -> np.ndarray:
        model, data = self.robot.model, _data()
        pin.framesForwardKinematics(model, data, q)
        return np.array([data.oMf[self.robot.frame_id(tool.palm_frame)].translation for tool in SPEC.tools])


@cache
def _data() -> pin.Data:
    return told().robot.model.createData()


@cache
def told() -> Told:
    """One for all cases."""
    return Told(SPEC)


@cache
def faulty() -> FaultyStates:
    """Likewise."""
    return FaultyStates(SPEC)


def lissajous(supervisor: Supervisor, plant: MujocoPlant, sensors: Sensors | None = None) -> tuple[dict, np.ndarray]:
    """Numbers of a run, and the errors of both palms at the steps of the 20 s that count [m]."""
    policy = scripted_policy("lissajous")
    result = run_episode(policy, supervisor, plant, duration=policy.duration, sensors=sensors)
    errors = result.errors[(result.times >= 3.0) & (result.times < 23.0)]
    numbers = {"falls": float(result.fall is not None), "damping_s": result.seconds.get("damping", 0.0)}
    if errors.size:
        numbers |= {"rms_mm": 1e3 * float(np.sqrt((errors**2).mean())), "max_mm": 1e3 * float(errors.max())}
    return numbers, errors


@cache
def clean() -> np.ndarray:
    """Errors of the lissajous without a fault."""
    faulty().times = ()
    return lissajous(faulty(), MujocoPlant(SPEC))[1]


def glitch(name: str, ticks: int) -> dict[str, float]:
    """The lissajous with a fault at 20 of its phases."""
    without, supervisor = clean(), faulty()
    supervisor.times, supervisor.seconds = tuple(PHASES - 0.5 * DT), DT * ticks
    supervisor.fault = GLITCHES[name]
    numbers, errors = lissajous(supervisor, MujocoPlant(SPEC))
    if errors.shape == without.shape:
        numbers["added_to_peak_mm"] = 1e3 * float(errors.max() - without.max())
        numbers["added_at_most_mm"] = 1e3 * float((errors - without).max())
    return numbers


def delayed(delay: float, misjudged: float) -> dict[str, float]:
    """The lissajous on states of that age [s], known but for an error [s]."""
    sensors = Sensors(SPEC, SensorConfig(delay=delay, delay_misjudged=misjudged), DT)
    return lissajous(Supervisor(SPEC), MujocoPlant(SPEC), sensors)[0]


def realistic_plant(supervisor: Told, seed: int, payload: float | None = None) -> RealisticPlant:
    """The realistic robot of a seed; the supervisor is told what its sensors say."""
    errors = replace(REALISTIC_ROBOT, seed=seed)
    errors = errors if payload is None else replace(errors, payload_max=payload)
    readings = replace(REALISTIC_READINGS, seed=seed)
    supervisor.sensors = Sensors(SPEC, readings, DT, StateEstimator(SPEC))
    return RealisticPlant(SPEC, errors, encoders=supervisor.sensors)


def realistic(seed: int, payload: float | None, place: tuple[float, float] | None) -> dict[str, float]:
    """The lissajous, or a reach, of the realistic robot; palms in world, in its own frame, and what nobody can help."""
    supervisor = told()
    plant = realistic_plant(supervisor, seed, payload)
    try:
        if place is None:
            numbers = lissajous(supervisor, plant)[0]
        else:
            policy = reach(*place)
            result = run_episode(policy, supervisor, plant, duration=policy.duration)
            numbers = {"falls": float(result.fall is not None), "end_mm": 1e3 * float(result.errors[-1].max())}
            numbers["floor_end_mm"] = 1e3 * float(supervisor.floor[-1].max())
        for name in ("own", "floor"):
            part = np.array(getattr(supervisor, name))[150:]
            numbers[f"{name}_rms_mm"] = 1e3 * float(np.sqrt((part**2).mean()))
    finally:
        supervisor.sensors = None
    return numbers


def hostile(case: int, plant: Callable[[], MujocoPlant]) -> dict[str, float]:
    """A hostile case on some plant."""
    supervisor = told()
    try:
        result = Episode(supervisor, plant(), case).run()
    finally:
        supervisor.sensors = None
    return {"falls": float(result.fall is not None), "tilt_deg": float(np.rad2deg(result.tilt))}


def on_ground(place: tuple[float, float], ground: dict[str, float]) -> dict[str, float]:
    """A reach where the robot stands so."""
    policy = reach(*place)
    result = run_episode(policy, told(), Ground(SPEC, **ground), duration=policy.duration)
    return {"falls": float(result.fall is not None), "end_mm": 1e3 * float(result.errors[-1].max())}


def wrong_imu(turn: pin.SE3) -> dict[str, float]:
    """The lissajous with an IMU that is wrong by a turn."""
    supervisor = told()
    supervisor.turn = turn
    try:
        return lissajous(supervisor, MujocoPlant(SPEC))[0]
    finally:
        supervisor.turn = pin.SE3.Identity()


def lean(angle: float, direction: float) -> pin.SE3:
    """Turn of a robot whose IMU is wrong by an angle, as if the floor rose towards a direction [rad]."""
    return pin.SE3(pin.exp3(angle * np.array([np.sin(direction), -np.cos(direction), 0.0])), np.zeros(3))


def wrong_model(place: tuple[float, float], errors: RobotErrors) -> dict[str, float]:
    """A reach of a robot with other masses."""
    policy = reach(*place)
    result = run_episode(policy, told(), RealisticPlant(SPEC, errors), duration=policy.duration)
    return {"falls": float(result.fall is not None), "end_mm": 1e3 * float(result.errors[-1].max())}


def glitches(_: range) -> Iterator[Case]:
    """Faults of each kind, for one tick and for ten."""
    for name in GLITCHES:
        for ticks in (1, 10):
            yield f"{ticks} ticks", f"{name}, {ticks}", partial(glitch, name, ticks)


def delay(_: range) -> Iterator[Case]:
    """Known delays, and misjudged ones."""
    for ms in (0, 2, 5, 10, 15, 20):
        for wrong in (0, 5, -5):
            group = f"{ms} ms, misjudged by {wrong}"
            yield group, group, partial(delayed, 1e-3 * ms, 1e-3 * wrong)


def realistic_robot(seeds: range) -> Iterator[Case]:
    """Lissajous and reaches."""
    for seed in seeds:
        for payload, said in ((None, "loaded"), (0.0, "no load")):
            yield f"lissajous, {said}", f"lissajous, {said}, {seed}", partial(realistic, seed, payload, None)
            for place in REACHES:
                group = f"reach {place[0]:.2f} {place[1]:.2f}, {said}"
                yield group, f"{group}, {seed}", partial(realistic, seed, payload, place)


def hostile_chunks(seeds: range) -> Iterator[Case]:
    """Hostile cases 0 to 99 on the realistic robot."""
    for seed in seeds:
        for case in range(100):
            yield "realistic", f"{case}, seed {seed}", partial(hostile, case, partial(realistic_plant, told(), seed))


def friction(seeds: range) -> Iterator[Case]:
    """Hostile cases on floors that nobody knows; the seeds are the cases."""
    for coefficient in (0.4, 0.6, 0.8, 1.0):
        for case in seeds:
            plant = partial(MujocoPlant, SPEC, friction=coefficient)
            yield f"{coefficient}", f"{coefficient}, {case}", partial(hostile, case, plant)


def masses(seeds: range) -> Iterator[Case]:
    """Reaches with other masses, or another centre of mass of the torso."""
    for seed in seeds:
        for place in REACHES:
            for name, error in (("mass_error", 0.1), ("torso_error", 0.02)):
                errors = RobotErrors(seed=seed, **{name: error})
                yield f"{name} {error}", f"{name} {error}, {place}, {seed}", partial(wrong_model, place, errors)


def grounds(seeds: range) -> Iterator[Case]:
    """Reaches and hostile cases, which are the seeds, on floors and feet as they may be; an IMU that is wrong."""
    ways = {f"{45 * k} deg": k * np.pi / 4.0 for k in range(8)}
    kinds = {
        f"slope of 5 deg towards {name}": {"slope": np.deg2rad(5.0), "direction": way} for name, way in ways.items()
    }
    kinds |= {"left foot 1 cm higher": {"step": 0.01}, "feet turned by 0.1 rad": {"turn": 0.1}}
    for name, ground in kinds.items():
        for place in REACHES:
            yield f"{name}, reaches", f"{name}, reach {place}", partial(on_ground, place, ground)
        for case in seeds:
            yield f"{name}, hostile", f"{name}, case {case}", partial(hostile, case, partial(Ground, SPEC, **ground))
    for name, way in ways.items():
        for degrees in (1.0, 2.0):
            group = f"IMU wrong by {degrees:g} deg"
            yield group, f"{group} towards {name}", partial(wrong_imu, lean(np.deg2rad(degrees), way))


STUDIES = {
    "glitches": glitches,
    "delay": delay,
    "realistic": realistic_robot,
    "hostile": hostile_chunks,
    "friction": friction,
    "masses": masses,
    "ground": grounds,
}


def run_studies(studies: dict[str, Callable[[range], Iterator[Case]]], about: str) -> None:
    """Run what is missing of the one asked for, and print what there is."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", choices=tuple(studies))
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 20), help="first, and the one after the last")
    parser.add_argument("--only", default="", help="a part of the names of the cases that are wanted")
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time, each in a process")
    parser.add_argument("--out", type=Path, help="file with a line a case")
    arguments = parser.parse_args()
    wanted = [case for case in studies[arguments.study](range(*arguments.seeds)) if arguments.only in case[1]]
    out = arguments.out or Path(f"senses_{arguments.study}.jsonl")
    for group, cases in finished(wanted, out, arguments.jobs).items():
        rows = list(cases.values())
        falls = int(sum(row["falls"] for row in rows))
        said = [f"{group}: {falls} falls in {len(rows)}"]
        for key in dict.fromkeys(key for row in rows for key in row if key != "falls"):
            values = [row[key] for row in rows if key in row]
            said.append(f"{key} {np.median(values):.2f} median, {max(values):.2f} worst")
        print("; ".join(said))


if __name__ == "__main__":
    run_studies(STUDIES, __doc__)
