"""Where to stand for two wrist poses: base poses through the map, the cheapest by steps, and a posture at the best."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil, hypot

import numpy as np

from policy.geometry.rotations import angle_between, rotvec_to_matrix
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.errors import InputError
from wholebody.planning.posture import Solution, solve
from wholebody.planning.reachability.pairs import TURNS, Pairs, Turn
from wholebody.planning.reachability.reach_map import ReachabilityMap, reachability
from wholebody.planning.still_postures import wrist_target
from wholebody.robot.palms import palm_offsets, palm_poses

AROUND, GRID = 0.9, 0.05
"""Distance from the middle of the palms within which bases are tried, and between two of them [m]; derived: the map's
reach ahead and half of the palms' distance; chosen: a quarter of a step."""
HEADINGS_TRIED = 24
"""Headings that are tried [no unit]; chosen: every 15 degrees."""
ODDS_MIN = 2.0
"""Logarithm of the odds from which a base is tried [no unit]; chosen: the map errs near its border."""
ODDS_ENOUGH = 6.0
"""Logarithm of the odds above which more is of no use [no unit]; derived: from there the map is sure."""
STEP_REACH = (0.2, 0.25)
"""Way [m] and turn [rad] of a step; chosen: what a gait does at its slower speeds."""
BESIDE = (0.12, 0.3)
"""Distance [m] and angle [rad] between two bases that are tried with a search; chosen: nearer ones fail alike."""
TRIED = 3
"""Bases at which a posture is searched for, besides the one where the robot stands."""
WAY, TURN, ROOM, ASKEW = 1.0, 0.3, 0.06, 0.5
"""Weights of way [1/m], turn [1/rad], room [no unit] and the difference of heading and fingers [1/rad] among bases of
as many steps; by trial: those of the prototype that found its bases."""
LIKE = 0.6
"""Angle up to which palms are turned as one of the map's turns has them [rad]; chosen: the wrist gives the rest."""


@dataclass(frozen=True)
class StandingPlace:
    """Where a robot stands for two wrist poses.

    Attributes:
        reached: Whether a posture there reaches both.
        base: Midpoint of the soles in world and heading: x, y [m], angle [rad].
        steps: That it takes to go there from where the robot stands, about; 0 if it is there already.
        room: By the map, logarithm of the odds that both palms can be held from there.
        posture: The one found, in the frame of that base: world is midway between its soles.
    """

    reached: bool
    base: tuple[float, float, float]
    steps: int
    room: float
    posture: Solution

    def __str__(self) -> str:
        """A line for the place, and those of the posture."""
        x, y, heading = self.base
        there = "from where it stands" if self.steps == 0 else f"with {self.steps} steps to"
        return f"{there} ({x:.2f}, {y:.2f}), heading {np.rad2deg(heading):.0f} deg: {self.posture}"


def stand_for(
    T_world_lhand: np.ndarray,
    T_world_rhand: np.ndarray,
    start: Sequence[float] = (0.0, 0.0, 0.0),
    config: ControllerConfig | None = None,
    *,
    spare: float = 0.0,
) -> StandingPlace:
    """Where to stand for two wrist poses, with the fewest steps; the nearest that is found where none reaches both.

    Args:
        T_world_lhand: Pose (4, 4) of ``left_wrist_yaw_link`` in world; the floor is level at height 0.
        T_world_rhand: The same of the right one.
        start: Where the robot stands: midpoint of its soles x, y [m] and heading [rad].
        config: Of the robot and its bounds.
        spare: How much further from the palms the map allows the robot to stand, too: feet miss their places by
            centimetres, and a motion has to lead there [m].

    Raises:
        InputError: If a pose or the start is not finite, a pose is no rigid transform, or there is no map for these
            settings.
    """
    config = config or ControllerConfig()
    wrists = np.stack([wrist_target(T_world_lhand, "T_world_lhand"), wrist_target(T_world_rhand, "T_world_rhand")])
    here = np.array(start, dtype=float)
    if here.shape != (3,) or not np.isfinite(here).all():
        raise InputError(f"start is {start}; x, y [m] and heading [rad] of where the robot stands are expected")
    palms = palm_poses(wrists, palm_offsets(describe(config.robot)))
    found: list[StandingPlace] = []
    for base, room in _bases(reachability(config), palms, here, spare):
        left, right = (_seen(base, T) for T in wrists)
        posture = solve(left, right, config)
        found.append(StandingPlace(posture.reached, tuple(base.tolist()), _steps(base, here), room, posture))
        if posture.reached:
            return found[-1]
    return min(found, key=lambda place: max(place.posture.position_error))


def _bases(
    chart: ReachabilityMap, palms: np.ndarray, here: np.ndarray, spare: float
) -> Iterator[tuple[np.ndarray, float]]:
    """Bases (3,) to try with their room: where the robot stands if the map allows it, then the cheapest by steps."""
    room = float(_rooms(chart, palms, here[None])[0])
    if room > ODDS_MIN:
        yield here, room
    bases = _grid(palms)
    rooms = _rooms(chart, palms, bases)
    if spare > 0.0:
        rooms = np.minimum(rooms, _rooms(chart, palms, _further(bases, palms, spare)))
    inside = rooms > ODDS_MIN
    if not inside.any():
        best = int(rooms.argmax())
        yield (here, room) if rooms[best] <= room else (bases[best], float(rooms[best]))
        return
    bases, rooms = bases[inside], rooms[inside]
    chosen: list[np.ndarray] = []
    for i in np.argsort(_costs(bases, rooms, palms, here)):
        if all(_apart(bases[i], other) for other in chosen):
            chosen.append(bases[i])
            yield bases[i], float(rooms[i])
        if len(chosen) == TRIED:
            return


