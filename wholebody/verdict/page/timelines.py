"""Time lines of every margin of a run, each with its bound, as data for a page."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio, stance_q
from models.spec import RobotSpec
from wholebody.collision.floor_clearance import FloorClearance
from wholebody.collision.proximity import Proximity
from wholebody.config import ControllerConfig
from wholebody.sim.pictures.plot import SIDE_COLOUR
from wholebody.sim.pictures.scene import SIDES, Show
from wholebody.verdict.page.frames import Frames

NO_SIDE_COLOUR = (0.45, 0.45, 0.52)
"""Colour of a line that is about no side [no unit]; chosen: the page draws it as it draws words."""
PAIRS_ALWAYS = 1
"""Pairs of bodies that are measured however far they are from each other."""


@dataclass(frozen=True)
class Line:
    """One curve.

    Attributes:
        name: What it shows.
        colour: Red, green and blue, 0 to 1.
        values: Shape (n,), NaN where there is nothing.
        dashed: Whether it is.
        whose: Of each value, which of `names` it is about, shape (n,); None where it is always the same.
        names: Joints, or pairs of bodies.
    """

    name: str
    colour: tuple[float, ...]
    values: np.ndarray
    dashed: bool = False
    whose: np.ndarray | None = None
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Panel:
    """Curves on one scale.

    Attributes:
        title: What they show.
        unit: Of the values.
        lines: Curves.
        bounds: Value and name of each bound.
        most: Where the scale ends at the latest, None where the values end it.
        knee: Value from which on the scale is logarithmic, None where it is linear.
        above: Whether values above the bounds are the good ones.
    """

    title: str
    unit: str
    lines: tuple[Line, ...]
    bounds: tuple[tuple[float, str], ...] = field(default=())
    most: float | None = None
    knee: float | None = None
    above: bool = False


def panels(frames: Frames, spec: RobotSpec, config: ControllerConfig) -> list[Panel]:
    """All time lines of a recording, those of the palms first."""
    return [*_palms(frames), _balance(frames), *_joints(frames, spec), *_distances(frames, spec, config), _rate(frames)]


def _palms(frames: Frames) -> Iterator[Panel]:
    record = frames.record
    errors, moved = 1e3 * record.palm_errors(), 1e3 * record.palm_errors("asked", "commanded")
    feasible, repair = 1e3 * record["palm_bounds"]
    bounds = (float(feasible), "as given up to here"), (float(repair), "repaired up to here")
    lines = [_side(side, frames.most(errors[:, i]), "measured") for i, side in enumerate(SIDES)]
    lines += [_side(side, frames.most(moved[:, i]), "commanded", dashed=True) for i, side in enumerate(SIDES)]
    yield Panel("palms, from where they are asked to be", "mm", tuple(lines), bounds, knee=float(repair))
    free = record["orientation_free"].astype(bool)
    if free.all():
        return
    turns = np.degrees(record.palm_turns())
    feasible, repair = np.degrees(record["turn_bounds"])
    bounds = (float(feasible), "as given up to here"), (float(repair), "repaired up to here")
    lines = [_side(side, frames.most(turns[:, i]), "measured") for i, side in enumerate(SIDES) if not free[i]]
    yield Panel("palms, from how they are asked to be turned", "°", tuple(lines), bounds, knee=float(repair))


def _side(side: str, values: np.ndarray, what: str, *, dashed: bool = False) -> Line:
    return Line(f"{side}, {what}", SIDE_COLOUR[side], values, dashed)


def _balance(frames: Frames) -> Panel:
    record = frames.record
    lines = (
        Line(Show.PRESSURE.legend, NO_SIDE_COLOUR, 1e3 * frames.least(record["pressure_margin"])),
        Line(Show.CAPTURE.legend, Show.CAPTURE.colour[:3], 1e3 * frames.least(record["capture_margin"])),
    )
    margin = 1e3 * float(record["balance_margin"])
    bounds = (0.0, "edge of the soles"), (margin, "kept by the capture point")
    return Panel("balance, inside the soles", "mm", lines, bounds, above=True)


def _joints(frames: Frames, spec: RobotSpec) -> Iterator[Panel]:
    """Least room of the body's joints in torque, range and speed."""
    record, motors, joints = frames.record, frames.record["motor_names"].tolist(), frames.record["joint_names"].tolist()
    body = np.isin(motors, spec.body_joints)
    share = frames.most(record["torque_asked"][:, body]) / record["effort_max"][body]
    yield Panel(
        "motors, torque asked over limit", "", (_worst("worst", share, motors, body),), ((1.0, "limit"),), most=2.0
    )
    by_name = {joint.name: joint for joint in spec.joints}
    body = np.isin(joints, spec.body_joints)
    low, high, speed = (
        np.array([getattr(by_name[name], bound) for name in joints])[body]
        for bound in ("position_min", "position_max", "velocity_max")
    )
    q, v = record["q"][:, 7:][:, body], np.abs(record["v"][:, 6:][:, body])
    room = np.degrees(frames.least(np.minimum(q - low, high - q)))
    bounds = ((0.0, "end of the range"),)
    yield Panel("joints, room to the end of their range", "°", (_worst("least", -room, joints, body, -1.0),), bounds,
                above=True)  # fmt: skip
    share = frames.most(v) / speed
    yield Panel("joints, speed over limit", "", (_worst("worst", share, joints, body),), ((1.0, "limit"),))


