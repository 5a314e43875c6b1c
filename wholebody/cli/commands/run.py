"""``wholebody run``: close the loop of policy, controller and MuJoCo."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wholebody.cli.console import (
    JsonVerdicts,
    check_places,
    print_nothing,
    print_verdict,
    progress_bar,
    say,
    table_printer,
    write_pictures,
)
from wholebody.cli.crash import ours
from wholebody.cli.options import (
    SOURCES,
    Asking,
    Input,
    Pictures,
    Sampling,
    Simulation,
    VerdictsTo,
    completed_script,
)
from wholebody.cli.simulated import (
    STEPS_OF,
    cameras_of,
    check_settings,
    check_times,
    make_checker,
    make_executor,
    scene_for,
    settings_of,
)
from wholebody.cli.sources import expanded, length, opened, tell, walks_of

if TYPE_CHECKING:
    from wholebody.verdict.verdict import Verdict


def run(
    *,
    source: Annotated[str, typer.Argument(help=SOURCES, autocompletion=completed_script)] = "reach",
    motions: Annotated[Path | None, typer.Option(help="Run every motion .csv of a folder instead.")] = None,
    given: Input,
    simulation: Simulation,
    asking: Asking,
    sampling: Sampling,
    json_to: VerdictsTo = "",
    pictures: Pictures,
) -> None:
    """Close the loop: policy, controller and MuJoCo. Exit code 1 if that is infeasible, or no chunk was executed."""
    quiet, follow = json_to == "-", asking.follow
    check_times(given.duration, simulation.hold)
    check_places(json_to, pictures.video, pictures.sheet, pictures.record)
    check_settings(simulation.config)
    names = _names(source, motions, given, one=pictures.wanted())
    choices, settings = sampling.choices(), settings_of(simulation)
    choices |= {"rtc": asking.real_time_chunking}
    walks = walks_of(settings)
    policies = [opened(name, given, settings.robot, walks, **choices) for name in names]
    executors = [make_executor(policy, asking) for policy in policies]
    scene, verdicts = scene_for(source, simulation), []
    checker = make_checker(simulation, scene, quiet, follow, STEPS_OF.get(source, "never"))
    recorder = checker.recorder() if pictures.wanted() else None
    show = print_nothing if quiet else table_printer(names) if motions else print_verdict
    with JsonVerdicts(json_to) as written:
        for i, (name, policy, executor) in enumerate(zip(names, policies, executors, strict=True)):
            short = name if "://" in name else Path(name).stem
            title = short if len(names) == 1 else f"{short} ({i + 1} of {len(names)})"
            seconds = length(policy, given.duration)
            with (
                cameras_of(policy, checker, given.images) as cameras,
                progress_bar(title, quiet=quiet) as progress,
                ours(),
            ):
                shown = {"cameras": cameras, "progress": progress, "recorder": recorder}
                verdict, _ = checker.check(executor, name, seconds, **shown)
            tell(policy, name)
            verdicts.append(verdict)
            written.add(verdict)
            show(verdict)
    if motions and not quiet:
        from wholebody.verdict.report import table_summary

        say(*table_summary(verdicts).splitlines())
    if recorder is not None:
        write_pictures(recorder, pictures.video, pictures.sheet, pictures.record)
    raise typer.Exit(1 if any(_failed(verdict, strict=asking.strict) for verdict in verdicts) else 0)


def _failed(verdict: Verdict, *, strict: bool) -> bool:
    """Whether a run is infeasible or idle; strictly, also if a chunk was refused, or there was none when needed."""
    from wholebody.types import Reason

    lacking = any(violation.code in (Reason.REFUSED, Reason.STARVED) for violation in verdict.violations)
    return verdict.verdict == "infeasible" or not verdict.timing.chunks or (strict and lacking)


def _names(source: str, motions: Path | None, given: Input, *, one: bool) -> list[str]:
    """All that is to be run, in order.

    Raises:
        ValueError: If there is nothing, or more than the one that pictures are made of.
    """
    if motions and one:
        raise ValueError("--video, --sheet and --record show one run; name one source instead of --motions")
    names = sorted(str(path) for path in motions.glob("*.csv")) if motions else expanded(source, given.episodes)
    if not names:
        raise ValueError(f"no .csv files in '{motions}'")
    if len(names) > 1 and one:
        raise ValueError(f"--video, --sheet and --record show one run; {source} has {len(names)}: say --episodes 0")
    return names
