"""The scene of one instant in words and marks; MuJoCo or a page only draw it.

A picture has the robot and the scene's objects as they are, and over them the marks of `Scene.marks`: where the palms
are asked and commanded to be, the error between asked and reached, the support polygon, and how the robot stands on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from policy.geometry.rotations import matrix_to_rotvec
from wholebody.robot.support_polygon import SupportPolygon, convex_polygon
from wholebody.sim.record import PERIODS, SIDES, Record
from wholebody.types import Reason, Status

Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, 0 to 1."""

GHOST_DISTANCE, GHOST_ANGLE = 0.005, np.radians(3.0)
"""A hand that is less far from where it is asked to be [m, rad] hides its ghost: a halo says that it is there."""
ON_FLOOR = 0.002
"""Height of what is drawn on the floor, so that it is seen [m]."""

SCENE_COLUMNS = (
    *("time", "q", "objects", "status", "reason", "detail", "details", "rate", "scene", "joint_names"),
    *(name for name in PERIODS if name.startswith("T_world_palms_")),
    *("com", "capture_point", "pressure", "pressure_margin", "soles", "carries", "orientation_free"),
)
"""Columns of a recording that scenes are made of."""


class MarkKind(Enum):
    """What a mark looks like."""

    HAND = "hand"
    """The bodies of a hand, as they are, moved to where the palm would be at a pose."""
    BALL = "ball"
    LINE = "line"
    DISC = "disc"
    """Flat on the floor."""
    AREA = "area"
    """A convex polygon, flat on the floor, with its outline."""


class Show(Enum):
    """What a mark stands for, with what a legend calls it and its colour.

    Blue, orange, green and vermilion can be told apart by everybody (Okabe and Ito 2008, "Color Universal Design").
    """

    ASKED = "asked by the chunk", (0.90, 0.62, 0.00, 0.45)
    COMMANDED = "commanded", (0.00, 0.45, 0.70, 1.0)
    ERROR = "error: palm to asked", (0.84, 0.15, 0.10, 1.0)
    SUPPORT = "support polygon", (0.00, 0.62, 0.45, 0.35)
    PRESSURE = "centre of pressure", (0.05, 0.05, 0.05, 1.0)
    CAPTURE = "capture point", (0.80, 0.47, 0.65, 1.0)
    MASS = "centre of mass", (0.35, 0.35, 0.40, 1.0)

    def __init__(self, legend: str, colour: Colour) -> None:
        self.legend, self.colour = legend, colour


@dataclass(frozen=True)
class Mark:
    """Something to be drawn over robot and objects.

    Attributes:
        show: What it stands for; gives the colour.
        kind: What it looks like.
        points: Centre of a ball or a disc, ends of a line, corners of an area counter-clockwise; shape (k, 3), [m].
        size: Radius of a ball or a disc, or half the thickness of a line [m].
        side: Whose palm or hand it is about, if one's.
        T_world_palm: Of a hand, shape (4, 4).
    """

    show: Show
    kind: MarkKind
    points: np.ndarray
    size: float = 0.0
    side: str = ""
    T_world_palm: np.ndarray | None = None

    @property
    def name(self) -> str:
        """Name of the mark, the same in every scene, for those who move what they have drawn; unique in a scene."""
        return "_".join(part for part in (self.show.name.lower(), self.kind.value, self.side) if part)


STATUS_COLOUR: dict[Status, Colour] = {
    Status.TRACKING: (0.00, 0.55, 0.36, 1.0),
    Status.SLOWED: (0.80, 0.50, 0.00, 1.0),
    Status.HOLD: (0.35, 0.40, 0.47, 1.0),
    Status.STOP: (0.80, 0.20, 0.05, 1.0),
    Status.DAMPING: (0.65, 0.00, 0.10, 1.0),
}


