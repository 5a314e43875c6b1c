"""``wholebody doctor``: is a LeRobot checkpoint fit to be run, and what would help?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from typer import Option

from wholebody.cli.console import check_places, say, write_text
from wholebody.cli.options import JsonTo, Network
from wholebody.cli.sources import layout_named


@dataclass(frozen=True)
class Layouts:
    """What the numbers of a checkpoint are."""

    spec: Annotated[str, Option(help="Layout that the actions must have: built-in name or JSON file.")] = ""
    assume_spec: Annotated[str, Option(help="Layout of a checkpoint that names none.")] = ""
    assume_state: Annotated[str, Option(help="Layout of its state; that of the actions if not given.")] = ""


@dataclass(frozen=True)
class Allowances:
    """Errors that the user accepts."""

    allow_narrow: Annotated[bool, Option(help="Accept numbers that hardly moved in training.")] = False
    allow_random_weights: Annotated[bool, Option(help="Go on without weights, for timing.")] = False


def doctor(
    *,
    checkpoint: Annotated[Path, typer.Argument(help="Folder of a LeRobot checkpoint.")],
    dataset: Annotated[Path | None, Option(help="Dataset it was trained on: recompute its statistics.")] = None,
    layouts: Layouts,
    task: Annotated[str, Option(help="Task that will be given.")] = "",
    network: Network,
    allowances: Allowances,
    json_to: JsonTo = "",
) -> None:
    """Check a LeRobot checkpoint and say what would help. Exit code 0 well, 1 with warnings, 2 not fit to be run."""
    from wholebody.cli.diagnosis import examine

    check_places(json_to)
    diagnosis = examine(
        checkpoint,
        dataset=dataset,
        task=task,
        **{name: layout_named(text) for name, text in vars(layouts).items()},
        **network.choices(),
        **vars(allowances),
    )
    if json_to != "-":
        say(*diagnosis.lines())
    if json_to:
        write_text(json_to, diagnosis.to_json())
    raise typer.Exit(diagnosis.exit_code)
