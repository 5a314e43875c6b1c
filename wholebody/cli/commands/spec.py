"""``wholebody spec``: write beside a checkpoint what its numbers mean."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from wholebody.cli.console import complain, say
from wholebody.cli.options import completed_layout
from wholebody.cli.sources import layout_named


def spec(
    *,
    checkpoint: Annotated[Path, Argument(help="Folder of a LeRobot checkpoint, or of its training run.")],
    layout: Annotated[
        str,
        Option(
            help="What its actions are: built-in name or JSON file; as --from says if not given.",
            autocompletion=completed_layout,
        ),
    ] = "",
    state: Annotated[
        str, Option(help="What its state is, such as wbc32_state; that of the actions if not given.")
    ] = "",
    dataset: Annotated[
        Path | None, Option("--from", help="Dataset it was trained on: says rate and names, and layout if converted.")
    ] = None,
    fps: Annotated[float | None, Option(help="Steps a second, where there is no dataset.")] = None,
) -> None:
    """Write down what a checkpoint's numbers mean. Action and state spec have its steps and rate."""
    from policy.action_spec.describe import called
    from policy.lerobot.fit import fit_layouts
    from policy.lerobot.spec import ACTION_SPEC_FILE, STATE_SPEC_FILE, write_specs

    fitted = fit_layouts(checkpoint, layout_named(layout), state=layout_named(state), dataset=dataset, fps=fps)
    for finding in fitted.findings:
        complain(finding.sentence)
    write_specs(fitted.folder, fitted.spec, fitted.state)
    written = fitted.spec
    say(
        f"wrote {fitted.folder / ACTION_SPEC_FILE}: {called(written)}, {written.horizon} steps of "
        f"{written.dim} numbers at {written.fps:g} Hz",
        f"wrote {fitted.folder / STATE_SPEC_FILE}: {fitted.state.id}, {fitted.state.dim} numbers",
    )
