"""The map: whether the standing robot can hold a pair of palms, in microseconds and without a search.

It is fitted to what `wholebody.planning.posture` finds, so it is a hint: near its border it errs both ways, and whoever
has to know asks `solve`.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import astuple
from functools import lru_cache
from hashlib import sha256
from math import inf, isfinite
from pathlib import Path
from threading import local
from typing import Any
from zipfile import BadZipFile

import numpy as np

from models.spec import RobotSpec
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.errors import InputError
from wholebody.jit.entry import Entry
from wholebody.planning.reachability.kernels import network as kernel
from wholebody.planning.reachability.kernels.network import N_FEATURES
from wholebody.planning.reachability.network import NEURONS, Network
from wholebody.planning.reachability.pairs import BODY, BOX_HIGH, BOX_LOW, LOAD_KNOWN, MIRROR, TURNS, Pairs, Turn

VERSION = 2
"""Version of the file's layout."""
SHIPPED = Path(__file__).with_name("g1_dex3.npz")
"""The map of the default settings."""
NAMES = ("w1", "b1", "w2", "b2", "w3", "b3")
BOUNDS = (
    "joint_margin", "knee_min", "elbow_max", "com_margin", "zmp_margin", "capture_margin", "pelvis_tilt", "torso_tilt",
    "height_min", "torque_share", "self_distance", "floor_distance",
)  # fmt: skip
"""Settings of `ControllerConfig.planner.posture` that bound a posture at rest."""

ODDS_SURE = 6.0
"""Logarithm of the odds from which the map is sure [no unit]; measured: of 2000 random pairs none that is held had more
than 3.7 against it."""

_rooms = Entry(kernel.rooms)
_NUMBERS: dict[str, int] = {turn: i for i, turn in enumerate(TURNS)}


class _Buffers(local):
    """What a question is put into and computed in, a set a thread."""

    def __init__(self) -> None:
        points, turns, loads, out = _blank(1)
        self.one = points, turns, loads, _scratch(), out


