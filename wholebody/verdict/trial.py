"""What becomes of one chunk in a simulation: the truth that judgements are compared with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from policy.chunk import ActionChunk
from policy.joints import layout_robot
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.episode.tracking_error import TrackingError
from wholebody.lending import Lending
from wholebody.sim.fall import detect_fall
from wholebody.types import RobotState, check_state
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import checkers

HOLD = 4.0
"""Time for which the robot has to stand after the last step [s]; definition, that of an episode."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a chunk.

    Attributes:
        fell: Whether the robot fell, until `HOLD` after the last step.
        time: When, since the chunk's first step [s]; None if it did not.
        cause: In words; empty if it did not.
        errors: Distances of the left and right palm from each step that was reached, at its own time, (n, 2) [m].
        turns: Angles likewise, shape (n, 2), [rad].
    """

    fell: bool
    time: float | None
    cause: str
    errors: np.ndarray
    turns: np.ndarray


def run_chunk(
    checker: Checker,
    chunk: ActionChunk,
    begin: RobotState,
    hold: float = HOLD,
    *,
    settled: Callable[[RobotState], bool] | None = None,
) -> Outcome:
    """Execute one chunk from a state on, its first step at once, in a checker's world by what follows chunks there.

    Args:
        checker: Holds robot and scene.
        chunk: A valid chunk.
        begin: Where the robot is; its time does not matter.
        hold: How long it has to stand after the last step [s].
        settled: Whether in a true state after the last step nothing can happen any more, so that the rest is left out.
    """
    follower, plant, sensors = checker.supervisor, checker.plant, checker.sensors
    state = plant.reset(begin)
    if sensors is not None:
        sensors.reset()
    measured = state if sensors is None else sensors.measure(state)
    follower.reset(measured, state.time)
    shifted, errors, fall = replace(chunk, t_obs=state.time), TrackingError(follower), None
    follower.accept(shifted, state.time)
    last = float(shifted.times[-1])
    while fall is None and state.time < last + hold - 1e-9:
        command = follower.step(measured, state.time)
        errors.follow(follower.chunk, follower.plan_report)
        errors.measure(state, follower.palm_reference())
        state = plant.step(command)
        measured = state if sensors is None else sensors.measure(state)
        fall = detect_fall(plant, state, follower.status.status)
        if settled is not None and state.time > last and settled(state):
            break
    palms = errors.result()
    told_fall = (None, "") if fall is None else (fall.time, fall.cause)
    return Outcome(
        fell=fall is not None, time=told_fall[0], cause=told_fall[1], errors=palms.errors, turns=palms.turns
    )  # fmt: skip


def as_given(chunk: ActionChunk, state: RobotState | None = None, config: ControllerConfig | None = None) -> Outcome:
    """What an executor without plans, filters and gate would make of a chunk: a function of its arguments alone.

    The whole-body program follows the chunk's hand paths as they are, with the stance as posture, on a robot and a
    floor as in the models.

    Args:
        chunk: What the hands are to do.
        state: Where the robot is; at rest with its hands at the chunk's first step if not given.
        config: Of the robot and its controller.

    Raises:
        ChunkError: If the chunk is malformed.
        InputError: If the state is.
    """
    config = config or ControllerConfig()
    chunk.validate(robot=layout_robot(describe(config.robot)))
    if state is None:
        with checkers.lend(config, "floor") as fast:
            fast.stand()
            body = fast.judge.first_pose(chunk).body
        state = RobotState(0.0, body.q, body.v)
    with _as_given.lend(config) as checker:
        return run_chunk(checker, chunk, check_state(state, checker.supervisor.robot.n_joints))


_as_given = Lending(lambda config: Checker(config=config, follow="as_given"))
