"""Floor, table and shelf. Each piece says where on it an object goes."""

from __future__ import annotations

from collections.abc import Callable

import mujoco

from models.places import BOARD, ON_FLOOR, ON_SHELF, ON_TABLE, SHELF_HEIGHTS, TABLE_EDGE, TABLE_HEIGHT

Place = tuple[float, float, float]
"""Point on a surface in world [m], where the middle of an object's underside goes."""

_TOP = 0.5 * BOARD
_WOOD = (0.72, 0.58, 0.42, 1.0)
_FRICTION = (0.6, 0.005, 0.0001)  # wood on plastic or metal


def add_floor(mj: mujoco.MjSpec, friction: float) -> None:
    """A plane at z = 0 with a checker pattern, two lights and a camera that sees the robot."""
    mj.add_texture(
        name="checker",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=(0.30, 0.33, 0.36),
        rgb2=(0.24, 0.27, 0.30),
        width=64,
        height=64,
    )
    material = mj.add_material(name="checker", texrepeat=(4, 4), texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "checker"
    mj.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=(0.0, 0.0, 0.05),
        material="checker",
        friction=(friction, 0.005, 0.0001),
    )
    mj.worldbody.add_light(pos=(1.5, 1.5, 3.0), dir=(-0.4, -0.4, -1.0), diffuse=(0.7, 0.7, 0.7), castshadow=False)
    mj.worldbody.add_light(pos=(1.5, -2.0, 2.5), dir=(-0.4, 0.6, -1.0), diffuse=(0.4, 0.4, 0.4), castshadow=False)
    # Looks at (0.1, 0, 0.75) from the front left.
    mj.worldbody.add_camera(
        name="front", pos=(2.1, 1.6, 1.35), xyaxes=(-0.625, 0.781, 0.0, -0.181, -0.145, 0.973), fovy=45.0
    )
    mj.visual.global_.offwidth, mj.visual.global_.offheight = 1280, 720


def add_table(mj: mujoco.MjSpec) -> Place:
    """A table 0.75 m high whose near edge is 0.20 m ahead of the world origin."""
    _board(mj, "table", center=(TABLE_EDGE + 0.25, 0.0), half_size=(0.25, 0.5), height=TABLE_HEIGHT)
    for i, (x, y) in enumerate([(0.66, 0.46), (0.66, -0.46), (0.24, 0.46), (0.24, -0.46)]):
        half = 0.5 * (TABLE_HEIGHT - 2 * _TOP)
        mj.worldbody.add_geom(
            name=f"table_leg_{i}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=(0.02, 0.02, half),
            pos=(x, y, half),
            rgba=_WOOD,
            friction=_FRICTION,
        )
    return ON_TABLE


def add_shelf(mj: mujoco.MjSpec) -> Place:
    """Three boards, 0.35, 0.80 and 1.20 m high, between two side walls, 0.40 m ahead of the world origin."""
    for i, height in enumerate(SHELF_HEIGHTS):
        _board(mj, f"shelf_{i}", center=(0.55, 0.0), half_size=(0.15, 0.45), height=height)
    for side, y in (("left", 0.47), ("right", -0.47)):
        mj.worldbody.add_geom(
            name=f"shelf_{side}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=(0.15, _TOP, 0.75),
            pos=(0.55, y, 0.75),
            rgba=_WOOD,
            friction=_FRICTION,
        )
    return ON_SHELF


FURNITURE: dict[str, Callable[[mujoco.MjSpec], Place]] = {
    "floor": lambda _: ON_FLOOR,
    "table": add_table,
    "shelf": add_shelf,
}
"""Builders by name; each returns where an object goes."""


def _board(
    mj: mujoco.MjSpec, name: str, *, center: tuple[float, float], half_size: tuple[float, float], height: float
) -> None:
    mj.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=(*half_size, _TOP),
        pos=(*center, height - _TOP),
        rgba=_WOOD,
        friction=_FRICTION,
    )
