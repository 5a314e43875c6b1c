"""``wholebody config`` and ``wholebody warmup``: what the other commands build on."""

from __future__ import annotations

import sys
from typing import Annotated

from typer import Option

from wholebody.cli.console import say, waiting
from wholebody.cli.options import RobotModel


def config(
    *, everything: Annotated[bool, Option("--all", help="The controller's internal settings, too.")] = False
) -> None:
    """Print settings and defaults, as YAML for --config."""
    from wholebody.config import ControllerConfig
    from wholebody.config.file import dump_config

    print(dump_config(ControllerConfig(), everything=everything), end="")


def warmup(*, robot: RobotModel = "") -> None:
    """Compile the control tick once, for all later runs."""
    from wholebody.config.robot import RobotConfig
    from wholebody.episode.warm_up import warm_up

    text = "compiling the control tick and the plan: some ten seconds, once"
    say(text, to_errors=True)
    # A line that moves on a terminal, three in a pipe.
    terminal = sys.stderr.isatty()
    half_way = None if terminal else lambda: say("the plan is compiled", to_errors=True)
    with waiting(text, quiet=not terminal):
        seconds = warm_up(RobotConfig(model=robot) if robot else None, half_way)
    say(f"ready after {seconds:.0f} s; later runs load what was compiled", to_errors=True)
