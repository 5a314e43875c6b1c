"""What is to be done: what is shown of it, and whether it is done."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np

from lerobot_robot_wholebody.config_wholebody_g1 import TASKS
from lerobot_robot_wholebody.drawn import Drawn
from lerobot_robot_wholebody.wiping import Wipe
from models.places import BUTTON_TRAVEL, CARTON_WIDTH, CRATE_WIDTH, ON_FLOOR, ON_SHELF, ON_TABLE, SHELF_HEIGHTS
from policy.action_spec.anchor import Anchor
from policy.learned.place import SPOT, SPREAD, drawn, off_spot
from policy.learned.reach import REACHED, goals_of
from policy.learned.things import shown_of, thing_in_stance
from policy.scripted.chores import pick_from_floor, put_on_shelf
from policy.scripted.contact import lift_up, press, pull_drawer
from policy.scripted.library import grasp, hand_over
from policy.scripted.place import place
from policy.scripted.policy import ScriptedPolicy
from wholebody.live.served.messages import Seen

SIDES = ("left", "right")
ON_BOARD, HIGHER = (0.45, 0.15), SHELF_HEIGHTS[2] - SHELF_HEIGHTS[1]
"""Spot on the upper board of the shelf, and how much higher that is than the middle one [m]; chosen: all of the thing
is on the board."""
AT_FLOOR = 0.12
"""Height at which something on the floor is grasped [m]; chosen: 0.08 m below, a hand has room above the floor."""
OPEN = 0.25
"""How far out a drawer is open [m]; chosen: two thirds of its depth."""
TILT = 0.3
"""Angle from upright up to which a crate that was lifted counts [rad]; chosen: what is in it stays."""


class RobotTask(Protocol):
    """Something to do.

    Attributes:
        scene: Around the robot; empty: any.
        names: Of the numbers that are shown of it.
        marks: How many balls show it.
        held: Steps for which it must be done to count.
        steps: In an episode, at 30 a second.
        words: What a policy is told.
    """

    scene: str
    names: tuple[str, ...]
    marks: int
    held: int
    steps: int
    words: str

    def draw(self, rng: np.random.Generator) -> None:
        """Draw another instance of it from somebody's numbers."""

    def next(self) -> None:
        """Draw another one from its own."""

    def objects(self, usual: np.ndarray) -> np.ndarray | None:
        """Poses (k, 7) of the scene's bodies at the beginning, given the usual ones; None: as they are."""

    def shown(self, seen: Seen, anchor: Anchor, palms: np.ndarray) -> dict[str, float]:
        """Its numbers by name, in the stance of an anchor, given both palms there (2, 3)."""

    def in_world(self, anchor: Anchor) -> list[np.ndarray]:
        """Where the balls are in world, (3,) each [m]."""

    def far(self, seen: Seen, palms: np.ndarray) -> float:
        """How far from done it is [m], given both palms in the stance (2, 3); 0 or less: done."""


class Reach(Drawn):
    """Both palms have a goal each, drawn anew by `next`.

    Args:
        seed: Of the goals.

    Attributes:
        goals: Of the left and right palm in the stance, shape (2, 3), [m].
    """

    scene, held, steps, words = "", 10, 150, "reach the balls"
    marks = len(SIDES)
    names = tuple(f"to_goal_{side}_{axis}.pos" for side in SIDES for axis in "xyz")

    def draw(self, rng: np.random.Generator) -> None:
        """Draw other goals from somebody's numbers."""
        self.goals = goals_of(rng)

    def objects(self, usual: np.ndarray) -> np.ndarray | None:
        """None are its own."""
        return None

    def shown(self, seen: Seen, anchor: Anchor, palms: np.ndarray) -> dict[str, float]:
        """The way from each palm to its goal: a policy learns from fewer goals where to go than from their places."""
        return dict(zip(self.names, (self.goals - palms).ravel().tolist(), strict=True))

    def in_world(self, anchor: Anchor) -> list[np.ndarray]:
        """The goals in world, (3,) each [m]."""
        T = anchor.T_world_stance
        return [T[:3, :3] @ goal + T[:3, 3] for goal in self.goals]

    def far(self, seen: Seen, palms: np.ndarray) -> float:
        """Larger distance of a palm from its goal, past `REACHED` [m]."""
        return float(np.linalg.norm(palms - self.goals, axis=1).max()) - REACHED


@dataclass(frozen=True, kw_only=True)
class Moved:
    """Something that is to be moved.

    Attributes:
        scene: Around the robot; its first body is moved.
        words: What a policy is told.
        far: How far from done it is [m], given where it was and is, (3,) each, and both palms, (2, 3); as `RobotTask`.
        script: Motion of an expert, given how far ahead and to the left of its usual place it stands [m].
        spread: How far that is at most, both ways [m].
        held: Steps for which it must be there.
        steps: In an episode.
    """

    scene: str
    words: str
    far: Callable[[np.ndarray, np.ndarray, np.ndarray], float]
    script: Callable[[np.ndarray], ScriptedPolicy]
    spread: tuple[float, float] = (0.0, 0.0)
    held: int = 10
    steps: int = 300


