"""``wholebody repair``: the nearest chunk that can be done."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from wholebody.cli.console import check_folder, say, waiting
from wholebody.cli.judging import FEASIBLE, INFEASIBLE
from wholebody.cli.options import AssumeSpec
from wholebody.cli.sources import layout_named, robot_of

LEFT_AS_IT_IS = "feasible as given: written unchanged"
REFUSED = (
    "it cannot be done slower, nor with its path bent by as much as a repair may ({}, {}): nothing written; "
    "`wholebody check --fast --why` says why"
)


def repair(
    *,
    source: Annotated[Path, typer.Argument(help="Chunk .npz.")],
    target: Annotated[Path, typer.Argument(help="Chunk .npz to write, in the same layout.")],
    assume_spec: AssumeSpec = "",
    scene: Annotated[str, typer.Option(help="Around the robot: floor, table, ... or a MuJoCo file.")] = "floor",
    config: Annotated[Path | None, typer.Option("--config", help="YAML file with changed settings.")] = None,
) -> None:
    """Write the nearest chunk that can be done.

    It is slowed down first, then its path is bent least. Exit code 0 written, 1 nothing helps.
    """
    from policy.action_spec.codec import encode
    from policy.recorded.chunk_file import read_chunk_file, write_chunk_file
    from wholebody.config.file import load_config
    from wholebody.verdict.fast import FastChecker
    from wholebody.verdict.quantity import quantity, size_text

    if target.suffix.lower() != ".npz":
        raise ValueError(f"cannot write '{target}': its name must end in .npz")
    check_folder(target)
    settings = load_config(config) if config else None
    robot = robot_of(settings.robot) if settings else None
    file = read_chunk_file(source, assume=layout_named(assume_spec, robot), robot=robot)
    chunk, free = file.chunk(), file.spec.orientation_free
    with waiting("loading the robot, compiling if it is the first time: a minute or two"):
        checker = FastChecker(settings, scene)
    repairer = checker.repairer(chunk, free=free)
    if repairer.lasts(chunk):
        write_chunk_file(target, file)
        say(f"{source}: {LEFT_AS_IT_IS}")
        raise typer.Exit(FEASIBLE)
    with waiting(f"repairing {source}"):
        change = repairer.repaired()
    if change is None:
        bounds = checker.config.verdict
        most = quantity(bounds.palm_repair, "m"), quantity(bounds.turn_repair, "rad")
        say(f"{source}: {REFUSED.format(*most)}")
        raise typer.Exit(INFEASIBLE)
    written = replace(file, actions=encode(file.spec, change.chunk, file.anchor()))
    write_chunk_file(target, written)
    again = checker.repairer(written.chunk(), free=free)
    if not again.lasts(again.chunk):
        target.unlink()
        say(f"{source}: what was found is not feasible in the layout of the file: nothing written")
        raise typer.Exit(INFEASIBLE)
    repaired = size_text(change.slower, change.moved, change.turned)
    say(f"{source}: repaired, {repaired}; checked again, written to {target}")