class ReachabilityMap:
    """Where both palms can be held at once, standing still with the feet of the stance.

    Args:
        network: Fitted weights. card: What it was made from: ``basis``, and whatever else is to be known of it.
    """

    def __init__(self, network: Network, card: dict) -> None:
        self.network, self.card = network, card
        points, turns, loads, out = _blank(1)
        self._native = _rooms.native(points, turns, loads, BODY, network, _scratch(), out)
        self._own = _Buffers()

    @staticmethod
    def read(path: Path) -> ReachabilityMap:
        """A map from a file.

        Raises:
            InputError: If it is none, or one of another version.
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                card = json.loads(str(file["card"]))
                network = tuple(np.asarray(file[name], np.float32) for name in NAMES)
        except (KeyError, ValueError, EOFError, BadZipFile) as error:
            raise InputError(f"{path} is no map of reachability; `wholebody reachability` writes one") from error
        if card.get("version") != VERSION or network[0].shape != (N_FEATURES, NEURONS):
            raise InputError(f"{path} is a map of version {card.get('version')}, not {VERSION}; compute it anew")
        return ReachabilityMap(network, card)

    def write(self, path: Path) -> None:
        """Write it to a file."""
        arrays: dict[str, Any] = dict(zip(NAMES, self.network, strict=True))
        np.savez_compressed(path, card=json.dumps({"version": VERSION, **self.card}), **arrays)

    def room(
        self,
        left: Sequence[float],
        right: Sequence[float],
        turn: Turn | str = Turn.ANY,
        loads: tuple[float, float] = (0.0, 0.0),
    ) -> float:
        """Logarithm of the odds that two palm points can be held: positive inside, 0 at the border.

        Any number of threads may ask. Outside the box that it knows, the answer is a guess; see `knows`.

        Args:
            left: Palm point in world, midpoint of the soles, x forward, z up [m].
            right: The same of the right palm.
            turn: How both palms are turned, a `Turn` or its name.
            loads: Masses in the left and right hand [kg].

        Raises:
            InputError: If there is no such turn, or these are no points and masses.
        """
        points, turns, carried, scratch, out = self._own.one
        try:
            points[0, 0, 0], points[0, 0, 1], points[0, 0, 2] = a, b, c = left
            points[0, 1, 0], points[0, 1, 1], points[0, 1, 2] = d, e, f = right
            carried[0, 0], carried[0, 1] = m, n = loads
        except (TypeError, ValueError) as error:
            raise InputError(f"{left}, {right} and {loads} are not two points [m] and two masses [kg]") from error
        if not (isfinite(a + b + c + d + e + f) and 0.0 <= m < inf and 0.0 <= n < inf):
            raise InputError(f"points {left} and {right} [m] are to be finite, and masses {loads} [kg] not negative")
        try:
            turns[0] = _NUMBERS[turn]
        except KeyError as error:
            raise InputError(f"palms are not turned '{turn}' in the map; there are: {', '.join(TURNS)}") from error
        self._native(points, turns, carried, BODY, self.network, scratch, out)
        return float(out[0])

    def rooms(self, pairs: Pairs) -> np.ndarray:
        """`room` of many pairs, shape (n,); any number of threads may ask.

        Raises:
            InputError: If points or masses are not finite, or a mass is negative.
        """
        if not (np.isfinite(pairs.points).all() and np.isfinite(pairs.loads).all() and (pairs.loads >= 0.0).all()):
            raise InputError("points [m] and masses [kg] are to be finite, and masses not negative")
        points, turns, loads, out = _blank(len(pairs))
        points[:], turns[:], loads[:] = pairs.points, pairs.turns, pairs.loads
        self._native(points, turns, loads, BODY, self.network, _scratch(), out)
        return out

    def surely_out(self, palms: np.ndarray, loads: tuple[float, float]) -> bool:
        """Whether great odds are against one of some pairs of palms (n, 2, 3), however turned, with masses [kg]."""
        n = len(palms)
        carried = np.broadcast_to(np.minimum(loads, LOAD_KNOWN), (n, 2))
        pairs = Pairs(np.ascontiguousarray(palms), np.full(n, TURNS.index(Turn.ANY)), carried)
        return bool(((self.rooms(pairs) < -ODDS_SURE) & self.knows(pairs)).any())

    @staticmethod
    def knows(pairs: Pairs) -> np.ndarray:
        """Whether pairs are in the box and of the loads that the map was fitted to, shape (n,)."""
        points = pairs.points.copy()
        points[:, 1] = points[:, 1] @ MIRROR
        inside = np.all((points >= BOX_LOW) & (points <= BOX_HIGH), axis=(1, 2))
        return np.logical_and(inside, np.all((pairs.loads >= 0.0) & (pairs.loads <= LOAD_KNOWN), axis=1))


def _blank(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    return np.zeros((n, 2, 3)), np.zeros(n, np.int64), np.zeros((n, 2)), np.zeros(n)


def _scratch() -> tuple[np.ndarray, ...]:
    return np.zeros((2, 3)), np.zeros(2), np.zeros(N_FEATURES, np.float32), *np.zeros((2, NEURONS), np.float32)


def basis(spec: RobotSpec, config: ControllerConfig) -> str:
    """A number that changes with the robot and with the settings that bound its postures at rest."""
    joints = [(one.name, one.position_min, one.position_max, one.effort_max) for one in spec.joints]
    tools = [(tool.wrist_frame, tool.palm_offset) for tool in spec.tools]
    bounds = [getattr(config.planner.posture, name) for name in BOUNDS]
    facts = (spec.name, joints, tools, astuple(spec.stance), bounds, config.friction, config.force_min)
    return sha256(json.dumps(facts).encode()).hexdigest()[:16]


@lru_cache(maxsize=4)
def map_for(spec_basis: str) -> ReachabilityMap | None:
    """The map that comes with the package, if it is of such a robot and such bounds."""
    shipped = ReachabilityMap.read(SHIPPED) if SHIPPED.exists() else None
    return shipped if shipped is not None and shipped.card["basis"] == spec_basis else None


def reachability(config: ControllerConfig | None = None) -> ReachabilityMap:
    """The map that comes with the package.

    Raises:
        InputError: If the settings describe another robot or other bounds than it was computed for.
    """
    config = config or ControllerConfig()
    found = map_for(basis(describe(config.robot), config))
    if found is None:
        raise InputError(
            "the map that comes with the package is of other settings; `wholebody reachability MAP.npz --config FILE` "
            "computes one for these, and `ReachabilityMap.read` reads it"
        )
    return found
