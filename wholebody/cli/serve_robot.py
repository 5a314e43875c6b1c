"""``python -m wholebody.cli.serve_robot FD``: a robot that is served to the program at the other end of a socket."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING

from wholebody.live.served.server import serve

if TYPE_CHECKING:
    from wholebody.config import ControllerConfig
    from wholebody.execution.gate import Gate
    from wholebody.live.served.messages import Served


def gate(settings: ControllerConfig, served: Served) -> Callable[[], Gate]:
    """What makes the gate of `wholebody run --gate` for a robot in its scene."""
    from wholebody.verdict.chunk_gate import gate_of

    return partial(gate_of, settings, {}, served.scene)


if __name__ == "__main__":
    serve(Connection(int(sys.argv[1])), gate)