def _worst(name: str, values: np.ndarray, names: list[str], chosen: np.ndarray, sign: float = 1.0) -> Line:
    """The largest of values (n, k) at every instant, and which of the chosen names it is about."""
    whose = tuple(str(one).removesuffix("_joint").replace("_", " ") for one in np.array(names)[chosen])
    worst = values.argmax(axis=1)
    return Line(name, NO_SIDE_COLOUR, sign * values[np.arange(len(values)), worst], whose=worst, names=whose)


def _distances(frames: Frames, spec: RobotSpec, config: ControllerConfig) -> Iterator[Panel]:
    """Distances of bodies of the robot to each other, and of hands and forearms to the floor."""
    model, distance = load_pinocchio(spec), config.safety.self_distance
    proximity = Proximity(spec, model, None, stance_q(spec, model), distance)
    floor, data, near, low = FloorClearance(spec, model, proximity.geometry), model.createData(), [], []
    for q in frames.of_column("q"):
        pin.forwardKinematics(model, data, q)
        proximity.update(q, data, trigger=0.0, least=PAIRS_ALWAYS)
        near.append((int(np.argmin(proximity.bound - proximity.margin)), proximity.distance.copy()))
        low.append(floor.lowest(data)[:, 2])
    which = np.array([pair for pair, _ in near])
    values = np.array([1e3 * (found[pair] - proximity.margin[pair]) for pair, found in near])
    pairs = tuple(
        " and ".join(part.removesuffix("_link").replace("_", " ") for part in label.split(".")[1:])
        for label in proximity.labels
    )
    bounds = ((0.0, f"{1e3 * distance:.0f} mm apart, or as in the stance"),)
    line = Line("nearest pair", NO_SIDE_COLOUR, values, whose=which, names=pairs)
    yield Panel("robot to itself, beyond the distance it keeps", "mm", (line,), bounds, above=True)
    bodies = [label.partition(".")[2].removesuffix("_link") for label in floor.labels]
    heights = -1e3 * np.array(low)
    line = _worst("lowest", heights, bodies, np.ones(len(bodies), dtype=bool), -1.0)
    bounds = ((1e3 * config.safety.floor_distance, "distance kept"),)
    yield Panel("hands and forearms, over the floor", "mm", (line,), bounds, above=True)


def _rate(frames: Frames) -> Panel:
    line = Line("speed", (0.0, 0.55, 0.36), frames.least(frames.record["rate"]))
    return Panel("speed along the chunk", "", (line,), ((1.0, "as given"),), above=True)
