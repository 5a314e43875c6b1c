"""``wholebody check``: judge inputs by simulating them, or by their plans."""

from __future__ import annotations

from typing import Annotated

import typer

from wholebody.cli.console import JsonVerdicts, check_places, print_verdict, say
from wholebody.cli.judging import FEASIBLE, InputJudge, answers
from wholebody.cli.options import SOURCES, Input, Judging, Sampling, Simulation, VerdictFiles, completed_script
from wholebody.cli.pages import Pages
from wholebody.cli.simulated import check_settings, check_times

JOBS_MAX = 256
"""Most processes side by side."""
WHY_NEXT = (
    "  next     --why says what forbids it and what would do; wholebody repair writes the nearest that can be done"
)
"""Line below what is infeasible, where it was not asked why."""
WORLDS_MAX = 1000
"""Most realistic worlds of an input."""


def check(
    *,
    context: typer.Context,
    inputs: Annotated[list[str], typer.Argument(help=SOURCES, autocompletion=completed_script)],
    given: Input,
    simulation: Simulation,
    sampling: Sampling,
    jobs: Annotated[
        int, typer.Option("--jobs", "-j", help="Inputs judged side by side, each in about 0.4 GB of memory.")
    ] = 1,
    judging: Judging,
    to: VerdictFiles,
) -> None:
    """Judge inputs by simulating them, or by their plans.

    Exit code 0 feasible (repaired ones too), 1 any infeasible, 2 any malformed, 3 a fault of wholebody itself.
    """
    check_times(given.duration, simulation.hold)
    check_places(to.json_to)
    check_settings(simulation.config)
    if not 1 <= jobs <= JOBS_MAX:
        raise ValueError(f"-j is {jobs}; 1 to {JOBS_MAX} inputs can be judged side by side")
    if not 0 <= judging.worlds <= WORLDS_MAX:
        raise ValueError(f"--worlds is {judging.worlds}; 0 to {WORLDS_MAX} can be simulated")
    if judging.fast and (judging.worlds or judging.as_given):
        raise ValueError("--fast simulates nothing, so --worlds and --as-given would say nothing; leave one out")
    quiet, worst, verdicts = to.json_to == "-", FEASIBLE, []
    judge = InputJudge(given, simulation, sampling, judging, quiet=quiet)
    if to.report is not None:
        if judging.fast:
            raise ValueError("--fast simulates nothing, so --report would have nothing to show; leave one out")
        named = list(judge.names(inputs))
        inputs = [name for name in named if isinstance(name, str)]
        worst = max((one.code for one in named if not isinstance(one, str)), default=FEASIBLE)
        judge.pages = Pages.at(to.report, inputs, context)
    with JsonVerdicts(to.json_to) as written:
        for answer in answers(judge, inputs, jobs):
            worst = max(worst, answer.code)
            if answer.verdict is None:
                continue
            verdicts.append(answer.verdict)
            written.add(answer.verdict)
            if not quiet:
                print_verdict(answer.verdict)
                if answer.verdict.verdict == "infeasible" and not (judging.why or answer.verdict.causes):
                    say(WHY_NEXT)
    if judge.pages is not None and verdicts:
        judge.pages.write_index(verdicts)
        say(f"wrote {to.report}", to_errors=True)
    raise typer.Exit(worst)
