"""``wholebody plot``: the time lines of a recorded run in one picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wholebody.cli.console import check_places, say


def plot(
    *,
    record: Annotated[Path, typer.Argument(help="Recording of a run: wholebody run SOURCE --record FILE.npz.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Picture (.png) to write; beside the recording if not given.")
    ] = None,
) -> None:
    """Draw margins, errors, torques and times of a recording."""
    from wholebody.sim.pictures.plot import PLOT_COLUMNS
    from wholebody.sim.pictures.plot import plot as draw
    from wholebody.sim.record import read_record

    if output is None:
        if not record.name:
            raise ValueError(f"'{record}' has no name to call a picture by; say with --output where it goes")
        # A sheet of the same run may be called as the recording is.
        output = record.with_name(f"{record.stem}-plot.png")
    check_places("", sheet=output)
    if not record.exists():
        raise ValueError(f"there is no recording '{record}': wholebody run SOURCE --record {record} makes one")
    draw(read_record(record, PLOT_COLUMNS), output, record.name)
    say(f"wrote {output}", to_errors=True)
