"""What a standing G1 can do, a table at a time, beside what statics or a pendulum allow: for `docs/limits.md`.

    python benchmarks/limits.py TABLE [--robot true|realistic] [--seeds FIRST END] [--cases FIRST END] [--out FILE]

loads    0.5, 1 and 2 kg in both hands that nobody told, at places of the workspace, 4 s after the reach
slope    reaches on floors of 2 to 10 degrees that rise in eight directions
sway     a reach on a floor that sways by 2 degrees at 0.5 Hz, about both axes
delay    the lissajous with states of a known age
friction the lissajous on floors of 0.15 to 1.0; the controller counts on 0.6
model    a reach with other masses, and with the torso's centre of mass elsewhere
motors   the lissajous with each of 29 motors at half of its torque
pushes   largest impulse at the torso, 0.1 s, in 16 directions without a step, to 0.5 N s

The realistic robot is that of `wholebody run --realistic`; each seed is another one. Cases are lines of JSON in the
file, ``limits_TABLE.jsonl`` if not given; those that it has are not run again. At the end the table, worst of seeds.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from itertools import product
from pathlib import Path

import numpy as np
from statics import Statics

sys.path.insert(0, str(Path(__file__).parents[1]))

from models import RobotSpec, g1
from policy.scripted.library import reach, scripted_policy
from tests.support.carried import still
from tests.support.grounds import Ground, RealisticGround
from tests.support.resumable import finished
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.estimation.state_estimator import StateEstimator
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.kernels.pendulum import natural_frequency
from wholebody.robot.support_polygon import convex_polygon
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.robot_errors import REALISTIC_ROBOT, RealisticPlant, RobotErrors
from wholebody.sim.sensors import REALISTIC_READINGS, SensorConfig, Sensors

SPEC, DT = g1(), 0.002
PLACES = (
    (0.40, 0.30),
    (0.45, 0.60),
    (0.50, 1.00),
    (0.40, 1.40),
    (0.25, 1.50),
    (0.30, 0.60),
    (0.30, 0.90),
    (0.35, 1.20),
)
"""Both palms, ahead and over the floor [m]: the five reaches, and three places nearer to the body."""
LOADS, SIDE = (0.5, 1.0, 2.0), 0.16
SLOPES, DIRECTIONS, SWAY = (2.0, 5.0, 8.0, 10.0), 8, 2.0
DELAYS, FRICTIONS = (0, 5, 10, 15, 20, 30), (0.15, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0)
ERRORS = {"masses": ("mass_error", (0.05, 0.1, 0.2)), "torso": ("torso_error", (0.01, 0.02, 0.04))}
MOTORS = SPEC.joint_names[:29]
PUSHES, STEP, PUSH_MAX, PUSH_TIME = 16, 0.5, 30.0, 0.1
SECONDS = 6.0
"""Of the lissajous: two of its periods."""
Numbers = dict[str, float]
Case = tuple[str, str, Callable[..., Numbers]]
"""Group, what else it is called, and what gives its numbers for a robot and a seed."""


@cache
def supervisor() -> Supervisor:
    """One for all cases."""
    return Supervisor(SPEC)


def robot(
    name: str, seed: int, errors: RobotErrors | None = None, spec: RobotSpec = SPEC, **world: object
) -> tuple[MujocoPlant, Sensors | None]:
    """A plant with its sensors; what ``errors`` says of the realistic robot's model, or of the true one's."""
    delay = world.pop("delay", 0.0)
    on = ("slope", "direction", "step", "turn", "sway") & world.keys()
    if name == "true":
        sensors = Sensors(spec, SensorConfig(delay=delay), DT) if delay else None
        if errors is not None:
            return RealisticPlant(spec, RobotErrors(seed=seed, **errors), **world), sensors
        return (Ground if on else MujocoPlant)(spec, **world), sensors
    readings = replace(REALISTIC_READINGS, seed=seed, delay=REALISTIC_READINGS.delay + delay)
    sensors = Sensors(spec, readings, DT, StateEstimator(spec))
    drawn = replace(REALISTIC_ROBOT, seed=seed, **(errors or {}))
    if "friction" in world:
        drawn = replace(drawn, floor_friction=world.pop("friction"))
    return (RealisticGround if on else RealisticPlant)(spec, drawn, encoders=sensors, **world), sensors


def ran(
    policy: object,
    made: tuple[MujocoPlant, Sensors | None],
    duration: float,
    settle: float = 1.0,
    hold: float = EpisodeConfig.hold,
    chosen: Supervisor | None = None,
) -> Numbers:
    """Numbers of an episode: whether it fell, the root mean square after 2 s and the last errors of the palms."""
    plant, sensors = made
    config = EpisodeConfig(settle=settle, hold=hold)
    result = run_episode(policy, chosen or supervisor(), plant, duration=duration, config=config, sensors=sensors)
    late = result.errors[result.times >= settle + 2.0]
    numbers = {"falls": float(result.fall is not None)}
    if late.size:
        numbers |= {"rms_mm": 1e3 * float(np.sqrt((late**2).mean())), "end_mm": 1e3 * float(late[-1].max())}
    return numbers


def reached(place: tuple[float, float], name: str, seed: int, **world: object) -> Numbers:
    """A reach."""
    policy = reach(*place)
    return ran(policy, robot(name, seed, **world), policy.duration)


def lissajous(name: str, seed: int, weak: int | None = None, **world: object) -> Numbers:
    """Two periods of it; a motor at half of its torque."""
    plant, sensors = robot(name, seed, **world)
    if weak is not None:
        plant._effort[weak] *= 0.5
    return ran(scripted_policy("lissajous"), (plant, sensors), 2.0 + SECONDS)


class PushedStill:
    """Hands stay where they are; the robot is pushed a second after the start."""

    def __init__(self, plant: MujocoPlant, force: np.ndarray) -> None:
        self._policy, self._plant, self._force = still(1.0), plant, force
        self.name, self.sees_robot, self.spec = self._policy.name, self._policy.sees_robot, self._policy.spec

    def reset(self, task: str = "") -> None:
        """The plant has been reset by now."""
        self._policy.reset(task)
        self._plant.push("torso_link", self._force, start=1.0, duration=PUSH_TIME)

    def infer(self, observation: object) -> object:
        """As for hands that stay."""
        return self._policy.infer(observation)


def pushed(angle: float, name: str, seed: int) -> Numbers:
    """Largest impulse towards an angle that is stood, by bisection, and the pendulum's [N s]."""
    way, made = np.array([math.cos(angle), math.sin(angle), 0.0]), robot(name, seed)
    low, high = 0, round(PUSH_MAX / STEP)
    while high - low > 1:
        middle = (low + high) // 2
        policy = PushedStill(made[0], middle * STEP / PUSH_TIME * way)
        fell = ran(policy, made, 1.0, settle=0.5)["falls"]
        low, high = (low, middle) if fell else (middle, high)
    return {"falls": 0.0, "impulse_Ns": low * STEP, "bound_Ns": pendulum_bound(way[:2])}


