"""The protocol of what turns chunks into joint commands, a control period at a time."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np

from models.spec import RobotSpec
from policy.chunk import ActionChunk
from wholebody.config import ControllerConfig
from wholebody.control.tick_report import TickReport
from wholebody.execution.handover import Handover
from wholebody.execution.state_monitor import StateMonitor
from wholebody.planning.plan import PlanReport
from wholebody.reference import HandMotion
from wholebody.robot.contact_schedule import ContactSchedule
from wholebody.robot.state import Robot
from wholebody.types import JointCommand, Reason, RobotState, StatusReport


@runtime_checkable
class ChunkExecutor(Protocol):
    """Follows chunks on a robot: `Supervisor` with all that keeps the robot up, `AsGiven` by the tick's program alone.

    Attributes:
        spec: The robot.
        config: Settings.
        robot: The robot's model; knows the order of the joints.
        monitor: Says which measured states are used.
        chunk: The chunk that is followed, or None.
        plan_report: What following that chunk changes in it, or None.
        last_tick: Report of the last tick, or None.
        contacts: Which feet are to stand where, on the clock of the states.
        status: Status after the last `step` or `accept`.
    """

    spec: RobotSpec
    config: ControllerConfig
    robot: Robot
    monitor: StateMonitor
    chunk: ActionChunk | None
    plan_report: PlanReport | None
    last_tick: TickReport | None
    contacts: ContactSchedule
    status: StatusReport

    @property
    def handover(self) -> Handover | None:
        """Plans on their way; None where nothing is planned."""
        ...

    @property
    def rate(self) -> float:
        """Speed along the chunk, 1 at its own."""
        ...

    @property
    def time_factor(self) -> float:
        """Time spent on chunks over chunk time covered; 1 is unslowed."""
        ...

    @property
    def moved_for(self) -> Reason | None:
        """Why a hand is commanded elsewhere than the chunk has it, or None."""
        ...

    @property
    def walks(self) -> bool:
        """Whether the base velocity of the newest chunk is followed."""
        ...

    @property
    def not_led(self) -> str | None:
        """Why a walk is not made with the newest chunk's hands, in words, though it says a base velocity."""
        ...

    @property
    def carried(self) -> np.ndarray | None:
        """How the poses of the chunk have moved with the base of a walk that it leads, shape (4, 4); None for none."""
        ...

    def reset(self, state: RobotState, now: float | None = None) -> None:
        """Start an episode, now [s], from a measured state of standing."""
        ...

    def accept(self, chunk: ActionChunk, now: float | None = None) -> StatusReport:
        """Take a chunk, now [s], or refuse it with a reason; a refused chunk changes nothing."""
        ...

    def take_refusal(self) -> StatusReport | None:
        """Reason, said once, why the chunk that was accepted last is not followed after all; None if it is."""
        ...

    def step(self, state: RobotState, now: float | None = None) -> JointCommand:
        """Command for one control period, from a measured state, now [s]."""
        ...

    def palm_reference(self) -> dict[str, np.ndarray]:
        """Commanded palm poses in world (4, 4), by side."""
        ...

    def ahead(self, times: np.ndarray) -> tuple[HandMotion, HandMotion] | None:
        """Motions of both hands as commanded at times (n,) near the present [s]; None while no chunk is followed."""
        ...
