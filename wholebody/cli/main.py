"""The command `wholebody`."""

from __future__ import annotations

import sys
from contextlib import suppress
from dataclasses import replace
from functools import cache
from importlib.metadata import version
from math import isfinite
from pathlib import Path
from signal import SIGTERM, default_int_handler, signal
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wholebody.bench.commands import bench
from wholebody.cli.console import (
    check_places,
    log_to_terminal,
    print_nothing,
    print_verdict,
    progress_bar,
    table_printer,
    waiting,
    write_json,
    write_pictures,
    write_text,
)
from wholebody.cli.sources import expanded, is_checkpoint, layout_named, open_source

if TYPE_CHECKING:
    from policy.base import Policy
    from policy.executor.executor import Executor
    from policy.recorded.convert import DatasetSettings
    from wholebody.verdict.check import Checker

SOURCES = (
    "Scripted policy (reach, wave, lissajous, grasp, two_hand_lift, pick_low, pick_high), chunk .npz, motion .csv, "
    "folder of a LeRobot dataset or checkpoint, or address of a policy server (ws://HOST:PORT)."
)
SCENE_OF = {"grasp": "table_cylinder"}
"""Scenes of scripted policies that need more than the floor."""

app = typer.Typer(
    add_completion=False, no_args_is_help=True, rich_markup_mode=None, help="Action chunks in, a balanced G1 out."
)
app.add_typer(bench, name="bench")

NO_END = "this policy has no end: say how long with --duration SECONDS"
EXIT_OK, EXIT_INFEASIBLE, EXIT_MISUSE = 0, 1, 2

JsonTo = Annotated[str, typer.Option("--json", help="Write JSON to a file, or to standard output with '-'.")]
CsvFps = Annotated[float, typer.Option(help="Frames per second of motion files.")]
Duration = Annotated[float, typer.Option(help="Seconds to run; 0: the whole input.")]
Hold = Annotated[float, typer.Option(help="Seconds of standing after the last step: falls can come late.")]
Scene = Annotated[
    str, typer.Option(help="What stands around the robot: floor, table, shelf, table_cylinder, ... [default: by input]")
]
Realistic = Annotated[bool, typer.Option(help="Tell the controller what real sensors would.")]
DelayMs = Annotated[float, typer.Option(help="Age of the state when the controller gets it, in ms.")]
PayloadKg = Annotated[
    tuple[float, float], typer.Option(help="Mass in the left and right hand in kg, unknown to the controller.")
]
AssumeSpec = Annotated[str, typer.Option(help="Layout of chunk files that name none: built-in name or JSON file.")]
LatencyMs = Annotated[
    tuple[float, float] | None,
    typer.Option(help="Least and largest time to answer in ms; if not given, a server's own time, and none else."),
]
Ensemble = Annotated[
    float | None, typer.Option(help="Average chunks with ACT's weights exp(-VALUE i), oldest first (ACT: 0.01).")
]
ReplaceEvery = Annotated[int, typer.Option(help="Steps of a chunk after which the next one is asked for.")]
RealTimeChunking = Annotated[
    bool, typer.Option("--real-time-chunking", help="Tell the policy what is being executed (π0, π0.5, SmolVLA).")
]
Episodes = Annotated[str, typer.Option(help="Episodes of dataset folders, such as 0-3,7; all if empty.")]
Task = Annotated[str, typer.Option(help="What a checkpoint is told to do.")]
Tokenizer = Annotated[
    Path | None, typer.Option(help="Checkpoint: folder of its tokenizer, for SmolVLA of its whole VLM.")
]
Device = Annotated[str, typer.Option(help="Checkpoint: cpu, cuda, ...; a GPU if there is one.")]
NumSteps = Annotated[int, typer.Option(help="Checkpoint: denoising steps; 0: as saved.")]
Seed = Annotated[int | None, typer.Option(help="Checkpoint: makes sampling reproducible.")]
ConfigFile = Annotated[Path | None, typer.Option("--config", help="YAML file with changed settings.")]


