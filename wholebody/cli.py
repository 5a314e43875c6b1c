"""The command `wholebody`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib.metadata import version
from math import isfinite
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from policy.base import Policy
    from policy.spec import ActionSpec
    from wholebody.checker import Checker
    from wholebody.sim.recorder import Recorder
    from wholebody.verdict import Verdict

app = typer.Typer(add_completion=False, no_args_is_help=True, help="Action chunks in, a balanced G1 out.")

EXIT_OK, EXIT_INFEASIBLE, EXIT_MISUSE = 0, 1, 2

JsonTo = Annotated[str, typer.Option("--json", help="Write JSON to a file, or to standard output with '-'.")]
CsvFps = Annotated[float, typer.Option(help="Frames per second of motion files.")]
Duration = Annotated[float, typer.Option(help="Seconds to run; 0 for the whole input.")]
Hold = Annotated[float, typer.Option(help="Seconds of standing after the last step: falls can come late.")]
Scene = Annotated[str, typer.Option(help="Scene: floor, table, shelf, table_cylinder, ...")]
Realistic = Annotated[bool, typer.Option(help="Tell the controller what real sensors would.")]
DelayMs = Annotated[float, typer.Option(help="Age of the state when the controller gets it [ms].")]
PayloadKg = Annotated[
    tuple[float, float], typer.Option(help="Mass in the left and right hand, unknown to the controller [kg].")
]
AssumeSpec = Annotated[str, typer.Option(help="Layout of chunk files that name none: built-in name or JSON file.")]
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
    hold: Hold = 4.0,
    scene: Scene = "floor",
    config: ConfigFile = None,
    realistic: Realistic = False,
    delay_ms: DelayMs = 0.0,
    payload_kg: PayloadKg = (0.0, 0.0),
    assume_spec: AssumeSpec = "",
) -> None:
    """Judge inputs by planning and simulating them. Exit code 0 feasible, 1 any infeasible, 2 malformed."""
    from policy.errors import PolicyError

    _check_times(duration, hold)
    _check_places(json_to)
    quiet, worst, verdicts, checker = json_to == "-", EXIT_OK, [], None
    for name in inputs:
        try:
            policy = _open(name, csv_fps, assume_spec)
            checker = checker or _checker(scene, config, hold, realistic, delay_ms, payload_kg)
            with _progress(name, quiet=quiet) as progress:
                verdict, _ = checker.check(policy, name, duration or policy.duration, progress=progress)
        except (PolicyError, OSError) as error:
            # The other inputs are judged all the same; the exit code is that of the worst.
            print(f"wholebody: {name}: {error}", file=sys.stderr)
            worst = EXIT_MISUSE
            continue
        verdicts.append(verdict)
        worst = max(worst, EXIT_INFEASIBLE if verdict.verdict == "infeasible" else EXIT_OK)
        if not quiet:
            _print_verdict(verdict)
    _write_json(json_to, verdicts)
    raise typer.Exit(worst)


@app.command()
def run(
    source: Annotated[str, typer.Argument(help="Scripted policy, chunk .npz or motion .csv.")] = "reach",
    motions: Annotated[Path | None, typer.Option(help="Run every motion .csv of a folder instead.")] = None,
    duration: Duration = 0.0,
    hold: Hold = 4.0,
    scene: Scene = "floor",
    json_to: JsonTo = "",
    csv_fps: CsvFps = 60.0,
    config: ConfigFile = None,
    realistic: Realistic = False,
    delay_ms: DelayMs = 0.0,
    payload_kg: PayloadKg = (0.0, 0.0),
    assume_spec: AssumeSpec = "",
    video: Annotated[Path | None, typer.Option(help="Write a video (.mp4) of the run.")] = None,
    sheet: Annotated[Path | None, typer.Option(help="Write six frames of the run as one picture (.png).")] = None,
    record: Annotated[Path | None, typer.Option(help="Write every control period to an .npz.")] = None,
) -> None:
    """Run a source of chunks through the controller in MuJoCo and say how it went. Exit code 1 after a fall."""
    quiet, outputs = json_to == "-", (video, sheet, record)
    _check_times(duration, hold)
    _check_places(json_to, *outputs)
    if motions and any(outputs):
        raise ValueError("--video, --sheet and --record show one run; name one source instead of --motions")
    names = sorted(str(path) for path in motions.glob("*.csv")) if motions else [source]
    if not names:
        raise ValueError(f"no .csv files in '{motions}'")
    policies = [_open(name, csv_fps, assume_spec) for name in names]
    checker, verdicts = _checker(scene, config, hold, realistic, delay_ms, payload_kg), []
    recorder = checker.recorder() if any(outputs) else None
    for i, (name, policy) in enumerate(zip(names, policies, strict=True)):
        title = Path(name).stem if len(names) == 1 else f"{Path(name).stem} ({i + 1} of {len(names)})"
        with _progress(title, quiet=quiet) as progress:
            length = duration or policy.duration
            verdict, _ = checker.check(policy, name, length, progress=progress, recorder=recorder)
        verdicts.append(verdict)
        if not quiet and not motions:
            _print_verdict(verdict)
    if motions and not quiet:
        from wholebody.report import table

        table(verdicts)
    _write_json(json_to, verdicts)
    if recorder is not None:
        _write_pictures(recorder, video, sheet, record)
    raise typer.Exit(EXIT_INFEASIBLE if any(v.fell for v in verdicts) else EXIT_OK)


@app.command()
def convert(
    source: Annotated[Path, typer.Argument(help="Chunk .npz or motion .csv.")],
    target: Annotated[Path, typer.Argument(help="File to write, .npz or .csv.")],
    to: Annotated[str, typer.Option(help="Layout of a written .npz.")] = "wbc32",
    csv_fps: CsvFps = 60.0,
    assume_spec: AssumeSpec = "",
) -> None:
    """Convert between chunk files and motion files."""
    from policy.convert import convert as convert_file

    convert_file(source, target, to=to, csv_fps=csv_fps, assume=_assumed(assume_spec))
    print(f"wrote {target}")


@app.command()
def config() -> None:
    """Print every setting with its default, as YAML that --config takes."""
    from wholebody.config import ControllerConfig
    from wholebody.config_file import dump_config

    print(dump_config(ControllerConfig()), end="")


def _open(name: str, csv_fps: float, assume_spec: str) -> Policy:
    from policy.replay import open_recording
    from policy.scripts import scripted

    if Path(name).suffix.lower() in (".npz", ".csv"):
        return open_recording(name, csv_fps=csv_fps, assume=_assumed(assume_spec))
    return scripted(name)


def _assumed(text: str) -> ActionSpec | None:
    """The layout that a user vouches for: a built-in name or a JSON file."""
    from policy.layouts import builtin
    from policy.spec import ActionSpec

    if not text:
        return None
    return ActionSpec.from_json(Path(text).read_text()) if text.endswith(".json") else builtin(text)


def _checker(
    scene: str, config: Path | None, hold: float, realistic: bool, delay_ms: float, payload_kg: tuple[float, float]
) -> Checker:
    from wholebody.checker import Checker
    from wholebody.config_file import load_config
    from wholebody.runtime import EpisodeConfig
    from wholebody.sim.sensors import REALISTIC, SensorConfig

    settings = load_config(config) if config else None
    sensors = replace(REALISTIC if realistic else SensorConfig(), delay=1e-3 * delay_ms)
    return Checker(
        scene,
        settings,
        episode=EpisodeConfig(hold=hold),
        sensors=sensors if realistic or delay_ms else None,
        payload_kg=payload_kg,
    )


def _check_times(duration: float, hold: float) -> None:
    for name, seconds, meaning in (("--duration", duration, " (0: the whole input)"), ("--hold", hold, "")):
        if not (isfinite(seconds) and seconds >= 0.0):
            raise ValueError(f"{name} is {seconds} s; it must be at least 0{meaning}")


def _check_places(
    json_to: str, video: Path | None = None, sheet: Path | None = None, record: Path | None = None
) -> None:
    """Refuse outputs that cannot be written before minutes of simulation, not after."""
    for path, ending in ((video, ".mp4"), (sheet, ".png"), (record, ".npz")):
        if path is not None and path.suffix != ending:
            raise ValueError(f"cannot write '{path}': its name must end in {ending}")
    for path in (video, sheet, record, Path(json_to) if json_to not in ("", "-") else None):
        if path is not None and not path.absolute().parent.is_dir():
            raise ValueError(f"cannot write '{path}': there is no folder '{path.parent}'")


def _print_verdict(verdict: Verdict) -> None:
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
                print(f"wholebody: '{output}' was not written: {error}", file=sys.stderr)


def _write_json(target: str, verdicts: list[Verdict]) -> None:
    from wholebody.report import to_json

    if target == "-":
        print(to_json(verdicts))
    elif target:
        Path(target).write_text(to_json(verdicts) + "\n")
