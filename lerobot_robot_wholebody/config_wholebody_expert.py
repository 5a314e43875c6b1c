"""Settings of the scripted expert: ``--teleop.NAME=VALUE``."""

from __future__ import annotations

from dataclasses import dataclass

from lerobot.teleoperators import TeleoperatorConfig


@TeleoperatorConfig.register_subclass("wholebody_expert")
@dataclass(kw_only=True)
class WholebodyExpertConfig(TeleoperatorConfig):
    """Somebody who does the robot's task, never twice in the same way."""

    robot_id: str | None = None
    """`id` of the robot to drive; the only one there is if not given."""
    seed: int = 0
    """Seed of the variations."""
