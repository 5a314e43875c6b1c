"""What LeRobot's loops do not tell a plugin: when they wait, and which phase of a recording they are in.

LeRobot 0.6.1 calls a robot twice a step, waits in between by ``precise_sleep`` and measures by ``time.perf_counter``.
It tells no one that an episode begins or is over, and shows observations to teleoperators of its own G1 only. So names
by which its loops know these functions are replaced while a robot is connected:

- ``record_loop`` says the phase: ``episode`` with a dataset, ``reset`` without one.
- in lockstep ``precise_sleep`` lets simulated time pass, and ``time.perf_counter`` reads it.

Modules without those names are left alone.
"""

from __future__ import annotations

import functools
import sys
import time
from collections.abc import Callable
from types import ModuleType, SimpleNamespace
from typing import Protocol

from lerobot_robot_wholebody.config_wholebody_g1 import WholebodyG1Config


class Paced(Protocol):
    """What LeRobot's loops are tied to: a robot with a clock of its own."""

    config: WholebodyG1Config

    def now(self) -> float:
        """Present time of the robot [s]."""

    def let_pass(self, seconds: float) -> None:
        """Let simulated time pass [s]."""

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


def _telling(record_loop: Callable, robot: Paced) -> Callable:
    @functools.wraps(record_loop)
    def told(*args: object, **named: object) -> object:
        robot.begin("reset" if named.get("dataset") is None else "episode")
        return record_loop(*args, **named)

    return told
