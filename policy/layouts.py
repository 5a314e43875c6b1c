"""The action layouts that ship with the package. A layout never changes once released: a change is a new version."""

from __future__ import annotations

import difflib

from policy.errors import SpecError
from policy.joints import LEFT_HAND_JOINTS, RIGHT_HAND_JOINTS
from policy.spec import ActionSpec, Slot


def wbc32() -> ActionSpec:
    """Two wrist poses and all fingers: 32 numbers, which is exactly ``max_action_dim`` of π0 and π0.5 weights.

    Left wrist xyz and rot6d, right wrist likewise, left Dex3, right Dex3; absolute, in the measured pelvis.
    """
    return ActionSpec(
        name="wbc32",
        slots=stack(
            *wrist("left"),
            *wrist("right"),
            joints("left_hand", LEFT_HAND_JOINTS),
            joints("right_hand", RIGHT_HAND_JOINTS),
        ),
    )


def wrist(side: str, **settings: object) -> tuple[dict, dict]:
    """Position and rot6d (columns) of a wrist; settings such as ``mode`` or ``rot6d_layout`` replace the defaults."""
    shared = {key: value for key, value in settings.items() if key not in ("rot6d_layout", "tcp_offset")}
    tool = {"tcp_offset": settings["tcp_offset"]} if "tcp_offset" in settings else {}
    layout = settings.get("rot6d_layout", "cols")
    return (
        {"name": f"{side}_wrist_position", "kind": "position", "size": 3, "unit": "m", **shared, **tool},
        {"name": f"{side}_wrist_rotation", "kind": "rot6d", "size": 6, "unit": "1", "rot6d_layout": layout, **shared},
    )


def joints(name: str, names: tuple[str, ...], **settings: object) -> dict:
    """A joint slot in radians."""
    return {"name": name, "kind": "joint", "size": len(names), "unit": "rad", "joint_names": tuple(names), **settings}


def scalar(name: str, unit: str, **settings: object) -> dict:
    """A single number."""
    return {"name": name, "kind": "scalar", "size": 1, "unit": unit, **settings}


def stack(*parts: dict) -> tuple[Slot, ...]:
    """Slots one after the other."""
    slots, at = [], 0
    for part in parts:
        slots.append(Slot(start=at, **part))
        at += part["size"]
    return tuple(slots)


LAYOUTS = {"wbc32": wbc32}
"""Built-in layouts by name."""


def builtin(name: str) -> ActionSpec:
    """A built-in layout.

    Raises:
        SpecError: If there is none of that name.
    """
    if name not in LAYOUTS:
        near = difflib.get_close_matches(name, LAYOUTS, n=1)
        hint = f"did you mean '{near[0]}'? " if near else ""
        raise SpecError(f"no layout is called '{name}'; {hint}built in: {', '.join(LAYOUTS)}")
    return LAYOUTS[name]()
