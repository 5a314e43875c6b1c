"""``wholebody check``: judge inputs by simulating them."""

from __future__ import annotations

import sys
from functools import cache
from typing import Annotated

import typer

from wholebody.cli.console import check_places, print_verdict, progress_bar, write_json
from wholebody.cli.options import SOURCES, Input, JsonTo, Simulation
from wholebody.cli.simulated import SCENE_OF, check_times, make_checker
from wholebody.cli.sources import expanded, length, opened

FEASIBLE, INFEASIBLE, MALFORMED = 0, 1, 2
"""Exit codes; of several inputs the largest counts."""


def check(
    *,
    inputs: Annotated[list[str], typer.Argument(help=SOURCES)],
    given: Input,
    simulation: Simulation,
    json_to: JsonTo = "",
) -> None:
    """Judge inputs by simulating them. Exit code 0 feasible (repaired ones too), 1 any infeasible, 2 any malformed."""
    from policy.errors import PolicyError

    check_times(given.duration, simulation.hold)
    check_places(json_to)
    quiet, worst, verdicts = json_to == "-", FEASIBLE, []
    checker = cache(lambda scene: make_checker(simulation, scene))
    for name in (one for source in inputs for one in expanded(source, given.episodes)):
        try:
            policy = opened(name, given)
            judge = checker(simulation.scene or SCENE_OF.get(name, "floor"))
            with progress_bar(name, quiet=quiet) as progress:
                verdict, _ = judge.check(policy, name, length(policy, given.duration), progress=progress)
        except (PolicyError, OSError) as error:
            # The other inputs are judged all the same; the exit code is that of the worst.
            text = str(error)
            print(f"wholebody: {text if text.startswith(name) else f'{name}: {text}'}", file=sys.stderr)
            worst = MALFORMED
            continue
        verdicts.append(verdict)
        worst = max(worst, INFEASIBLE if verdict.verdict == "infeasible" else FEASIBLE)
        if not quiet:
            print_verdict(verdict)
    write_json(json_to, verdicts)
    raise typer.Exit(worst)
