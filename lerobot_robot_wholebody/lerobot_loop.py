"""What LeRobot's loops do not tell a plugin: when they wait, and which phase of a recording they are in.

LeRobot 0.6.1 calls a robot twice a step, waits in between by ``precise_sleep`` and measures by ``time.perf_counter``.
It tells no one that an episode begins or is over, and shows observations to teleoperators of its own G1 only. So names
by which its loops know these functions are replaced while a robot is connected:

- ``record_loop`` says the phase: ``episode`` with a dataset, ``reset`` without one.
- with ``record=executed`` its dataset gets, one step later, what was done instead of what was asked for.
- in lockstep ``precise_sleep`` lets simulated time pass, and ``time.perf_counter`` reads it.

Modules without those names are left alone.
"""

from __future__ import annotations

import functools
import sys
import time
from collections.abc import Callable
from types import ModuleType, SimpleNamespace
from typing import Any, Protocol

from lerobot_robot_wholebody.config_wholebody_g1 import WholebodyG1Config


class Paced(Protocol):
    """What LeRobot's loops are tied to: a robot with a clock of its own."""

    config: WholebodyG1Config

    def now(self) -> float:
        """Present time of the robot [s]."""

    def let_pass(self, seconds: float) -> None:
        """Let simulated time pass [s]."""

    def get_observation(self) -> dict[str, Any]:
        """Look at the robot."""

    def executed(self) -> dict[str, float]:
        """Numbers of the action that is done where the robot was seen last."""

    def begin(self, phase: str) -> None:
        """Begin an ``episode``, or a ``reset`` between two."""


class Loops:
    """The names that are replaced, until `leave`.

    Args:
        robot: Told of phases, and waited for in lockstep.
    """

    def __init__(self, robot: Paced) -> None:
        from lerobot.utils.robot_utils import precise_sleep

        self._before: list[tuple[ModuleType, str, object]] = []
        lockstep = robot.config.clock == "lockstep"
        simulated = SimpleNamespace(**vars(time)) if lockstep else None
        if lockstep:
            simulated.perf_counter = robot.now
        for module in list(sys.modules.values()):
            if not isinstance(module, ModuleType) or vars(module).get("precise_sleep") is not precise_sleep:
                continue
            if module.__name__ == precise_sleep.__module__:
                continue
            if lockstep:
                self._replace(module, "precise_sleep", lambda seconds, *_, **__: robot.let_pass(seconds))
                if vars(module).get("time") is time:
                    self._replace(module, "time", simulated)
            if "record_loop" in vars(module):
                self._replace(module, "record_loop", _telling(module.record_loop, robot))

    def _replace(self, module: ModuleType, name: str, value: object) -> None:
        self._before.append((module, name, getattr(module, name)))
        setattr(module, name, value)

    def leave(self) -> None:
        """Put everything back."""
        while self._before:
            setattr(*self._before.pop())


class Executed:
    """A dataset whose frames are written with the executed action instead of the requested one.

    Args:
        dataset: Of LeRobot.
        robot: Seen once a frame, before the frame is added.
    """

    def __init__(self, dataset: Any, robot: Paced) -> None:
        self._dataset, self._robot, self._waiting = dataset, robot, None

    def __getattr__(self, name: str) -> Any:
        """Whatever else the dataset has."""
        return getattr(self._dataset, name)

    def add_frame(self, frame: dict[str, Any]) -> None:
        """Add the frame before with the action executed since; this frame waits for its own."""
        self._add()
        self._waiting = frame

    def finish(self) -> None:
        """Add the last frame, with the action executed up to now."""
        if self._waiting is not None:
            self._robot.get_observation()
            self._add()
            self._waiting = None

    def _add(self) -> None:
        if (frame := self._waiting) is not None:
            import numpy as np

            action, done = frame["action"], self._robot.executed()
            names = self._dataset.features["action"]["names"]
            self._dataset.add_frame(frame | {"action": np.array([done[name] for name in names], dtype=action.dtype)})


def _telling(record_loop: Callable, robot: Paced) -> Callable:
    @functools.wraps(record_loop)
    def reporting(*args: object, **named: object) -> object:
        dataset = named.get("dataset")
        robot.begin("reset" if dataset is None else "episode")
        if dataset is None or robot.config.record == "requested":
            return record_loop(*args, **named)
        named["dataset"] = done = Executed(dataset, robot)
        try:
            return record_loop(*args, **named)
        finally:
            done.finish()

    return reporting
