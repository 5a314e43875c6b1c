"""``wholebody layouts``: what every number of an action is."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from wholebody.cli.console import check_places, say, write_text
from wholebody.cli.options import JsonTo, completed_layout
from wholebody.cli.sources import is_dataset, layout_named


def layouts(
    *,
    name: Annotated[
        str,
        Argument(
            help="Built-in layout or JSON file; a list of the built-in ones if not given.",
            autocompletion=completed_layout,
        ),
    ] = "",
    source: Annotated[
        str, Option("--from", help="Dataset, checkpoint or chunk .npz whose layout is looked for.", metavar="SOURCE")
    ] = "",
    write: Annotated[
        Path | None,
        Option(help="Write an example chunk (.npz): both hands rise by 50 mm; with --from, the layout (.json)."),
    ] = None,
    json_to: JsonTo = "",
) -> None:
    """Print what every number of an action layout is. For each slot: unit, frame, order, limits, stance.

    With --from: which layouts the numbers of a dataset, a checkpoint or a chunk may be in, and why.
    """
    from policy.action_spec.builtin import LAYOUTS
    from policy.action_spec.describe import lines, summary, table
    from policy.recorded.chunk_file import write_chunk_file
    from policy.recorded.example import example_file

    if source:
        _fitting(source, name, write)
        return
    check_places(json_to, record=write)
    spec = layout_named(name)
    if spec is None:
        if json_to:
            raise ValueError(f"name the layout to write as JSON: {', '.join(LAYOUTS)}")
        if write is not None:
            raise ValueError(f"name the layout to write '{write}' in: {', '.join(LAYOUTS)}")
        say(*map(summary, LAYOUTS), "", "wholebody layouts NAME says what every number is")
        return
    if json_to:
        write_text(json_to, json.dumps(table(spec), indent=2))
    if json_to != "-":
        say(*lines(spec))
    if write is not None:
        write_chunk_file(write, example_file(spec))
        if json_to != "-":
            say("", f"wrote {write}: wholebody check {write} judges it")


def _fitting(source: str, name: str, write: Path | None) -> None:
    """Say which layouts fit a source, and write the one that is named, or the only one."""
    from policy.lerobot.folder import checkpoint_folder
    from policy.recorded.wizard import BY_NAMES, fits, lines, numbers_of

    place = source if source.endswith(".npz") or is_dataset(source) else checkpoint_folder(source)
    numbers = numbers_of(place)
    found = fits(numbers)
    say(*lines(numbers, found))
    if write is None:
        return
    if write.suffix != ".json":
        raise ValueError(f"'{write}' must end in .json: it is the layout that is written")
    picked = [one for one in found if (one.spec.name == name if name else one.fits) and one.spec.name != BY_NAMES]
    if len(picked) != 1:
        raise ValueError(f"name the layout to write: {', '.join(one.spec.name for one in found if one.fits) or 'none'}")
    write_text(str(write), picked[0].spec.to_json())
    say("", f"wrote {write}: --assume-spec {write} reads {source} so")