def main() -> None:
    """Entry point; bad input ends with one sentence and exit code 2, never with a traceback."""
    from models.spec import SpecError
    from policy.errors import PolicyError
    from wholebody.errors import WholebodyError

    log_to_terminal()
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
    inputs: Annotated[list[str], typer.Argument(help=SOURCES)],
    json_to: JsonTo = "",
    csv_fps: CsvFps = 60.0,
    duration: Duration = 0.0,
    hold: Hold = 4.0,
    scene: Scene = "",
    config: ConfigFile = None,
    realistic: Realistic = False,
    delay_ms: DelayMs = 0.0,
    payload_kg: PayloadKg = (0.0, 0.0),
    assume_spec: AssumeSpec = "",
    episodes: Episodes = "",
    task: Task = "",
) -> None:
    """Judge inputs by simulating them. Exit code 0 feasible (repaired ones too), 1 any infeasible, 2 any malformed."""
    from policy.errors import PolicyError

    _check_times(duration, hold)
    check_places(json_to)
    quiet, worst, verdicts = json_to == "-", EXIT_OK, []
    checker = cache(lambda scene: _checker(scene, config, hold, realistic, delay_ms, payload_kg))
    for name in (one for given in inputs for one in expanded(given, episodes)):
        try:
            policy = _opened(name, csv_fps, assume_spec, duration, task=task)
            judge = checker(scene or SCENE_OF.get(name, "floor"))
            with progress_bar(name, quiet=quiet) as progress:
                verdict, _ = judge.check(policy, name, _length(policy, duration), progress=progress)
        except (PolicyError, OSError) as error:
            # The other inputs are judged all the same; the exit code is that of the worst.
            text = str(error)
            print(f"wholebody: {text if text.startswith(name) else f'{name}: {text}'}", file=sys.stderr)
            worst = EXIT_MISUSE
            continue
        verdicts.append(verdict)
        worst = max(worst, EXIT_INFEASIBLE if verdict.verdict == "infeasible" else EXIT_OK)
        if not quiet:
            print_verdict(verdict)
    write_json(json_to, verdicts)
    raise typer.Exit(worst)


