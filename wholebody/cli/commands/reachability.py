"""``wholebody reachability``: compute where the standing robot can hold its palms, or draw it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from wholebody.cli.console import check_folder, say

MINUTE = 60.0
"""[s]; definition."""


def reachability(
    *,
    target: Annotated[
        Path | None, Argument(help="Map .npz to write; what is found on the way is kept beside it. None: nothing.")
    ] = None,
    minutes: Annotated[
        float, Option(min=0.1, help="CPU time of the search, that of runs before it on the file counted in.")
    ] = 20.0,
    sheet: Annotated[
        Path | None, Option(help="Picture (.png) of the map to draw: of the target, or the package's.")
    ] = None,
    config: Annotated[Path | None, Option("--config", help="YAML file with changed settings.")] = None,
) -> None:
    """Make or draw the map of where palms can be held.

    A run that is broken off goes on where it was.
    """
    from wholebody.config import ControllerConfig
    from wholebody.config.description import describe
    from wholebody.config.file import load_config
    from wholebody.planning.reachability.compute import Samples, compute
    from wholebody.planning.reachability.reach_map import ReachabilityMap, basis
    from wholebody.planning.reachability.reach_map import reachability as shipped

    if target is None and sheet is None:
        raise ValueError("name the map to write (.npz), or the picture (--sheet .png)")
    settings = load_config(config) if config else ControllerConfig()
    if target is not None and target.suffix.lower() != ".npz":
        raise ValueError(f"cannot write '{target}': its name must end in .npz")
    for output in filter(None, (target, sheet)):
        check_folder(output)
    if target is None:
        found = shipped(settings)
    else:
        there = ReachabilityMap.read(target) if target.exists() else None  # what is no map is not written over
        spec = describe(settings.robot)
        samples = Samples(target.with_suffix(".pairs.npz"), basis(spec, settings))
        if there is not None and len(samples.held) == there.card["pairs"] and samples.spent >= MINUTE * minutes:
            say(f"{target} is of {samples.spent / MINUTE:.0f} minutes already; more (--minutes) would make it better")
            found = there
        else:
            say("loading the robot; the first time that takes a minute or two", to_errors=True)
            network = compute(spec, settings, samples, MINUTE * minutes, lambda text: say(text, to_errors=True))
            found = ReachabilityMap(network, samples.card())
            found.write(target)
            say(f"wrote {target}")
    if sheet is not None:
        from wholebody.planning.reachability.picture import draw

        draw(found, describe(settings.robot), sheet)
        say(f"wrote {sheet}", to_errors=True)
