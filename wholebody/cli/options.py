"""Options of commands in groups: a frozen dataclass a group, a field an option with its name, default and help."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, fields, is_dataclass
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_type_hints

from typer import Option

if TYPE_CHECKING:
    from wholebody.verdict.verdict import Follow

SOURCES = (
    "Scripted policy (reach, wave, lissajous, grasp, two_hand_lift, pick_low, pick_high, touch, wipe, press, "
    "pull_drawer, turn_handle, lift_box, hand_over, walk_reach), learned and learned_place (policies in the package, "
    "learned#7 with what seed 7 draws), chunk .npz, array .npy, motion .csv, folder of a LeRobot dataset or "
    "checkpoint, or address of a policy server (ws://HOST:PORT)."
)

JsonTo = Annotated[str, Option("--json", help="Write JSON to a file, or to standard output with '-'.")]
VerdictsTo = Annotated[
    str,
    Option("--json", help="Write JSON to a file, or with '-' to standard output: a verdict a line, as they come."),
]


def completed_script(incomplete: str) -> list[str]:
    """Scripts that a shell offers where a source is typed; for anything else it offers files."""
    from policy.learned import NAMES as LEARNED
    from policy.scripted.library import SCRIPTS

    return [name for name in (*SCRIPTS, *LEARNED) if name.startswith(incomplete)]


def completed_layout(incomplete: str) -> list[str]:
    """Built-in layouts that a shell offers; for anything else it offers files."""
    from policy.action_spec.builtin import LAYOUTS

    return [name for name in LAYOUTS if name.startswith(incomplete)]


RobotModel = Annotated[
    Literal["", "g1_dex3", "g1"],
    Option(
        help="g1_dex3: with Dex3 hands; g1: with rubber hands, so that fingers are left out. [default: by settings]"
    ),
]
Fps = Annotated[
    float | None,
    Option(
        "--fps",
        "--csv-fps",
        help="Steps a second of motions .csv and arrays .npy. [default: by the file's name or the layout, else 60]",
    ),
]
AssumeSpec = Annotated[
    str,
    Option(
        "--assume-spec",
        "--layout",
        help="Layout of files, checkpoints and servers that name none: built-in name or JSON file.",
        autocompletion=completed_layout,
    ),
]
ReadAs = Annotated[
    str,
    Option(
        help="What numbers are instead of what they are called, as answers suggest it: isaac_order, degrees, w_first, "
        "... (several with commas); as_named: what looks wrong is right."
    ),
]
Task = Annotated[str, Option(help="What a checkpoint or a server is told to do.")]
RenameMap = Annotated[
    str,
    Option(
        help="openpi peers: libero (default), aloha, or JSON of our names (state, prompt, actions, or a camera) and "
        'their keys, such as \'{"head": "observation/front_image"}\'.'
    ),
]
RealTimeChunking = Annotated[
    bool, Option("--real-time-chunking", help="Tell the policy what is being executed (π0, π0.5, SmolVLA).")
]


@dataclass(frozen=True)
class Input:
    """Options for reading inputs, and how much of them."""

    duration: Annotated[float, Option(help="Seconds to run; 0: the whole input.")] = 0.0
    fps: Fps = None
    episodes: Annotated[
        str, Option(help="Episodes of dataset folders, or seeds of learned, such as 0-3,7; all if empty.")
    ] = ""
    assume_spec: AssumeSpec = ""
    read_as: ReadAs = ""
    task: Task = ""
    rename_map: RenameMap = ""
    images: Annotated[
        Literal["grey", "rendered"],
        Option(help="What a policy's cameras see: grey, or what MuJoCo draws."),
    ] = "grey"


@dataclass(frozen=True)
class Simulation:
    """Where and how the robot is simulated."""

    scene: Annotated[
        str,
        Option(help="Around the robot: floor, table, shelf, table_cylinder, ... or a MuJoCo file. [default: by input]"),
    ] = ""
    hold: Annotated[float, Option(help="Seconds of standing after the last step: falls can come late.")] = 4.0
    config: Annotated[Path | None, Option("--config", help="YAML file with changed settings.")] = None
    robot: RobotModel = ""
    realistic: Annotated[
        bool,
        Option(help="A robot with friction, slow motors, other masses, an unknown load, and an estimated state."),
    ] = False
    sensors: Annotated[
        Literal["", "true", "realistic"],
        Option(help="What the controller is told of the state: the truth, or with the errors of real sensors. [true]"),
    ] = ""
    robot_seed: Annotated[
        int, Option(help="Seed of what --realistic and --sensors realistic draw: masses, offsets, loads, noise.")
    ] = 0
    delay_ms: Annotated[float, Option(help="Age of the state when the controller gets it, in ms.")] = 0.0
    payload_kg: Annotated[
        tuple[float, float],
        Option(help="Mass in the left and right hand in kg, such as 0.5 0.5; the controller sees it from arm torques."),
    ] = (0.0, 0.0)
    payload_known: Annotated[
        bool, Option("--payload-known", help="Tell the controller the masses of --payload-kg before it sees them.")
    ] = False
    planning_ms: Annotated[
        float | None, Option(help="Simulated time that planning takes and that plans are asked for ahead, in ms [100].")
    ] = None
    planning_times: Annotated[
        float | None, Option(help="Let planning take its own CPU time, so many times, instead of a fixed time.")
    ] = None


@dataclass(frozen=True)
class VerdictFiles:
    """Where verdicts go beside the terminal."""

    json_to: VerdictsTo = ""
    report: Annotated[
        Path | None, Option(help="Write a page (.html) with the robot in motion; of several inputs an index, ranked.")
    ] = None


@dataclass(frozen=True)
class Judging:
    """How inputs are judged."""

    fast: Annotated[bool, Option("--fast", help="Judge by plans alone, without simulating: milliseconds a chunk.")] = (
        False
    )
    start: Annotated[
        Literal["", "first", "stance"],
        Option(help="Hands at the first step, or the stance. [default: first for a chunk .npz or array .npy]"),
    ] = ""
    worlds: Annotated[
        int, Option(help="Also simulate in so many realistic worlds, on all cores: the share in which it held.")
    ] = 0
    as_given: Annotated[
        bool, Option("--as-given", help="Simulate chunks as they are: no plan, no filter, the stance as posture.")
    ] = False
    why: Annotated[
        bool, Option("--why", help="Say which bounds together forbid what is not feasible: seconds a chunk.")
    ] = False

    def starts(self, name: str) -> Literal["first", "stance"]:
        """Where an input begins: a chunk by itself at its own first step."""
        return self.start or ("first" if name.lower().endswith((".npz", ".npy")) else "stance")


@dataclass(frozen=True)
class Asking:
    """Options of when a policy is asked, and of what becomes of its answers."""

    latency_ms: Annotated[
        tuple[float, float] | None,
        Option(help="Least and largest time to answer in ms; if not given, a server's own time, and none else."),
    ] = None
    replace_every: Annotated[int, Option(help="Steps of a chunk after which the next one is asked for.")] = 25
    ensemble: Annotated[
        float | None, Option(help="Average chunks with ACT's weights exp(-VALUE i), oldest first (ACT: 0.01).")
    ] = None
    real_time_chunking: RealTimeChunking = False
    strict: Annotated[bool, Option("--strict", help="Exit code 1 if a chunk was refused or came too late, too.")] = (
        False
    )
    gate: Annotated[
        bool,
        Option("--gate", help="Judge each chunk by its plan; reject what cannot be done nearly as given."),
    ] = False
    as_given: Annotated[
        bool, Option("--as-given", help="Follow chunks as they are: no plan, no filter, the stance as posture.")
    ] = False

    @property
    def follow(self) -> Follow:
        """How chunks are followed.

        Raises:
            ValueError: If both are asked for.
        """
        if self.gate and self.as_given:
            raise ValueError("--gate judges plans and --as-given follows chunks without any; give one of them")
        return "gated" if self.gate else "as_given" if self.as_given else "planned"


@dataclass(frozen=True)
class Network:
    """A checkpoint's network."""

    tokenizer: Annotated[
        Path | None, Option(help="Checkpoint: folder of its tokenizer, for SmolVLA of its whole VLM.")
    ] = None
    device: Annotated[str, Option(help="Checkpoint: cpu, cuda, ...; a GPU if there is one.")] = ""
    num_steps: Annotated[int, Option(help="Checkpoint: denoising steps; 0: as saved.")] = 0

    def choices(self) -> dict[str, Any]:
        """Fields of `policy.lerobot.checkpoint.LoadOptions` by name."""
        return {"tokenizer": self.tokenizer, "device": self.device or None, "num_steps": self.num_steps or None}


