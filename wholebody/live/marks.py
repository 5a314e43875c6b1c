"""The marks of a scene on the page: lines, areas, discs and balls."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import viser

from wholebody.sim.pictures.scene import Mark, MarkKind


class Marks:
    """Draws marks, moves them, and hides those that are gone.

    Args:
        scene: Of the page.
    """

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._drawn: dict[str, object] = {}

    def show(self, marks: Iterable[Mark]) -> None:
        """Show these marks and no others."""
        wanted = {f"/marks/{mark.name}": mark for mark in marks}
        for name, mark in wanted.items():
            self._draw(name, mark)
        for name, drawn in self._drawn.items():
            drawn.visible = name in wanted

    def _draw(self, name: str, mark: Mark) -> None:
        """Draw a mark, or move it to where it is now."""
        colour, opacity = tuple(round(255 * part) for part in mark.show.colour[:3]), mark.show.colour[3]
        scene, old = self._scene, self._drawn.get(name)
        points = mark.points.astype(np.float32)
        if mark.kind is MarkKind.LINE:
            if old is None:
                self._drawn[name] = scene.add_line_segments(name, points[None], colour, thickness=2.0 * mark.size)
            else:
                old.points = points[None]
        elif mark.kind is MarkKind.AREA:
            if old is None:
                fan = np.array([[0, i, i + 1] for i in range(1, len(points) - 1)], dtype=np.uint32)
                self._drawn[name] = scene.add_mesh_simple(
                    name, points, fan, color=colour, opacity=opacity, side="double"
                )
        elif old is not None:
            old.position = mark.points[0]
        elif mark.kind is MarkKind.DISC:
            self._drawn[name] = scene.add_cylinder(name, mark.size, 0.002, color=colour, opacity=opacity)
        else:
            radius = mark.size or 0.022
            self._drawn[name] = scene.add_icosphere(name, radius, color=colour, opacity=opacity, position=points[0])