class Thing(Drawn):
    """Something is to be moved, which stands a little elsewhere each time.

    Args:
        seed: Of where it stands.
        about: What it is.
    """

    marks = 0
    names = (
        *(f"object_{axis}.pos" for axis in "xyz"),
        *(f"to_object_{side}_{axis}.pos" for side in SIDES for axis in "xyz"),
    )

    def __init__(self, seed: int, about: Moved) -> None:
        self._about = about
        self.scene, self.words, self.held, self.steps = about.scene, about.words, about.held, about.steps
        self._begin: np.ndarray | None = None
        super().__init__(seed)

    def draw(self, rng: np.random.Generator) -> None:
        """Draw another place from somebody's numbers."""
        self.off = drawn(rng, self._about.spread)

    def objects(self, usual: np.ndarray) -> np.ndarray:
        """The usual poses, the first body moved aside."""
        poses = np.array(usual)
        poses[0, :2] += self.off
        self._begin = poses[0].copy()
        return poses

    def script(self) -> ScriptedPolicy:
        """Motion of an expert."""
        return self._about.script(self.off)

    def shown(self, seen: Seen, anchor: Anchor, palms: np.ndarray) -> dict[str, float]:
        """Where it is, and the way to it from each palm."""
        return dict(zip(self.names, shown_of(thing_in_stance(seen.observation, anchor), palms).tolist(), strict=True))

    def in_world(self, anchor: Anchor) -> list[np.ndarray]:
        """No balls: it is seen itself."""
        return []

    def far(self, seen: Seen, palms: np.ndarray) -> float:
        """How far from done it is [m]; at least as far as at first if it is tilted by more than `TILT`."""
        thing, begin = seen.objects[0], self._begin[:3]
        upright = 1.0 - 2.0 * (thing[4] ** 2 + thing[5] ** 2)  # of a quaternion wxyz, its axis' z
        far = self._about.far(begin, thing[:3], palms)
        return far if upright >= np.cos(TILT) else max(far, self._about.far(begin, begin, palms))


def _grasped(off: np.ndarray) -> ScriptedPolicy:
    return grasp((ON_TABLE[0] + off[0], ON_TABLE[1] + off[1], ON_TABLE[2] + 0.08), around=True)


def _placed(off: np.ndarray) -> ScriptedPolicy:
    up = np.array([0.0, 0.0, 0.08])
    return place(np.add(ON_TABLE, (*off, 0.0)) + up, np.array([*SPOT, ON_TABLE[2]]) + up)


def _from_floor(off: np.ndarray) -> ScriptedPolicy:
    return pick_from_floor(np.add(ON_FLOOR, (*off, AT_FLOOR)))


def _on_shelf(off: np.ndarray) -> ScriptedPolicy:
    here = np.add(ON_SHELF, (*off, 0.08))
    return put_on_shelf(here, np.array([*ON_BOARD, here[2] + HIGHER]))


def _moved(way: tuple[float, float, float], least: float) -> Callable[[np.ndarray, np.ndarray, np.ndarray], float]:
    """Far from moved along an axis of the world, by how much at least [m]."""
    return lambda begin, at, palms: least - float(np.array(way) @ (at - begin))


UP, IN, OUT = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)
THINGS = {
    "pick": Moved(
        scene="table_cylinder", words="pick up the cylinder", far=_moved(UP, 0.06), script=_grasped, spread=SPREAD
    ),
    "place": Moved(
        scene="table_cylinder", words="put the cylinder on the spot before you", far=off_spot, script=_placed,
        spread=SPREAD, steps=420,
    ),
    "lift": Moved(
        scene="table_carton", words="lift the carton with both hands", far=_moved(UP, 0.06),
        script=lambda off: lift_up(CARTON_WIDTH, 1.0, (off[0], off[1])), spread=(0.02, 0.02), steps=360,
    ),
    "lift_crate": Moved(
        scene="table_crate", words="lift the crate with both hands", far=_moved(UP, 0.06),
        script=lambda off: lift_up(CRATE_WIDTH, 2.0, (off[0], off[1]), squeeze=35.0), spread=(0.02, 0.02),
        steps=360,
    ),
    "press": Moved(
        scene="button", words="press the button", far=_moved(IN, BUTTON_TRAVEL), script=lambda _: press(), held=1,
        steps=210,
    ),
    "hand_over": Moved(
        scene="table_flask", words="hand over the flask", far=_moved(UP, 0.15), script=lambda _: hand_over(), held=30,
        steps=390,
    ),
    "pick_low": Moved(
        scene="floor_cylinder", words="pick up the cylinder from the floor", far=_moved(UP, 0.06), script=_from_floor,
        spread=SPREAD, steps=360,
    ),
    "shelf": Moved(
        scene="shelf_cylinder", words="put the cylinder on the upper board",
        far=partial(off_spot, spot=ON_BOARD, up=HIGHER), script=_on_shelf, spread=(0.02, 0.03), steps=560,
    ),
    "open_drawer": Moved(
        scene="drawer", words="open the drawer", far=_moved(OUT, OPEN), script=lambda _: pull_drawer(), steps=500,
    ),
}  # fmt: skip
"""What is moved, by the name of its task; distances chosen: past them it is plain that it was done."""


def task_of(name: str, seed: int) -> RobotTask | None:
    """A task by its name; None for ``none``.

    Raises:
        ValueError: If there is none of that name.
    """
    if name not in TASKS:
        raise ValueError(f"there is no task {name}; there are {', '.join(TASKS)}")
    if name in THINGS:
        return Thing(seed, THINGS[name])
    own = {"reach": Reach, "wipe": Wipe}.get(name)
    return own(seed) if own else None
