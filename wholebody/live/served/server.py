"""``python -m wholebody.live.served.server FD``: the control loop of a robot that is served to another program.

Where the program is gone, however that came, the robot is lowered and everything ends.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING

from wholebody.live.served.messages import Served
from wholebody.live.served.program import Program

if TYPE_CHECKING:
    from wholebody.config import ControllerConfig
    from wholebody.live.served.lockstep import InLockstep
    from wholebody.live.served.wall import OnTheWall


def settings_of(served: Served) -> ControllerConfig:
    """Settings of the controller, as the file has them, for the robot asked for."""
    from wholebody.config import ControllerConfig
    from wholebody.config.file import load_config

    settings = load_config(Path(served.config)) if served.config else ControllerConfig()
    return replace(settings, robot=replace(settings.robot, model=served.robot or settings.robot.model))


def main(connection: Connection) -> None:
    """Serve one program from its first message on."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    program = Program(connection)
    try:
        served = connection.recv()
        robot = _robot(served, program)
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


def _robot(served: Served, program: Program) -> OnTheWall | InLockstep:
    settings = settings_of(served)
    if served.clock == "wall":
        from wholebody.live.served.wall import OnTheWall

        return OnTheWall(served, settings, program)
    from wholebody.live.served.lockstep import InLockstep

    return InLockstep(served, settings, program)


def _write(path: Path, summary: dict[str, object]) -> None:
    """Write the summary at once: who reads it never sees half of it."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.write_text(json.dumps(summary, indent=2))
    beside.replace(path)


if __name__ == "__main__":
    main(Connection(int(sys.argv[1])))
