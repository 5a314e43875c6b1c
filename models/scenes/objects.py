"""Objects to grasp: free bodies named ``object``, whose contacts take their own friction."""

from __future__ import annotations

from collections.abc import Callable

import mujoco

from models.places import CARTON_WIDTH, CRATE_WIDTH
from models.scenes.furniture import Place

OBJECT_BODY = "object"
"""Name of the body (and its geom and, with ``_free`` behind it, its joint)."""

# Sliding, torsional [m], rolling [m]. Rubber finger pads on plastic slide at about 1.0; a pad of about 10 mm across
# resists turning like a lever of a few millimetres.
_FRICTION = (1.0, 0.005, 0.0001)
# Contact that does not slide sideways needs torsion too, so 4 dimensions.
_CONDIM = 4


def add_cylinder(mj: mujoco.MjSpec, place: Place) -> list[float]:
    """An upright cylinder: 0.3 kg, 60 mm in diameter, 160 mm high."""
    return _add(mj, place, mujoco.mjtGeom.mjGEOM_CYLINDER, (0.03, 0.08, 0.0), 0.3, (0.85, 0.35, 0.20, 1.0))


def add_box(mj: mujoco.MjSpec, place: Place) -> list[float]:
    """A box: 0.5 kg, 60 x 60 x 180 mm."""
    return _add(mj, place, mujoco.mjtGeom.mjGEOM_BOX, (0.03, 0.03, 0.09), 0.5, (0.25, 0.50, 0.80, 1.0))


def add_can(mj: mujoco.MjSpec, place: Place) -> list[float]:
    """A full drinks can: 0.35 kg, 66 mm in diameter, 115 mm high."""
    return _add(mj, place, mujoco.mjtGeom.mjGEOM_CYLINDER, (0.033, 0.0575, 0.0), 0.35, (0.75, 0.75, 0.78, 1.0))


def add_flask(mj: mujoco.MjSpec, place: Place) -> list[float]:
    """A full steel flask: 1 kg, as large as the cylinder."""
    return _add(mj, place, mujoco.mjtGeom.mjGEOM_CYLINDER, (0.03, 0.08, 0.0), 1.0, (0.45, 0.55, 0.50, 1.0))


def add_carton(mj: mujoco.MjSpec, place: Place) -> list[float]:
    """A carton in the middle, to be brushed by both thumbs: 1 kg, 160 x 200 x 160 mm."""
    at, brown = (place[0], 0.0, place[2]), (0.70, 0.55, 0.35, 1.0)
    return _add(mj, at, mujoco.mjtGeom.mjGEOM_BOX, (0.08, 0.5 * CARTON_WIDTH, 0.08), 1.0, brown)


def add_crate(mj: mujoco.MjSpec, place: Place) -> list[float]:
    """A crate in the middle, for two hands: 2 kg, 160 x 300 x 180 mm."""
    at, green = (place[0], 0.0, place[2]), (0.25, 0.55, 0.35, 1.0)
    return _add(mj, at, mujoco.mjtGeom.mjGEOM_BOX, (0.08, 0.5 * CRATE_WIDTH, 0.09), 2.0, green)


OBJECTS: dict[str, Callable[[mujoco.MjSpec, Place], list[float]]] = {
    "cylinder": add_cylinder,
    "box": add_box,
    "can": add_can,
    "flask": add_flask,
    "carton": add_carton,
    "crate": add_crate,
}
"""Builders by name."""


def _add(
    mj: mujoco.MjSpec,
    place: Place,
    shape: mujoco.mjtGeom,
    size: tuple[float, float, float],
    mass: float,
    rgba: tuple[float, float, float, float],
) -> list[float]:
    """Add an object; position and quaternion wxyz of its free joint."""
    half_height = size[2] or size[1]
    x, y, z = place
    pos = (x, y, z + half_height)
    body = mj.worldbody.add_body(name=OBJECT_BODY, pos=pos)
    body.add_freejoint().name = f"{OBJECT_BODY}_free"
    body.add_geom(
        name=OBJECT_BODY,
        type=shape,
        size=size,
        mass=mass,
        rgba=rgba,
        friction=_FRICTION,
        condim=_CONDIM,
        priority=1,
    )
    return [*pos, 1.0, 0.0, 0.0, 0.0]