def pendulum_bound(way: np.ndarray) -> float:
    """Impulse that brings the capture point of a pendulum to the edge of the soles: ``m omega d`` [N s]."""
    state = MujocoPlant(SPEC).reset()
    body = supervisor().robot
    body.update(state.q, state.v)
    support = convex_polygon(MujocoPlant(SPEC).contact_points()[:, :2])
    room, along = support.offsets - support.normals @ body.com[:2], support.normals @ way
    return float(body.mass * natural_frequency(body.com[2]) * np.min(room[along > 1e-9] / along[along > 1e-9]))


def loaded(place: tuple[float, float], load: float, name: str, seed: int) -> Numbers:
    """A reach with a load in both hands, and how far off a still robot has to be that holds the heavier one in both."""
    carried = (load, load)
    if name == "realistic":  # has something in its hands already
        carried = robot(name, seed, payload_kg=carried)[0].payload_kg
    off = 1e3 * float(still_robot().best(np.array([place[0], SIDE, place[1]]), max(carried)))
    return reached(place, name, seed, payload_kg=(load, load)) | {"bound_mm": off}


@cache
def still_robot() -> Statics:
    """At the margins of the plan."""
    return Statics()


def loads() -> Iterator[Case]:
    """Places and loads."""
    for (x, z), load in product(PLACES, LOADS):
        yield f"{x:.2f} {z:.2f}, {load:g} kg", "", partial(loaded, (x, z), load)