@app.command()
def run(
    source: Annotated[str, typer.Argument(help=SOURCES)] = "reach",
    motions: Annotated[Path | None, typer.Option(help="Run every motion .csv of a folder instead.")] = None,
    duration: Duration = 0.0,
    hold: Hold = 4.0,
    scene: Scene = "",
    json_to: JsonTo = "",
    csv_fps: CsvFps = 60.0,
    config: ConfigFile = None,
    realistic: Realistic = False,
    delay_ms: DelayMs = 0.0,
    payload_kg: PayloadKg = (0.0, 0.0),
    assume_spec: AssumeSpec = "",
    episodes: Episodes = "",
    latency_ms: LatencyMs = None,
    replace_every: ReplaceEvery = 25,
    ensemble: Ensemble = None,
    real_time_chunking: RealTimeChunking = False,
    task: Task = "",
    tokenizer: Tokenizer = None,
    device: Device = "",
    num_steps: NumSteps = 0,
    seed: Seed = None,
    video: Annotated[Path | None, typer.Option(help="Write a video (.mp4) of the run.")] = None,
    sheet: Annotated[Path | None, typer.Option(help="Write six frames of the run as one picture (.png).")] = None,
    record: Annotated[Path | None, typer.Option(help="Write every control period to an .npz.")] = None,
) -> None:
    """Close the loop: policy, controller and MuJoCo. Exit code 1 after a fall, or if no chunk was executed."""
    quiet, outputs = json_to == "-", (video, sheet, record)
    _check_times(duration, hold)
    check_places(json_to, *outputs)
    if motions and any(outputs):
        raise ValueError("--video, --sheet and --record show one run; name one source instead of --motions")
    names = sorted(str(path) for path in motions.glob("*.csv")) if motions else expanded(source, episodes)
    if not names:
        raise ValueError(f"no .csv files in '{motions}'")
    if len(names) > 1 and any(outputs) and not motions:
        raise ValueError(f"--video, --sheet and --record show one run; {source} has {len(names)}: say --episodes 0")
    options = {"task": task, "tokenizer": tokenizer, "device": device or None, "num_steps": num_steps or None}
    options |= {"seed": seed, "rtc": real_time_chunking}
    policies = [_opened(name, csv_fps, assume_spec, duration, **options) for name in names]
    executors = [_executor(policy, latency_ms, replace_every, ensemble, real_time_chunking) for policy in policies]
    scene = scene or SCENE_OF.get(source, "floor")
    checker, verdicts = _checker(scene, config, hold, realistic, delay_ms, payload_kg), []
    recorder = checker.recorder() if any(outputs) else None
    show = print_nothing if quiet else table_printer(names) if motions else print_verdict
    for i, (name, policy, executor) in enumerate(zip(names, policies, executors, strict=True)):
        title = Path(name).stem if len(names) == 1 else f"{Path(name).stem} ({i + 1} of {len(names)})"
        with progress_bar(title, quiet=quiet) as progress:
            length = _length(policy, duration)
            verdict, _ = checker.check(executor, name, length, progress=progress, recorder=recorder)
        verdicts.append(verdict)
        show(verdict)
    if motions and not quiet:
        from wholebody.verdict.report import table_summary

        print(table_summary(verdicts))
    write_json(json_to, verdicts)
    if recorder is not None:
        write_pictures(recorder, video, sheet, record)
    raise typer.Exit(EXIT_INFEASIBLE if any(v.fell or not v.timing.chunks for v in verdicts) else EXIT_OK)


@app.command()
def convert(
    source: Annotated[Path, typer.Argument(help="Chunk .npz, motion .csv, or folder of a LeRobot dataset.")],
    target: Annotated[
        Path | None, typer.Argument(help="What to write; for a dataset, SOURCE_LAYOUT if not given.")
    ] = None,
    to: Annotated[str, typer.Option(help="Layout to write: built-in name or JSON file.")] = "wbc32",
    csv_fps: CsvFps = 60.0,
    assume_spec: AssumeSpec = "",
    waist: Annotated[
        tuple[float, float, float], typer.Option(help="Datasets: waist yaw, roll, pitch where not recorded [rad].")
    ] = (0.0, 0.0, 0.0),
    unit: Annotated[str, typer.Option(help="Datasets: unit of the recorded joints, rad or deg.")] = "rad",
    synergy: Annotated[str, typer.Option(help="Datasets: map between one closing number and fingers.")] = "",
    episodes: Annotated[str, typer.Option(help="Datasets: episodes to convert, such as 0-3,7; all if empty.")] = "",
    keep_joints: Annotated[bool, typer.Option(help="Datasets: keep the joints as source.* columns.")] = False,
    check: Annotated[bool, typer.Option(help="Datasets: go back to joints from every frame and report.")] = True,
    least_range: Annotated[float, typer.Option(help="Datasets: floor under ranges of statistics [m, rad].")] = 0.0,
    link_videos: Annotated[bool, typer.Option(help="Datasets: hard-link videos instead of copying.")] = False,
    without_camera_stats: Annotated[bool, typer.Option(help="Datasets: accept cameras without statistics.")] = False,
    json_to: JsonTo = "",
) -> None:
    """Convert between chunk files and motion files, or a dataset of joints to one of wrists."""
    layout = layout_named(to) or "wbc32"
    if source.suffix.lower() in (".npz", ".csv") and not source.is_dir():
        from policy.recorded.convert import convert as convert_file

        if target is None:
            raise ValueError("name the file to write, ending in .npz or .csv")
        convert_file(source, target, to=layout, csv_fps=csv_fps, assume=layout_named(assume_spec))
        print(f"wrote {target}")
        return
    from policy.recorded.convert import DatasetSettings, episode_numbers

    settings = DatasetSettings(
        to=layout,
        waist=waist,
        unit=unit,
        synergy=synergy or None,
        assume=layout_named(assume_spec),
        episodes=episode_numbers(episodes) if episodes else None,
        keep_joints=keep_joints,
        check=check,
        least_range=least_range,
        link_videos=link_videos,
        without_camera_stats=without_camera_stats,
    )
    _convert_dataset(source, target, settings, json_to)