def _grid(palms: np.ndarray) -> np.ndarray:
    """Bases about the palms, shape (n, 3)."""
    middle = palms[:, :2, 3].mean(axis=0)
    line = np.arange(-AROUND, AROUND + 0.5 * GRID, GRID)
    headings = np.arange(HEADINGS_TRIED) * (2.0 * np.pi / HEADINGS_TRIED) - np.pi
    x, y, heading = np.meshgrid(middle[0] + line, middle[1] + line, headings, indexing="ij")
    return np.stack([x.ravel(), y.ravel(), heading.ravel()], axis=1)


def _rooms(chart: ReachabilityMap, palms: np.ndarray, bases: np.ndarray) -> np.ndarray:
    """Room of the palms (2, 4, 4) from each base (n, 3), shape (n,); below the border outside what the map knows."""
    way = palms[None, :, :3, 3] - np.concatenate([bases[:, :2], np.zeros((len(bases), 1))], axis=1)[:, None]
    c, s = np.cos(bases[:, 2])[:, None], np.sin(bases[:, 2])[:, None]
    points = np.stack([c * way[..., 0] + s * way[..., 1], c * way[..., 1] - s * way[..., 0], way[..., 2]], axis=-1)
    pairs = Pairs(points, _turns(palms, bases[:, 2]), np.zeros((len(bases), 2)))
    known, rooms = chart.knows(pairs), np.full(len(bases), -np.inf)
    rooms[known] = chart.rooms(pairs[known])
    return rooms


def _further(bases: np.ndarray, palms: np.ndarray, way: float) -> np.ndarray:
    """Bases (n, 3) that much further from the middle of the palms (2, 4, 4) [m], shape (n, 3)."""
    off = bases[:, :2] - palms[:, :2, 3].mean(axis=0)
    away = off / np.maximum(np.linalg.norm(off, axis=1, keepdims=True), 1e-9)
    return np.concatenate([bases[:, :2] + way * away, bases[:, 2:]], axis=1)


def _turns(palms: np.ndarray, headings: np.ndarray) -> np.ndarray:
    """Number of the turn that palms (2, 4, 4) have most nearly, seen from headings (n,), shape (n,)."""
    numbers, place = np.unique(headings, return_inverse=True)
    found = np.full(len(numbers), TURNS.index(Turn.ANY))
    for k, heading in enumerate(numbers):
        R = rotvec_to_matrix(np.array([0.0, 0.0, -heading])) @ palms[:, :3, :3]
        off = [np.inf if turn.free else float(angle_between(R, turn.rotations).max()) for turn in TURNS]
        if min(off) <= LIKE:
            found[k] = int(np.argmin(off))
    return found[place]


def _costs(bases: np.ndarray, rooms: np.ndarray, palms: np.ndarray, here: np.ndarray) -> np.ndarray:
    """Cost of each base (n, 3): steps, plus less than one step for the other terms, shape (n,)."""
    way = np.hypot(bases[:, 0] - here[0], bases[:, 1] - here[1])
    turn = np.abs(_wrapped(bases[:, 2] - here[2]))
    fingers = palms[:, :2, 0].sum(axis=0)
    level = float(np.hypot(*fingers)) / 2.0
    askew = level * np.abs(_wrapped(bases[:, 2] - np.arctan2(fingers[1], fingers[0])))
    steps = np.ceil(np.maximum(way / STEP_REACH[0], turn / STEP_REACH[1]))
    return steps + WAY * way + TURN * turn + ASKEW * askew - ROOM * np.minimum(rooms, ODDS_ENOUGH)


def _steps(base: np.ndarray, here: np.ndarray) -> int:
    """Steps to a base, one more to close the feet; 0 where it is."""
    way, turn = hypot(*(base[:2] - here[:2])), abs(float(_wrapped(base[2] - here[2])))
    steps = ceil(max(way / STEP_REACH[0], turn / STEP_REACH[1]) - 1e-9)
    return steps + 1 if steps > 0 else 0


def _apart(a: np.ndarray, b: np.ndarray) -> bool:
    return hypot(*(a[:2] - b[:2])) > BESIDE[0] or abs(float(_wrapped(a[2] - b[2]))) > BESIDE[1]


def _wrapped(angle: np.ndarray) -> np.ndarray:
    """Angles from -pi to pi [rad]."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def _seen(base: np.ndarray, T_world: np.ndarray) -> np.ndarray:
    """A pose in the frame of a base."""
    c, s = np.cos(base[2]), np.sin(base[2])
    T = np.array([[c, -s, 0.0, base[0]], [s, c, 0.0, base[1]], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    return np.linalg.solve(T, T_world)
