"""Scenes for MuJoCo: floor, table or shelf, with or without an object to grasp, by name.

Begin with `models.scenes.registry.add_scene`; a piece of furniture is a function of `models.scenes.furniture`.
"""

from models.scenes.file import SceneFile
from models.scenes.registry import SCENES, add_scene

__all__ = ["SCENES", "SceneFile", "add_scene"]
