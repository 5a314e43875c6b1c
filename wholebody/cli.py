"""The command `wholebody`."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from policy.base import Policy
    from wholebody.checker import Checker
    from wholebody.sim.recorder import Recorder

app = typer.Typer(add_completion=False, no_args_is_help=True, help="Action chunks in, a balanced G1 out.")

EXIT_OK, EXIT_INFEASIBLE, EXIT_MISUSE = 0, 1, 2

JsonTo = Annotated[str, typer.Option("--json", help="Write JSON to a file, or to standard output with '-'.")]
CsvFps = Annotated[float, typer.Option(help="Frames per second of motion files.")]
Duration = Annotated[float, typer.Option(help="Seconds to run; 0 for the whole input.")]
Scene = Annotated[str, typer.Option(help="Scene: floor, table, shelf, table_cylinder, ...")]
ConfigFile = Annotated[Path | None, typer.Option("--config", help="YAML file with changed settings.")]


def main() -> None:
    """Entry point; bad input ends with one sentence and exit code 2, never with a traceback."""
    from models.spec import SpecError
    from policy.errors import PolicyError
    from wholebody.errors import WholebodyError

    try:
        app()
    except (PolicyError, WholebodyError, SpecError, OSError, ValueError) as error:
        print(f"wholebody: {error}", file=sys.stderr)
        sys.exit(EXIT_MISUSE)


@app.callback(invoke_without_command=True)
def _options(show_version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    if show_version:
        print(version("g1-wholebody"))
        raise typer.Exit


@app.command()
def check(
    inputs: Annotated[list[str], typer.Argument(help="Chunk .npz, motion .csv, or name of a scripted policy.")],
    json_to: JsonTo = "",
    csv_fps: CsvFps = 60.0,
    duration: Duration = 0.0,
    scene: Scene = "floor",
    config: ConfigFile = None,
) -> None:
    """Judge inputs by planning and simulating them. Exit code 0 feasible, 1 any infeasible, 2 malformed."""
    quiet, worst, verdicts, checker = json_to == "-", EXIT_OK, [], None
    for name in inputs:
        try:
            policy = _open(name, csv_fps)
        except (ValueError, OSError) as error:
            # The other inputs are judged all the same; the exit code is that of the worst.
            print(f"wholebody: {name}: {error}", file=sys.stderr)
            worst = EXIT_MISUSE
            continue
        checker = checker or _checker(scene, config)
        verdict, _ = checker.check(policy, name, duration or policy.duration)
        verdicts.append(verdict)
        worst = max(worst, EXIT_INFEASIBLE if verdict.verdict == "infeasible" else EXIT_OK)
        if not quiet:
            _print_verdict(verdict)
    _write_json(json_to, [verdict.as_dict() for verdict in verdicts])
    raise typer.Exit(worst)


@app.command()
def run(
    source: Annotated[str, typer.Argument(help="Scripted policy, chunk .npz or motion .csv.")] = "reach",
    motions: Annotated[Path | None, typer.Option(help="Run every motion .csv of a folder instead.")] = None,
    duration: Duration = 0.0,
    scene: Scene = "floor",
    json_to: JsonTo = "",
    csv_fps: CsvFps = 60.0,
    config: ConfigFile = None,
    video: Annotated[Path | None, typer.Option(help="Write a video (.mp4) of the run.")] = None,
    sheet: Annotated[Path | None, typer.Option(help="Write six frames of the run as one picture (.png).")] = None,
    record: Annotated[Path | None, typer.Option(help="Write every control period to an .npz.")] = None,
) -> None:
    """Run a source of chunks through the controller in MuJoCo and say how it went. Exit code 1 after a fall."""
    names = sorted(str(path) for path in motions.glob("*.csv")) if motions else [source]
    if not names:
        raise ValueError(f"no .csv files in {motions}")
    policies = [_open(name, csv_fps) for name in names]
    checker, verdicts = _checker(scene, config), []
    recorder = checker.recorder() if video or sheet or record else None
    for name, policy in zip(names, policies, strict=True):
        length = duration or policy.duration
        with _progress(Path(name).stem, quiet=json_to == "-") as progress:
            verdict, _ = checker.check(policy, name, length, progress=progress, recorder=recorder)
        verdicts.append(verdict)
        if json_to != "-" and not motions:
            _print_verdict(verdict)
    if motions and json_to != "-":
        from wholebody.report import table

        table(verdicts)
    _write_json(json_to, [verdict.as_dict() for verdict in verdicts])
    if recorder is not None:
        _write_pictures(recorder, video, sheet, record)
    raise typer.Exit(EXIT_INFEASIBLE if any(v.fell for v in verdicts) else EXIT_OK)


@app.command()
def convert(
    source: Annotated[Path, typer.Argument(help="Chunk .npz or motion .csv.")],
    target: Annotated[Path, typer.Argument(help="File to write, .npz or .csv.")],
    to: Annotated[str, typer.Option(help="Layout of a written .npz.")] = "wbc32",
    csv_fps: CsvFps = 60.0,
    assume_spec: Annotated[str, typer.Option(help="Layout of a source that names none.")] = "",
) -> None:
    """Convert between chunk files and motion files."""
    from policy.convert import convert as convert_file

    convert_file(source, target, to=to, csv_fps=csv_fps, assume=assume_spec or None)
    print(f"wrote {target}")


@app.command()
def config() -> None:
    """Print every setting with its default, as YAML that --config takes."""
    from wholebody.config import ControllerConfig
    from wholebody.config_file import dump_config

    print(dump_config(ControllerConfig()), end="")


def _open(name: str, csv_fps: float) -> Policy:
    from policy.replay import open_recording
    from policy.scripts import scripted

    if Path(name).suffix in (".npz", ".csv"):
        return open_recording(name, csv_fps=csv_fps)
    return scripted(name)


def _checker(scene: str, config: Path | None) -> Checker:
    from wholebody.checker import Checker
    from wholebody.config_file import load_config

    return Checker(scene, load_config(config) if config else None)


def _print_verdict(verdict: object) -> None:
    from wholebody.report import lines

    print("\n".join(lines(verdict)), flush=True)


@contextmanager
def _progress(name: str, *, quiet: bool) -> Iterator[Callable[[float, float], None] | None]:
    """A progress bar on a terminal, nothing elsewhere."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(name, total=1.0)
        yield lambda time, end: bar.update(task, completed=time / end)


def _write_pictures(recorder: Recorder, video: Path | None, sheet: Path | None, record: Path | None) -> None:
    """The recording and what is drawn from it; without OpenGL the run still counts."""
    from wholebody.errors import RenderError
    from wholebody.sim.render import render

    with TemporaryDirectory() as folder:
        file = record or Path(folder) / "run.npz"
        recorder.save(file)
        for output in (video, sheet):
            if output is None:
                continue
            try:
                render(file, output)
                print(f"wrote {output}", file=sys.stderr)
            except RenderError as error:
                print(f"wholebody: {output} was not written: {error}", file=sys.stderr)


def _write_json(target: str, data: list[dict]) -> None:
    if target == "-":
        print(json.dumps(data, indent=2))
    elif target:
        Path(target).write_text(json.dumps(data, indent=2))