@dataclass(frozen=True)
class Sampling(Network):
    """A checkpoint's network, and what it draws."""

    seed: Annotated[int | None, Option(help="Checkpoint: makes sampling reproducible.")] = None

    def choices(self) -> dict[str, Any]:
        """Fields of `Network` by name."""
        return super().choices() | {"seed": self.seed}


@dataclass(frozen=True)
class Pictures:
    """What a run is recorded and drawn to."""

    video: Annotated[Path | None, Option(help="Write a video of the run (.mp4, extra `video`; or .gif, small).")] = None
    sheet: Annotated[Path | None, Option(help="Write six frames, where something happens, as a picture (.png).")] = None
    record: Annotated[Path | None, Option(help="Write every control period (.npz), for wholebody plot.")] = None

    def wanted(self) -> bool:
        """Whether there is any."""
        return any((self.video, self.sheet, self.record))


def _title(group: type) -> str:
    return (group.__doc__ or "").partition("\n")[0].rstrip(".")


def _under(title: str, annotation: Any) -> Any:
    """An option's annotation, to be shown under a title."""
    kind, info = get_args(annotation)
    shown = copy(info)
    shown.rich_help_panel = title
    return Annotated[kind, shown]


def flat(command: Callable[..., None]) -> Callable[..., None]:
    """A command, some of whose parameters are groups, as the function with one parameter an option that typer reads.

    Args:
        command: Its parameters, called by name, are arguments, options, or groups: dataclasses of options.

    Returns:
        A function with the command's name and docstring. Its signature has each group's fields in the group's place,
        which help shows under the group's docstring.
    """
    hints, parameters = get_type_hints(command, include_extras=True), []
    groups = {name: kind for name, kind in hints.items() if is_dataclass(kind)}
    for name, parameter in signature(command).parameters.items():
        if name not in groups:
            parameters.append(parameter.replace(kind=Parameter.KEYWORD_ONLY, annotation=hints[name]))
            continue
        options = get_type_hints(groups[name], include_extras=True)
        for field in fields(groups[name]):
            annotation = _under(_title(groups[name]), options[field.name])
            parameters.append(
                Parameter(field.name, Parameter.KEYWORD_ONLY, default=field.default, annotation=annotation)
            )

    def flattened(**values: Any) -> None:
        made = {
            name: kind(**{field.name: values.pop(field.name) for field in fields(kind)})
            for name, kind in groups.items()
        }
        command(**made, **values)

    flattened.__name__, flattened.__doc__ = command.__name__, command.__doc__
    flattened.__signature__ = Signature(parameters)
    return flattened