@dataclass(frozen=True)
class Scene:
    """One instant.

    Attributes:
        time: [s]
        q: Configuration of the robot in Pinocchio's order, shape (nq,).
        objects: Position and quaternion wxyz of the scene's bodies that move, shape (k, 7).
        asked: Palm poses that the chunk asks for, left first, shape (2, 4, 4); None before the first chunk.
        commanded, measured: Palm poses that are commanded and that there are, likewise.
        support: Where the robot stands.
        pressure: Centre of pressure, shape (2,), [m]; None in the air.
        com: Centre of mass, shape (3,), [m].
        capture_point: Shape (2,), [m].
        status: What the supervisor does.
        reason: Why; None when all is well.
        detail: The supervisor's sentence.
        rate: Speed along the plan, 1 at the chunk's own.
        orientation_free: Whether the orientation of the left and of the right palm is free.
    """

    time: float
    q: np.ndarray
    objects: np.ndarray
    asked: np.ndarray | None
    commanded: np.ndarray
    measured: np.ndarray
    support: SupportPolygon
    pressure: np.ndarray | None
    com: np.ndarray
    capture_point: np.ndarray
    status: Status
    reason: Reason | None = None
    detail: str = ""
    rate: float = 1.0
    orientation_free: tuple[bool, bool] = (False, False)

    @property
    def errors(self) -> np.ndarray | None:
        """Distances of the palms from where the chunk asks them to be, shape (2,), [m]; None before the first chunk."""
        if self.asked is None:
            return None
        return np.linalg.norm(self.measured[:, :3, 3] - self.asked[:, :3, 3], axis=1)

    @property
    def turns(self) -> np.ndarray | None:
        """Angles of the palms to those that the chunk asks for, shape (2,), [rad]; None before the first chunk."""
        if self.asked is None:
            return None
        R = np.swapaxes(self.asked[:, :3, :3], 1, 2) @ self.measured[:, :3, :3]
        return np.linalg.norm(matrix_to_rotvec(R), axis=1)

    @property
    def balance_margin(self) -> float | None:
        """Distance of the centre of pressure from the edge of the support, positive inside [m]; None in the air."""
        if self.pressure is None:
            return None
        return self.support.margin(self.pressure)

    def words(self) -> tuple[str, str]:
        """Status with its reason, and the numbers of the instant."""
        why = f" ({self.reason}): {self.detail or self.reason.sentence}" if self.reason else ""
        numbers = []
        if self.errors is not None:
            numbers += [f"{side} palm off by {distance}" for side, distance in zip(SIDES, self._off(), strict=True)]
        margin = self.balance_margin
        numbers.append("in the air" if margin is None else f"balance margin {1e3 * margin:.0f} mm")
        if self.asked is not None and abs(self.rate - 1.0) >= 0.005:
            numbers.append(f"speed {self.rate:.2f}")
        return f"{self.status.value}{why}", ", ".join(numbers)

    def _off(self) -> list[str]:
        """How far the palms are off, in words; angles only where an orientation is asked for."""
        return [
            f"{1e3 * error:.0f} mm" + ("" if free else f", {np.degrees(turn):.0f}°")
            for error, turn, free in zip(self.errors, self.turns, self.orientation_free, strict=True)
        ]

    def marks(self) -> tuple[Mark, ...]:
        """What is drawn over robot and objects, what is nearer to the floor first."""
        return (*self._balance(), *self._palms())

    def _balance(self) -> list[Mark]:
        foot = np.array([*self.com[:2], ON_FLOOR])
        marks = [
            Mark(Show.SUPPORT, MarkKind.AREA, on_floor(self.support.vertices), 0.003),
            Mark(Show.MASS, MarkKind.LINE, np.stack([self.com, foot]), 0.003),
            Mark(Show.MASS, MarkKind.BALL, self.com[None], 0.02),
            Mark(Show.CAPTURE, MarkKind.DISC, on_floor(self.capture_point[None], 2.0), 0.016),
        ]
        if self.pressure is not None:
            marks.append(Mark(Show.PRESSURE, MarkKind.DISC, on_floor(self.pressure[None], 3.0), 0.011))
        return marks

    def _palms(self) -> list[Mark]:
        balls = zip(SIDES, self.commanded, strict=True)
        marks = [Mark(Show.COMMANDED, MarkKind.BALL, T[None, :3, 3], 0.018, side) for side, T in balls]
        if self.asked is None:
            return marks
        for hand, side in enumerate(SIDES):
            asked, error, turn = self.asked[hand], self.errors[hand], self.turns[hand]
            ends = np.stack([self.measured[hand, :3, 3], asked[:3, 3]])
            if error >= GHOST_DISTANCE or (turn >= GHOST_ANGLE and not self.orientation_free[hand]):
                marks.append(Mark(Show.ERROR, MarkKind.LINE, ends, 0.006, side))
                marks.append(Mark(Show.ASKED, MarkKind.HAND, ends[1:], 0.0, side, asked))
            else:
                marks.append(Mark(Show.ASKED, MarkKind.BALL, ends[1:], 0.03, side))
        return marks


def on_floor(points: np.ndarray, layer: float = 1.0) -> np.ndarray:
    """Points (k, 2) as points (k, 3) just above the floor, higher layers over lower ones."""
    return np.column_stack([points, np.full(len(points), layer * ON_FLOOR)])


def scene_at(record: Record, row: int) -> Scene:
    """The scene of a control period of a recording.

    Args:
        record: With `SCENE_COLUMNS` at least.
        row: Which period.
    """
    poses = {name: record[f"T_world_palms_{name}"][row] for name in ("asked", "commanded", "measured")}
    pressure, reason = record["pressure"][row], str(record["reason"][row])
    left, right = record["orientation_free"].tolist()
    return Scene(
        time=float(record["time"][row]),
        q=record["q"][row],
        objects=record["objects"][row],
        asked=poses["asked"] if np.isfinite(poses["asked"]).all() else None,
        commanded=poses["commanded"],
        measured=poses["measured"],
        support=convex_polygon(record["soles"][row][record["carries"][row] > 0]),
        pressure=pressure if np.isfinite(pressure).all() else None,
        com=record["com"][row],
        capture_point=record["capture_point"][row],
        status=Status(str(record["status"][row])),
        reason=Reason(reason) if reason else None,
        detail=str(record["details"][record["detail"][row]]),
        rate=float(record["rate"][row]),
        orientation_free=(bool(left), bool(right)),
    )