@app.command()
def doctor(
    checkpoint: Annotated[Path, typer.Argument(help="Folder of a LeRobot checkpoint.")],
    dataset: Annotated[Path | None, typer.Option(help="Dataset it was trained on: recompute its statistics.")] = None,
    spec: Annotated[str, typer.Option(help="Layout that the actions must have: built-in name or JSON file.")] = "",
    assume_spec: Annotated[str, typer.Option(help="Layout of a checkpoint that names none.")] = "",
    assume_state: Annotated[str, typer.Option(help="Layout of its state; that of the actions if not given.")] = "",
    task: Annotated[str, typer.Option(help="Task that will be given.")] = "",
    tokenizer: Tokenizer = None,
    device: Device = "",
    num_steps: NumSteps = 0,
    allow_narrow: Annotated[bool, typer.Option(help="Accept numbers that hardly moved in training.")] = False,
    allow_random_weights: Annotated[bool, typer.Option(help="Go on without weights, for timing.")] = False,
    json_to: JsonTo = "",
) -> None:
    """Check a LeRobot checkpoint and say what would help. Exit code 0 well, 1 with warnings, 2 not fit to be run."""
    from wholebody.cli.doctor import examine

    check_places(json_to)
    diagnosis = examine(
        checkpoint,
        dataset=dataset,
        spec=layout_named(spec),
        assume_spec=layout_named(assume_spec),
        assume_state=layout_named(assume_state),
        task=task,
        tokenizer=tokenizer,
        device=device or None,
        num_steps=num_steps or None,
        allow_narrow=allow_narrow,
        allow_random_weights=allow_random_weights,
    )
    if json_to != "-":
        print("\n".join(diagnosis.lines()))
    if json_to:
        write_text(json_to, diagnosis.to_json())
    raise typer.Exit(diagnosis.exit_code)


@app.command("serve-policy")
def serve_policy(
    source: Annotated[str, typer.Argument(help=f"Folder of a LeRobot checkpoint. {SOURCES}")],
    host: Annotated[str, typer.Option(help="Address to listen on; 0.0.0.0: every network.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port; 0: any free one.")] = 8000,
    task: Annotated[str, typer.Option(help="Checkpoint: task where the client gives none.")] = "",
    tokenizer: Tokenizer = None,
    device: Device = "",
    dtype: Annotated[str, typer.Option(help="Checkpoint: float32 or bfloat16; as saved if not given.")] = "",
    num_steps: NumSteps = 0,
    seed: Seed = None,
    real_time_chunking: RealTimeChunking = False,
    allow_random_weights: Annotated[bool, typer.Option(help="Checkpoint: go on without weights, for timing.")] = False,
    csv_fps: CsvFps = 60.0,
    assume_spec: AssumeSpec = "",
) -> None:
    """Serve a policy over a websocket, in openpi's protocol, to one robot at a time. Ends with Ctrl-C."""
    from policy.remote.server import LOOPBACK, PolicyServer

    if Path(source).is_dir():
        from policy.lerobot.policy import LeRobotPolicy

        policy = LeRobotPolicy.from_pretrained(
            source,
            assume_spec=layout_named(assume_spec),
            task=task,
            tokenizer=tokenizer,
            device=device or None,
            dtype=dtype or None,
            num_steps=num_steps or None,
            seed=seed,
            rtc=real_time_chunking,
            allow_random_weights=allow_random_weights,
        )
        for finding in policy.warnings:
            print(f"wholebody: {finding.sentence}", file=sys.stderr)
    else:
        policy = open_source(source, csv_fps, layout_named(assume_spec))
    with PolicyServer(policy, host=host, port=port) as server, suppress(KeyboardInterrupt):
        # Containers and service managers end a program by this signal, as soon as it has said that it is there.
        signal(SIGTERM, default_int_handler)
        print(f"serving '{server.metadata['name']}' ({policy.spec.id}) at {server.uri}", flush=True)
        if host not in (LOOPBACK, "localhost", "::1"):
            print(f"wholebody: whoever reaches {host} can use the policy: no password, no encryption", file=sys.stderr)
        server.wait()


