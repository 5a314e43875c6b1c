"""A scene from a MuJoCo file: its bodies and geoms around the robot, which keeps its own floor and physics."""

from __future__ import annotations

from dataclasses import dataclass, field

import mujoco
import numpy as np

from models.spec import RobotSpecError

PREFIX = "scene_"
"""Prefix of the names of a file, so that none is one of the robot's."""
_LEVEL = 1e-6
"""Height of a file's floor up to which it is at z = 0 [m]."""


@dataclass(frozen=True)
class SceneFile:
    """A MuJoCo file as text, whose contents its reader has checked.

    Attributes:
        name: What to call it in messages.
        xml: The model.
        assets: Contents of the files that it names, by these names.
    """

    name: str
    xml: str
    assets: dict[str, bytes] = field(default_factory=dict, hash=False)


def attach_file(mj: mujoco.MjSpec, scene: SceneFile) -> list[float]:
    """Put what is in a file around the robot.

    Args:
        mj: Model with the robot and the floor. A level plane of the file at z = 0 is taken for that floor.
        scene: The file.

    Returns:
        Positions of its joints.

    Raises:
        RobotSpecError: If MuJoCo does not compile it, or it has another plane.
    """
    try:
        child = mujoco.MjSpec.from_string(scene.xml, assets=scene.assets)
        _drop_floor(child, scene.name)
        joints = child.compile().qpos0.tolist()
        mj.attach(child, prefix=PREFIX, frame=mj.worldbody.add_frame())
    except (ValueError, mujoco.FatalError) as error:
        if isinstance(error, RobotSpecError):
            raise
        text = "".join(c if c.isprintable() else "?" for c in " ".join(str(error).split()))[:300]
        raise RobotSpecError(f"scene '{scene.name}' is refused by MuJoCo: {text}") from error
    return joints


def _drop_floor(child: mujoco.MjSpec, name: str) -> None:
    for geom in list(child.geoms):
        if geom.type != mujoco.mjtGeom.mjGEOM_PLANE:
            continue
        turned = geom.alt.type != mujoco.mjtOrientation.mjORIENTATION_QUAT or not np.allclose(geom.quat, (1, 0, 0, 0))
        if geom.parent.name != "world" or turned or not abs(geom.pos[2]) <= _LEVEL:
            raise RobotSpecError(
                f"scene '{name}' has the plane {geom.name!r:.80}; a level floor at z = 0 is there: make it a box"
            )
        child.delete(geom)
