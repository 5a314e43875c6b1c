"""What keeps a robot that stands from a motion, in words."""

from __future__ import annotations

import numpy as np

from wholebody.control.base import Controller


def words(controller: Controller, margin: float) -> str:
    """What keeps a robot that stands from a balanced motion, in words; empty if that is not known.

    Args:
        controller: After its last tick.
        margin: How far inside the soles plans keep the centre of mass [m].
    """
    robot, support = controller.robot, controller.support
    away = support.normals @ robot.com[:2] - support.offsets
    k = int(np.argmax(away))
    if away[k] <= -margin:
        return ""
    x, y = support.normals[k].tolist()
    way = ("ahead" if x > 0.0 else "behind") if abs(x) >= abs(y) else ("to the left" if y > 0.0 else "to the right")
    where = f"{1e3 * away[k]:.0f} mm outside" if away[k] > 0.0 else f"{-1e3 * away[k]:.0f} mm inside"
    kept = f"plans keep it {1e3 * margin:.0f} mm inside"
    return f"it leans: its centre of mass is {where} the edge of its soles {way}, and {kept}"
