"""What a robot that walks with a recorded motion can do: the limits that its way and its hands are made for."""

from __future__ import annotations

from models.pinocchio_model import stance_q
from policy.recorded.walked_motion import WalkLimits
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.execution.feet.hands_of_walks import HandsOfWalks
from wholebody.execution.feet.led_walk import calm
from wholebody.execution.feet.wanted import shares_of_fastest
from wholebody.reference import HandLimits
from wholebody.robot.state import Robot
from wholebody.walking.gait import Gait
from wholebody.walking.guide import ACCELERATION

SHARE = 0.9
"""Share of the speeds of led hands that a recorded motion is played with [no unit]; chosen: the rest is what drawing
in between its rows adds."""


def walk_limits(config: ControllerConfig) -> WalkLimits | None:
    """Limits of a configured robot, for `policy.recorded.replay.open_recording`; None of one that does not walk."""
    if config.steps != "reach":
        return None
    robot = Robot(describe(config.robot))
    (hand,) = calm((HandLimits(),))
    return WalkLimits(
        share=shares_of_fastest,
        acceleration=ACCELERATION,
        hands=(SHARE * hand.position.speed, SHARE * hand.orientation.speed),
        shift=Gait().shift,
        near=config.verdict.palm_feasible,
        far=config.verdict.palm_repair,
        nearest=HandsOfWalks(robot, stance_q(robot.spec, robot.model)).nearest,
    )
