"""Scenes by name: what stands around the robot. A fixture, or ``<furniture>`` or ``<furniture>_<object>``."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from typing import TYPE_CHECKING

from models.scenes.file import SceneFile, attach_file
from models.scenes.fixtures import FIXTURES
from models.scenes.furniture import FURNITURE, add_floor
from models.scenes.objects import OBJECTS
from models.spec import RobotSpecError

if TYPE_CHECKING:
    import mujoco


def scene_names() -> tuple[str, ...]:
    """Names of all scenes that the present furniture, objects and fixtures make."""
    held = (f"{furniture}_{thing}" for furniture in FURNITURE for thing in OBJECTS)
    return (*FURNITURE, *held, *FIXTURES)


SCENES = scene_names()
"""Names of all scenes."""


def add_scene(mj: mujoco.MjSpec, scene: str | SceneFile, friction: float) -> list[float]:
    """Put a scene around the robot, on a floor at z = 0.

    Args:
        mj: Model with the robot already in it, so that the robot's joints come first.
        scene: One of `SCENES`, or a file.
        friction: Coulomb coefficient of the floor.

    Returns:
        Positions of the joints that were added.

    Raises:
        RobotSpecError: If there is no such scene, or a file is none.
    """
    if isinstance(scene, SceneFile):
        add_floor(mj, friction)
        return attach_file(mj, scene)
    names = scene_names()
    if scene not in names:
        near = difflib.get_close_matches(scene, names, n=1)
        hint = f"did you mean '{near[0]}'? " if near else ""
        raise RobotSpecError(f"no scene '{scene}'; {hint}there are: {', '.join(names)}, and MuJoCo files (.xml)")
    add_floor(mj, friction)
    if scene in FIXTURES:
        return FIXTURES[scene](mj)
    furniture, _, thing = scene.partition("_")
    if furniture in FURNITURE:
        build: Callable[[mujoco.MjSpec], tuple[float, float, float]] = FURNITURE[furniture]
        place = build(mj)
        if thing:
            return OBJECTS[thing](mj, place)
    return []
