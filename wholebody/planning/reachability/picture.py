"""A picture of the map: from the side by payload, and from above by height, for every turn of the palms."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_collision, load_pinocchio, stance_q
from models.spec import RobotSpec
from wholebody.collision.shapes import hull_corners
from wholebody.errors import require_extra
from wholebody.planning.reachability.pairs import BOX_HIGH, BOX_LOW, MIRROR, PALM_AT_REST, TURNS, Pairs, Turn
from wholebody.robot.support_polygon import convex_polygon

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from wholebody.planning.reachability.reach_map import ReachabilityMap

ASIDE = 0.2
"""How far both palms are from the middle, from the side [m]; chosen: as in the stance."""
PAYLOADS, HEIGHTS = (0.0, 1.0, 2.0), (0.3, 0.6, 0.9, 1.2, 1.5)
"""Masses in each hand [kg] and heights of the left palm [m] that have a line; chosen."""
FINE = 0.02
"""Distance of two points [m]; chosen: one or two pixels."""


def draw(reach_map: ReachabilityMap, spec: RobotSpec, output: str | Path) -> None:
    """Write a picture (.png).

    Args:
        reach_map: The map.
        spec: The robot, whose outline in its stance is behind the borders.
        output: The file.

    Raises:
        InputError: If the extra is not installed.
    """
    require_extra("plot", "matplotlib", "the picture of a map")
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15.0, 6.8), layout="constrained")
    axes, bodies = figure.subplots(2, len(TURNS), sharex=True, sharey="row"), outline(spec)
    for (side, above), turn in zip(axes.T, TURNS, strict=True):
        title = turn.sentence.replace(", ", ",\n")
        side.set_title(f"{turn}: {title}", fontsize=10)
        for ax, seen in ((side, [0, 2]), (above, [0, 1])):
            for points in bodies:
                ax.fill(*convex_polygon(points[:, seen]).vertices.T, color="0.75", linewidth=0.0, zorder=0)
        for i, mass in enumerate(PAYLOADS):
            x, z, room = _from_the_side(reach_map, turn, mass)
            colour = colormaps["viridis"](0.4 * i)
            if mass == 0.0:
                side.contourf(x, z, room, levels=[0.0, np.inf], colors=[colour], alpha=0.12)
            _line(side, x, z, room, colour, f"{mass:g} kg in each hand")
        for i, height in enumerate(HEIGHTS):
            x, y, room = _from_above(reach_map, turn, height)
            _line(above, x, y, room, colormaps["plasma"](0.2 * i), f"{height:g} m high")
        above.plot(*(PALM_AT_REST @ MIRROR)[:2], "kx")
        side.set_aspect("equal")
        above.set_aspect("equal")
        above.set_xlabel("ahead [m]")
    axes[0, 0].set_ylabel(f"height [m], both palms {ASIDE:g} m aside")
    axes[1, 0].set_ylabel("left palm to the left [m],\nright one at rest (x), empty hands")
    for row in axes:
        row[-1].legend(*row[0].get_legend_handles_labels(), loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    figure.savefig(output, dpi=110)


def outline(spec: RobotSpec) -> list[np.ndarray]:
    """Corners of the hulls of a robot in its stance, a body each, shape (n, 3), in world [m]."""
    model = load_pinocchio(spec)
    geometry, data, found = load_collision(spec, model), model.createData(), []
    pin.forwardKinematics(model, data, stance_q(spec, model))
    for item in geometry.geometryObjects:
        corners = hull_corners(item.geometry)
        if corners is not None:
            T = data.oMi[item.parentJoint] * item.placement
            found.append(corners @ T.rotation.T + T.translation)
    return found


def _line(axes: Axes, x: np.ndarray, y: np.ndarray, room: np.ndarray, colour: tuple, name: str) -> None:
    axes.contour(x, y, room, levels=[0.0], colors=[colour], linewidths=1.6)
    axes.plot([], [], color=colour, label=name)


def _from_the_side(reach_map: ReachabilityMap, turn: Turn, mass: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    x, z = np.meshgrid(np.arange(BOX_LOW[0], BOX_HIGH[0], FINE), np.arange(BOX_LOW[2], BOX_HIGH[2], FINE))
    left = np.stack([x, np.full_like(x, ASIDE), z], axis=-1)
    return x, z, _rooms(reach_map, left, left @ MIRROR, turn, mass)


def _from_above(reach_map: ReachabilityMap, turn: Turn, height: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    x, y = np.meshgrid(np.arange(BOX_LOW[0], BOX_HIGH[0], FINE), np.arange(BOX_LOW[1], BOX_HIGH[1], FINE))
    left = np.stack([x, y, np.full_like(x, height)], axis=-1)
    return x, y, _rooms(reach_map, left, np.broadcast_to(PALM_AT_REST @ MIRROR, left.shape), turn, 0.0)


def _rooms(reach_map: ReachabilityMap, left: np.ndarray, right: np.ndarray, turn: Turn, mass: float) -> np.ndarray:
    points = np.stack([left, right], axis=-2).reshape(-1, 2, 3)
    n = len(points)
    pairs = Pairs(points, np.full(n, TURNS.index(turn)), np.full((n, 2), mass))
    return reach_map.rooms(pairs).reshape(left.shape[:2])
