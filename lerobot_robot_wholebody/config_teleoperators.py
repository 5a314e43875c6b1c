"""Settings of the teleoperators: ``--teleop.NAME=VALUE``."""

from __future__ import annotations

from dataclasses import dataclass

from lerobot.teleoperators import TeleoperatorConfig

HANDS = ("left", "right", "both")


@dataclass(kw_only=True)
class HandsTeleoperatorConfig(TeleoperatorConfig):
    """Which robot is driven."""

    robot_id: str | None = None
    """`id` of the robot to drive; the only one there is if not given."""


@TeleoperatorConfig.register_subclass("wholebody_expert")
@dataclass(kw_only=True)
class WholebodyExpertConfig(HandsTeleoperatorConfig):
    """Somebody who does the robot's task, never twice in the same way."""

    seed: int = 0
    """Seed of the variations."""


@TeleoperatorConfig.register_subclass("wholebody_motion")
@dataclass(kw_only=True)
class WholebodyMotionConfig(HandsTeleoperatorConfig):
    """A motion that is played, once an episode."""

    motion: str
    """Motion or chunk file, as `wholebody check` reads them, or the name of a script."""
    fps: float | None = None
    """Rate of a motion file [Hz]; that of its name, or else 60, if not given."""


@dataclass(kw_only=True)
class SteeringConfig(HandsTeleoperatorConfig):
    """Palms that are steered by their velocity."""

    hand: str = "right"
    """Which palm is steered: left, right or both."""
    speed: float = 0.2
    """Speed of a palm at full deflection [m/s]."""

    def __post_init__(self) -> None:
        if self.hand not in HANDS:
            raise ValueError(f"--teleop.hand={self.hand} is unknown; there are {', '.join(HANDS)}")
        if not 0.0 < self.speed <= 1.0:
            raise ValueError(f"--teleop.speed={self.speed} m/s is out of range: more than 0, at most 1")


@TeleoperatorConfig.register_subclass("wholebody_gamepad")
@dataclass(kw_only=True)
class WholebodyGamepadConfig(SteeringConfig):
    """A gamepad, as LeRobot reads it."""


@TeleoperatorConfig.register_subclass("wholebody_keyboard")
@dataclass(kw_only=True)
class WholebodyKeyboardConfig(SteeringConfig):
    """A keyboard, as LeRobot reads it."""


@TeleoperatorConfig.register_subclass("wholebody_socket")
@dataclass(kw_only=True)
class WholebodySocketConfig(HandsTeleoperatorConfig):
    """Another program on this computer."""

    path: str
    """Socket file that it connects to; made here, for its owner alone."""


@TeleoperatorConfig.register_subclass("wholebody_page")
@dataclass(kw_only=True)
class WholebodyPageConfig(HandsTeleoperatorConfig):
    """Handles that a person drags in the browser."""

    port: int = 8080
    """Port of the page on this computer; the next free one if it is taken."""
