"""``wholebody convert``: between chunk files and motion files, or a dataset of joints to one of wrists."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from typer import Argument, Option

from wholebody.cli.console import check_places, progress_bar, say, write_text
from wholebody.cli.judging import MALFORMED
from wholebody.cli.options import AssumeSpec, Fps, JsonTo, ReadAs
from wholebody.cli.sources import codes_of, layout_named

if TYPE_CHECKING:
    from policy.dataset.conversion import DatasetSettings


@dataclass(frozen=True)
class DatasetOptions:
    """Options for what a dataset does not say itself, and for what is written."""

    waist: Annotated[
        tuple[float, float, float], Option(help="Datasets: waist yaw, roll, pitch where not recorded [rad].")
    ] = (0.0, 0.0, 0.0)
    unit: Annotated[str, Option(help="Datasets: unit of the recorded joints, rad or deg.")] = "rad"
    synergy: Annotated[str, Option(help="Datasets: map between one closing number and fingers.")] = ""
    episodes: Annotated[str, Option(help="Datasets: episodes to convert, such as 0-3,7; all if empty.")] = ""
    action: Annotated[
        Literal["requested", "executed"],
        Option(help="Datasets: actions of commanded joints, or of those measured a row later (what the robot did)."),
    ] = "requested"
    keep_joints: Annotated[bool, Option(help="Datasets: keep the joints as source.* columns.")] = False
    check: Annotated[bool, Option(help="Datasets: go back to joints from every frame and report.")] = True
    least_range: Annotated[float, Option(help="Datasets: floor under ranges of statistics [m, rad].")] = 0.0
    link_videos: Annotated[bool, Option(help="Datasets: hard-link videos instead of copying.")] = False
    without_camera_stats: Annotated[bool, Option(help="Datasets: accept cameras without statistics.")] = False


def convert(
    *,
    source: Annotated[Path, Argument(help="Chunk .npz, motion .csv or .npz, or a dataset: LeRobot's, JSON, HDF5.")],
    target: Annotated[Path | None, Argument(help="What to write; for a dataset, SOURCE_LAYOUT if not given.")] = None,
    to: Annotated[str, Option(help="Layout to write: built-in name or JSON file.")] = "wbc32",
    fps: Fps = None,
    assume_spec: AssumeSpec = "",
    read_as: ReadAs = "",
    dataset: DatasetOptions,
    json_to: JsonTo = "",
) -> None:
    """Convert chunk files, motion files, or datasets of joints. Such a dataset becomes one of wrists.

    Exit code 0 all converted, 2 something is malformed: a broken episode of a dataset is named and left out.
    """
    layout, assumed = layout_named(to) or "wbc32", layout_named(assume_spec)
    if source.suffix.lower() in (".npz", ".csv") and not source.is_dir():
        from policy.recorded.convert import convert as convert_file

        if target is None:
            raise ValueError("name the file to write, ending in .npz or .csv")
        chunk = convert_file(source, target, to=layout, csv_fps=fps, assume=assumed, read_as=codes_of(read_as))
        say(f"wrote {target}", *(f"  note: {note}" for note in chunk.notes))
        return
    from policy.dataset.conversion import DatasetSettings
    from policy.dataset.open import episode_numbers

    given = vars(dataset) | {
        "read_as": codes_of(read_as),
        "synergy": dataset.synergy or None,
        "episodes": episode_numbers(dataset.episodes) if dataset.episodes else None,
    }
    _convert_dataset(source, target, DatasetSettings(to=layout, assume=assumed, **given), json_to)


def _convert_dataset(source: Path, target: Path | None, settings: DatasetSettings, json_to: str) -> None:
    from policy.dataset.conversion import convert_dataset

    check_places(json_to)
    quiet = json_to == "-"
    name = settings.to if isinstance(settings.to, str) else settings.to.name
    target = target or source.absolute().with_name(f"{source.absolute().name}_{name}")
    with progress_bar(source.name, quiet=quiet, before_frames="looking at every episode") as progress:
        result = convert_dataset(source, target, settings, progress=progress)
    if not quiet:
        say(*result.lines())
    if json_to:
        write_text(json_to, json.dumps(result.to_dict(), indent=2))
    if result.left_out:
        raise typer.Exit(MALFORMED)
