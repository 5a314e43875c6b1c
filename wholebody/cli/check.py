"""``wholebody check``: judge inputs by simulating them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Annotated

import typer

from wholebody.cli.console import check_places, complain, print_verdict, progress_bar, write_json
from wholebody.cli.crash import CRASH, ours, sentence
from wholebody.cli.options import SOURCES, Input, JsonTo, Sampling, Simulation
from wholebody.cli.simulated import SCENE_OF, check_times, make_checker
from wholebody.cli.sources import expanded, length, opened

FEASIBLE, INFEASIBLE, MALFORMED = 0, 1, 2
"""Exit codes, besides that of a crash; of several inputs the largest counts."""


def check(
    *,
    inputs: Annotated[list[str], typer.Argument(help=SOURCES)],
    given: Input,
    simulation: Simulation,
    sampling: Sampling,
    json_to: JsonTo = "",
) -> None:
    """Judge inputs by simulating them.

    Exit code 0 feasible (repaired ones too), 1 any infeasible, 2 any malformed, 3 a fault of wholebody itself.
    """
    check_times(given.duration, simulation.hold)
    check_places(json_to)
    quiet, codes, verdicts = json_to == "-", [FEASIBLE], []
    checker = cache(lambda scene: make_checker(simulation, scene))

    def judged(name: str) -> int:
        """Exit code of one input, after printing its verdict."""
        policy = opened(name, given, **sampling.choices())
        judge = checker(simulation.scene or SCENE_OF.get(name, "floor"))
        seconds = length(policy, given.duration)
        with progress_bar(name, quiet=quiet) as progress, ours():
            verdict, _ = judge.check(policy, name, seconds, progress=progress)
        verdicts.append(verdict)
        if not quiet:
            print_verdict(verdict)
        return INFEASIBLE if verdict.verdict == "infeasible" else FEASIBLE

    for source in inputs:
        with _others_all_the_same(source, codes, checker.cache_clear):
            for name in expanded(source, given.episodes):
                with _others_all_the_same(name, codes, checker.cache_clear):
                    codes.append(judged(name))
    write_json(json_to, verdicts)
    raise typer.Exit(max(codes))


@contextmanager
def _others_all_the_same(name: str, codes: list[int], crashed: Callable[[], None]) -> Iterator[None]:
    """Say what is wrong with an input and note its exit code; the other inputs are judged all the same.

    Args:
        name: The input.
        codes: Exit codes so far; that of a failure is added.
        crashed: Called after a fault of ours, whose traces the other inputs must not meet.

    Raises:
        WholebodyError, RobotSpecError, ValueError: If the options are wrong, which they are for every input.
    """
    from models.spec import RobotSpecError
    from policy.errors import PolicyError
    from wholebody.errors import WholebodyError

    try:
        yield
    except (PolicyError, OSError) as error:
        _tell(name, str(error))
        codes.append(MALFORMED)
    except (WholebodyError, RobotSpecError, ValueError):
        raise
    except Exception as error:  # noqa: BLE001 - whatever it is, it is a fault of ours and has its exit code
        _tell(name, sentence(error))
        codes.append(CRASH)
        crashed()


def _tell(name: str, text: str) -> None:
    complain(text if text.startswith(name) else f"{name}: {text}")
