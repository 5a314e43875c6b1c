"""The command `wholebody`."""

from __future__ import annotations

import json
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(add_completion=False, no_args_is_help=True, help="Action chunks in, a balanced G1 out.")

EXIT_OK, EXIT_INFEASIBLE, EXIT_MISUSE = 0, 1, 2


def main() -> None:
    """Entry point; bad input ends with one sentence and exit code 2, never with a traceback."""
    from policy.errors import PolicyError
    from wholebody.errors import WholebodyError

    try:
        app()
    except (PolicyError, WholebodyError, OSError, ValueError) as error:
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
    json_to: Annotated[str, typer.Option("--json", help="Write JSON to a file, or to standard output with '-'.")] = "",
    csv_fps: Annotated[float, typer.Option(help="Frames per second of motion files.")] = 60.0,
    duration: Annotated[float, typer.Option(help="Seconds to run; 0 for the whole input.")] = 0.0,
) -> None:
    """Judge inputs by planning and simulating them. Exit code 0 feasible, 1 any infeasible, 2 malformed."""
    policies = [_open(name, csv_fps) for name in inputs]
    from wholebody.checker import Checker
    from wholebody.report import lines

    checker, verdicts = Checker(), []
    for name, policy in zip(inputs, policies, strict=True):
        verdict, _ = checker.check(policy, name, duration or policy.duration)
        verdicts.append(verdict)
        if json_to != "-":
            print("\n".join(lines(verdict)))
    _write_json(json_to, [verdict.as_dict() for verdict in verdicts])
    raise typer.Exit(EXIT_INFEASIBLE if any(v.verdict == "infeasible" for v in verdicts) else EXIT_OK)


@app.command()
def run(
    source: Annotated[str, typer.Argument(help="Scripted policy, chunk .npz or motion .csv.")] = "reach",
    motions: Annotated[Path | None, typer.Option(help="Run every motion .csv of a folder instead.")] = None,
    duration: Annotated[float, typer.Option(help="Seconds to run; 0 for the whole source.")] = 0.0,
    scene: Annotated[str, typer.Option(help="Scene: floor, table, shelf, table_cylinder, ...")] = "floor",
    json_to: Annotated[str, typer.Option("--json", help="Write JSON to a file, or to standard output with '-'.")] = "",
    csv_fps: Annotated[float, typer.Option(help="Frames per second of motion files.")] = 60.0,
) -> None:
    """Run a source of chunks through the controller in MuJoCo and say how it went."""
    names = sorted(str(path) for path in motions.glob("*.csv")) if motions else [source]
    if not names:
        raise ValueError(f"no .csv files in {motions}")
    policies = [_open(name, csv_fps) for name in names]
    from wholebody.checker import Checker
    from wholebody.report import lines

    checker, verdicts = Checker(scene), []
    for name, policy in zip(names, policies, strict=True):
        verdict, _ = checker.check(policy, name, duration or policy.duration, _progress(json_to == "-"))
        verdicts.append(verdict)
        if json_to != "-":
            print("\n".join(lines(verdict)), flush=True)
    _write_json(json_to, [verdict.as_dict() for verdict in verdicts])
    raise typer.Exit(EXIT_INFEASIBLE if any(v.fell for v in verdicts) else EXIT_OK)


@app.command()
def convert(
    source: Annotated[Path, typer.Argument(help="Chunk .npz or motion .csv.")],
    target: Annotated[Path, typer.Argument(help="File to write, .npz or .csv.")],
    to: Annotated[str, typer.Option(help="Layout of a written .npz.")] = "wbc32",
    csv_fps: Annotated[float, typer.Option(help="Frames per second of motion files.")] = 60.0,
    assume_spec: Annotated[str, typer.Option(help="Layout of a source that names none.")] = "",
) -> None:
    """Convert between chunk files and motion files."""
    from policy.convert import convert as convert_file

    convert_file(source, target, to=to, csv_fps=csv_fps, assume=assume_spec or None)
    print(f"wrote {target}")


def _open(name: str, csv_fps: float):
    from policy.replay import open_recording
    from policy.scripts import scripted

    if Path(name).suffix in (".npz", ".csv"):
        return open_recording(name, csv_fps=csv_fps)
    return scripted(name)


def _progress(quiet: bool):
    if quiet or not sys.stderr.isatty():
        return None

    def show(time: float, end: float) -> None:
        print(f"\r{time:6.1f} / {end:.1f} s", end="", file=sys.stderr, flush=True)

    return show


def _write_json(target: str, data: list[dict]) -> None:
    if target == "-":
        print(json.dumps(data, indent=2))
    elif target:
        Path(target).write_text(json.dumps(data, indent=2))