@app.command()
def warmup() -> None:
    """Compile the control tick once, for all later runs."""
    from wholebody.cli.warm_up import warm_up

    print("compiling the control tick and the plan: about a minute, once", file=sys.stderr)
    print(f"ready after {warm_up():.0f} s", file=sys.stderr)


@app.command()
def config() -> None:
    """Print every setting with its default, as YAML for --config."""
    from wholebody.config import ControllerConfig
    from wholebody.config_file import dump_config

    print(dump_config(ControllerConfig()), end="")


def _convert_dataset(source: Path, target: Path | None, settings: DatasetSettings, json_to: str) -> None:
    import json

    from policy.recorded.convert import convert_dataset

    check_places(json_to)
    quiet = json_to == "-"
    name = settings.to if isinstance(settings.to, str) else settings.to.name
    target = target or source.absolute().with_name(f"{source.absolute().name}_{name}")
    with progress_bar(source.name, quiet=quiet) as progress:
        result = convert_dataset(source, target, settings, progress=progress)
    if not quiet:
        print("\n".join(result.lines()))
    if json_to:
        write_text(json_to, json.dumps(result.to_dict(), indent=2))


def _opened(name: str, csv_fps: float, assume_spec: str, duration: float, **options: Any) -> Policy:
    """A source, with what should be known before it runs on standard error."""
    if not duration and is_checkpoint(name):
        raise ValueError(NO_END)
    policy = open_source(name, csv_fps, layout_named(assume_spec), **options)
    for finding in getattr(policy, "warnings", ()):
        print(f"wholebody: {name}: {finding.sentence}", file=sys.stderr)
    return policy


def _length(policy: Policy, duration: float) -> float:
    """Seconds to run."""
    length = duration or getattr(policy, "duration", None)
    if length is None:
        raise ValueError(NO_END)
    return length


def _executor(
    policy: Policy, latency_ms: tuple[float, float] | None, replace_every: int, ensemble: float | None, real_time: bool
) -> Executor:
    """The policy beside a simulated control loop, as late as it was said to be, or as a server really is."""
    from policy.executor.executor import ExecutorConfig
    from policy.executor.simulated import Latency, simulated_executor, uniform_latency
    from policy.remote.client import RemotePolicy

    config = ExecutorConfig(replace_every=replace_every, ensemble=ensemble, real_time=real_time)
    latency: Latency | float | None = None if isinstance(policy, RemotePolicy) else 0.0
    if latency_ms is not None:
        latency = uniform_latency(*(1e-3 * bound for bound in latency_ms))
    return simulated_executor(policy, latency=latency, config=config)


def _checker(
    scene: str, config: Path | None, hold: float, realistic: bool, delay_ms: float, payload_kg: tuple[float, float]
) -> Checker:
    from wholebody.config_file import load_config
    from wholebody.episode.run import EpisodeConfig
    from wholebody.sim.sensors import REALISTIC, SensorConfig
    from wholebody.verdict.check import Checker

    settings = load_config(config) if config else None
    sensors = replace(REALISTIC if realistic else SensorConfig(), delay=1e-3 * delay_ms)
    with waiting("loading the robot; the first time takes longest"):
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