def slope() -> Iterator[Case]:
    """Slopes, each towards all directions."""
    for degrees, k in product(SLOPES, range(DIRECTIONS)):
        ground = {"slope": math.radians(degrees), "direction": 2.0 * math.pi * k / DIRECTIONS}
        yield f"{degrees:g} deg", f"towards {360 * k // DIRECTIONS} deg, ", partial(reached, (0.45, 0.60), **ground)


def sway() -> Iterator[Case]:
    """A floor that sways, about y and about x."""
    for towards in (0, 90):
        ground = {"sway": math.radians(SWAY), "direction": math.radians(towards)}
        yield f"{SWAY:g} deg", f"towards {towards} deg, ", partial(reached, (0.45, 0.60), **ground)


def delay() -> Iterator[Case]:
    """Delays that are known."""
    for ms in DELAYS:
        yield f"{ms} ms", "", partial(lissajous, delay=1e-3 * ms)


def friction() -> Iterator[Case]:
    """Coefficients of the floor."""
    for coefficient in FRICTIONS:
        yield f"{coefficient:g}", "", partial(lissajous, friction=coefficient)


def model() -> Iterator[Case]:
    """Errors of the model, drawn by the seed."""
    for what, (field, sizes) in ERRORS.items():
        for size in sizes:
            yield f"{what} {size:g}", "", partial(reached, (0.50, 1.00), errors={field: size})


def motors() -> Iterator[Case]:
    """Each motor."""
    for k, joint in enumerate(MOTORS):
        yield joint.removesuffix("_joint"), "", partial(lissajous, weak=k)


def pushes() -> Iterator[Case]:
    """Directions."""
    for k in range(PUSHES):
        yield f"{360 * k / PUSHES:g} deg", "", partial(pushed, 2.0 * math.pi * k / PUSHES)


TABLES = {table.__name__: table for table in (loads, slope, sway, delay, friction, model, motors, pushes)}


def rows(found: dict[str, dict[str, Numbers]]) -> list[str]:
    """A table in Markdown: worst of a group's cases, least where more is better."""
    columns = list(dict.fromkeys(key for group in found.values() for one in group.values() for key in one))
    lines = ["| | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]
    for group, ones in found.items():
        said = [f"{int(sum(one['falls'] for one in ones.values()))} of {len(ones)}"]
        for key in columns[1:]:
            values = [one[key] for one in ones.values() if key in one]
            worst = min if key == "impulse_Ns" else max
            said.append(f"{worst(values):.2f}" if values else "")
        lines.append(f"| {group} | " + " | ".join(said) + " |")
    return lines


def draw(found: dict[str, dict[str, Numbers]], path: Path) -> None:
    """Pushes by their direction, beside the pendulum's bound."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.0, 5.6), layout="constrained")
    axes = figure.add_subplot(projection="polar")
    angles = [math.radians(float(group.split()[1])) for group in found]
    for key, what in (("bound_Ns", "pendulum"), ("impulse_Ns", "measured")):
        values = [min(one[key] for one in ones.values()) for ones in found.values()]
        axes.plot([*angles, angles[0]], [*values, values[0]], "o-" if key == "impulse_Ns" else "--", label=what)
    axes.set_title("largest push at the torso without a step [N s]\n0 deg is ahead, 90 deg to the left")
    figure.legend(loc="outside lower center", ncols=2)
    figure.savefig(path, dpi=100)


def main() -> None:
    """Run what is missing, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", choices=TABLES)
    parser.add_argument("--robot", choices=("true", "realistic"), default="true")
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 3), help="first, and the one after the last")
    parser.add_argument("--cases", type=int, nargs=2, default=(0, None), help="first, and the one after the last")
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time, each in a process")
    parser.add_argument("--out", type=Path, help="file with a line a case")
    parser.add_argument("--picture", type=Path, help="of pushes, a PNG")
    options = parser.parse_args()
    one = options.robot == "true" and options.table != "model"  # nothing is drawn
    listed = [
        (f"{options.robot}: {group}", f"{detail}seed {seed}", partial(run, name=options.robot, seed=seed))
        for group, detail, run in TABLES[options.table]()
        for seed in range(options.seeds[0], options.seeds[0] + 1 if one else options.seeds[1])
    ]
    out = options.out or Path(f"limits_{options.table}.jsonl")
    found = finished(listed[slice(*options.cases)], out, options.jobs)
    print("\n".join(rows(found)))
    if options.picture is not None:
        draw(found, options.picture)


if __name__ == "__main__":
    main()
