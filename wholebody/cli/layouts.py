"""``wholebody layouts``: what every number of an action is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from wholebody.cli.console import check_places
from wholebody.cli.sources import layout_named


def layouts(
    *,
    name: Annotated[str, Argument(help="Built-in layout or JSON file; a list of the built-in ones if not given.")] = "",
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
        print("\n".join([*map(summary, LAYOUTS), "", "wholebody layouts NAME says what every number is"]))
        return
    print("\n".join(lines(spec)))
    if write is not None:
        write_chunk_file(write, example_file(spec))
        print(f"\nwrote {write}: wholebody check {write} judges it")
