"""Parts that layouts are made of: the slots of a wrist, of joints, of fingers, of a base, one after the other."""

from __future__ import annotations

from models.spec import RobotSpec
from policy.action_spec.slot import CLOSING, FOREIGN_HANDS, Slot
from policy.joints import joints_of


def wrist(side: str, **settings: object) -> tuple[dict, dict]:
    """Position and rot6d (columns) of a wrist; settings such as ``mode`` or ``rot6d_layout`` replace the defaults."""
    shared = {key: value for key, value in settings.items() if key not in ("rot6d_layout", "tcp_offset")}
    tool = {"tcp_offset": settings["tcp_offset"]} if "tcp_offset" in settings else {}
    layout = settings.get("rot6d_layout", "cols")
    return (
        {"name": f"{side}_wrist_position", "kind": "position", "size": 3, "unit": "m", **shared, **tool},
        {"name": f"{side}_wrist_rotation", "kind": "rot6d", "size": 6, "unit": "1", "rot6d_layout": layout, **shared},
    )


def joints(
    robot: RobotSpec, part: str, *, order: tuple[str, ...] = (), first: int | None = None, **settings: object
) -> dict:
    """A slot of the joints of a part of a robot [rad].

    Args:
        robot: The robot.
        part: One of `policy.joints.PARTS`.
        order: Names of those that come first, in this order; the others follow in motor order.
        first: Number of joints from the beginning of the motor order; all if None.
        **settings: Further fields of the slot.
    """
    names = joints_of(robot, part)[:first]
    names = (*(name for name in order if name in names), *(name for name in names if name not in order))
    return {"name": part, "kind": "joint", "size": len(names), "unit": "rad", "joint_names": names, **settings}


def scalar(name: str, unit: str, **settings: object) -> dict:
    """A single number."""
    return {"name": name, "kind": "scalar", "size": 1, "unit": unit, **settings}


def force(side: str) -> dict:
    """Force that the world is expected to put on a palm, in the stance."""
    return {"name": f"{side}_force", "kind": "force", "size": 3, "unit": "N", "frame": "stance"}


def velocity() -> dict:
    """Planar velocity x, y and yaw rate of the base."""
    return {"name": "base_velocity", "kind": "velocity", "size": 3, "unit": "m/s, rad/s"}


def lean() -> tuple[dict, dict]:
    """Height of the pelvis above the soles, and its roll and pitch."""
    tilt = {"name": "base_tilt", "kind": "tilt", "size": 2, "unit": "rad"}
    return scalar("base_height", "m", frame="stance"), tilt


def stack(*parts: dict) -> tuple[Slot, ...]:
    """Slots one after the other; what the robot has no joints for is left out."""
    slots, at = [], 0
    for part in parts:
        if not part["size"]:
            continue
        slots.append(Slot(start=at, **part))
        at += part["size"]
    return tuple(slots)


def grasp(side: str, is_open: float, closed: float) -> dict:
    """Closing number of a hand, with the values that stand for open and closed."""
    return scalar(f"{side}_grasp", CLOSING, closing=(is_open, closed))


def fingers(side: str, hand: str, is_open: float, closed: float) -> dict:
    """A closing number a finger of another hand, one of `policy.action_spec.slot.FOREIGN_HANDS`."""
    names = FOREIGN_HANDS[hand]
    shared = {"unit": CLOSING, "closing": (is_open, closed), "joint_names": names}
    return {"name": f"{side}_hand", "kind": "fingers", "size": len(names), **shared}


def ignored(name: str, size: int, reason: str) -> dict:
    """Numbers that are not used."""
    return {"name": name, "kind": "ignored", "size": size, "unit": "", "reason": reason}
