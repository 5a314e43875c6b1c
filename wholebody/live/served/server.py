"""The control loop of a robot that is served to another program; `wholebody.cli.serve_robot` runs it.

Where the program is gone, however that came, the robot is lowered and everything ends.
"""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING

from wholebody.live.served.messages import Served
from wholebody.live.served.program import RemoteProgram

if TYPE_CHECKING:
    from wholebody.config import ControllerConfig
    from wholebody.execution.gate import Gate
    from wholebody.live.served.lockstep import InLockstep
    from wholebody.live.served.wall import OnTheWall


def settings_of(served: Served) -> ControllerConfig:
    """Settings of the controller, as the file has them, for the robot asked for."""
    from wholebody.config import ControllerConfig
    from wholebody.config.file import load_config

    settings = load_config(Path(served.config)) if served.config else ControllerConfig()
    return replace(settings, robot=replace(settings.robot, model=served.robot or settings.robot.model))


def serve(connection: Connection, gate: Callable[[ControllerConfig, Served], Callable[[], Gate]]) -> None:
    """Serve one program from its first message on.

    Args:
        connection: To the program.
        gate: Says who makes what judges plans, in whatever process computes them, where the program wants that.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    program = RemoteProgram(connection)
    try:
        served = connection.recv()
        settings = settings_of(served)
        robot = _robot(served, settings, program, gate(settings, served) if served.gate else None)
    except EOFError:
        return
    except Exception as error:  # noqa: BLE001 - told to the program, which ends with it
        program.tell(error)
        return
    try:
        robot.run()
    finally:
        summary = robot.close() | {"targets_refused": program.refused}
        if served.report:
            _write(Path(served.report), summary)
        if program.asked_to_end:
            program.tell(summary)


def _robot(
    served: Served, settings: ControllerConfig, program: RemoteProgram, gate: Callable[[], Gate] | None
) -> OnTheWall | InLockstep:
    if served.clock == "wall":
        from wholebody.errors import InputError
        from wholebody.live.served.wall import OnTheWall

        if served.realistic:
            raise InputError("a realistic robot is served in lockstep; on the wall clock it is as its model")
        return OnTheWall(served, settings, program, gate)
    from wholebody.live.served.lockstep import InLockstep

    return InLockstep(served, settings, program, gate)


def _write(path: Path, summary: dict[str, object]) -> None:
    """Write the summary at once: who reads it never sees half of it."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.write_text(json.dumps(summary, indent=2))
    beside.replace(path)
