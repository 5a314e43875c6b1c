"""``wholebody layouts``: what every number of an action is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from wholebody.cli.console import check_places, say
from wholebody.cli.options import completed_layout
from wholebody.cli.sources import layout_named


def layouts(
    *,
    name: Annotated[
        str,
        Argument(
            help="Built-in layout or JSON file; a list of the built-in ones if not given.",
            autocompletion=completed_layout,
        ),
    ] = "",
    write: Annotated[Path | None, Option(help="Write an example chunk (.npz): both hands rise by 50 mm.")] = None,
) -> None:
    """Print what every number of an action layout is. For each slot: unit, frame, order, limits, stance."""
    from policy.action_spec.builtin import LAYOUTS
    from policy.action_spec.describe import lines, summary
    from policy.recorded.chunk_file import write_chunk_file
    from policy.recorded.example import example_file

    check_places("", record=write)
    spec = layout_named(name)
    if spec is None:
        if write is not None:
            raise ValueError(f"name the layout to write '{write}' in: {', '.join(LAYOUTS)}")
        say(*map(summary, LAYOUTS), "", "wholebody layouts NAME says what every number is")
        return
    say(*lines(spec))
    if write is not None:
        write_chunk_file(write, example_file(spec))
        say("", f"wrote {write}: wholebody check {write} judges it")
