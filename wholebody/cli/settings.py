"""``wholebody config`` and ``wholebody warmup``: what the other commands build on."""

from __future__ import annotations

import sys


def config() -> None:
    """Print every setting with its default, as YAML for --config."""
    from wholebody.config import ControllerConfig
    from wholebody.config_file import dump_config

    print(dump_config(ControllerConfig()), end="")


def warmup() -> None:
    """Compile the control tick once, for all later runs."""
    from wholebody.episode.warm_up import warm_up

    print("compiling the control tick and the plan: about a minute, once", file=sys.stderr)
    print(f"ready after {warm_up():.0f} s", file=sys.stderr)
