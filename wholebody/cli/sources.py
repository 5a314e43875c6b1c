"""What a command line names as input, opened as a policy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from policy.learned import NAMES as LEARNED
from wholebody.cli.console import complain
from wholebody.config.bounds import require_run

if TYPE_CHECKING:
    from models.spec import RobotSpec
    from policy.action_spec.spec import ActionSpec
    from policy.base import Policy
    from policy.findings import Finding
    from policy.recorded.walked_motion import WalkLimits
    from wholebody.cli.options import Input
    from wholebody.config import ControllerConfig
    from wholebody.config.robot import RobotConfig

RECORDINGS = (".npz", ".npy", ".csv")
"""Suffixes of files that are played."""
NO_END = "this policy has no end: say how long with --duration SECONDS"


def open_source(
    name: str,
    fps: float | None,
    assume: ActionSpec | None,
    task: str = "",
    rename_map: str = "",
    read_as: str = "",
    robot: RobotSpec | None = None,
    walks: WalkLimits | None = None,
    **options: Any,
) -> Policy:
    """Policy of a name: address of a server, ``FOLDER#3`` for an episode of a dataset, checkpoint, file, or script.

    ``learned`` and ``learned_place`` are the policies in the package, ``learned#3`` the same with another seed.

    Cameras of a policy see grey, since the simulation takes no pictures; the policy has a warning that says so.

    Args:
        name: As in `expanded`.
        fps: Rate of motion files and arrays [Hz]; by their names or layouts, or else 60, if None.
        assume: Layout that the user vouches for.
        task: What a checkpoint or a server is told to do.
        rename_map: Keys of an openpi server, as `policy.remote.openpi.KeyMap.named` reads them.
        read_as: What the numbers of recordings are instead of what they are called, with commas.
        robot: The robot that it is for; the G1 with Dex3 hands if None.
        walks: What the robot can do that walks with recorded motions; None of one that stays.
        **options: More of `policy.lerobot.checkpoint.LoadOptions`, for checkpoints.

    Raises:
        PolicyError: If there is nothing of that name, or it is malformed.
    """
    from policy.recorded.replay import open_recording
    from policy.scripted.library import scripted_policy

    corrections = codes_of(read_as)
    if name.startswith(("ws://", "wss://")):
        from policy.remote.client import RemotePolicy
        from policy.remote.openpi import KeyMap

        settings = {"assume_spec": assume, "placeholder_cameras": True, "task": task}
        return RemotePolicy.connect(name, robot=robot, keys=KeyMap.named(rename_map), **settings)
    folder, _, number = name.rpartition("#")
    if number.isdecimal() and is_dataset(folder):
        from policy.recorded.dataset_replay import open_episode

        return open_episode(folder, int(number), assume=assume, read_as=corrections, robot=robot)
    if name in LEARNED or (folder in LEARNED and number.isdecimal()):
        from policy.learned.library import learned_policy

        return learned_policy(folder or name, int(number) if folder else 0, robot)
    if is_checkpoint(name):
        from policy.lerobot.policy import LeRobotPolicy

        return LeRobotPolicy.from_pretrained(name, assume_spec=assume, task=task, placeholder_cameras=True, **options)
    if Path(name).suffix.lower() in RECORDINGS:
        return open_recording(name, fps=fps, assume=assume, read_as=corrections, robot=robot, walks=walks)
    _require_no_path(name)
    return scripted_policy(name, robot)


def codes_of(read_as: str) -> tuple[str, ...]:
    """Codes of ``--read-as``, which has commas between them."""
    return tuple(part.strip() for part in read_as.split(",") if part.strip())


def opened(
    name: str, given: Input, robot: RobotConfig | None = None, walks: WalkLimits | None = None, **options: Any
) -> Policy:
    """A source for a robot, and one that ``walks`` with it, with what should be known before it on standard error.

    Raises:
        PolicyError: As in `open_source`.
        ValueError: If it is a checkpoint, which has no end of its own, and there is no duration.
    """
    if not given.duration and is_checkpoint(name):
        raise ValueError(NO_END)
    options |= {"task": given.task, "rename_map": given.rename_map, "read_as": given.read_as}
    drives = robot_of(robot)
    policy = open_source(name, given.fps, layout_named(given.assume_spec, drives), robot=drives, walks=walks, **options)
    for finding in _warnings(policy, given.images):
        complain(f"{name}: {finding.sentence}")
    return policy


def walks_of(settings: ControllerConfig) -> WalkLimits | None:
    """What a robot can do that walks with recorded motions; None of one that stays."""
    from wholebody.execution.feet.recorded_walks import walk_limits

    return walk_limits(settings)


def robot_of(robot: RobotConfig | None) -> RobotSpec | None:
    """Robot that layouts are of, as it is configured; None if nothing is."""
    from policy.joints import layout_robot
    from wholebody.config.description import describe

    return None if robot is None else layout_robot(describe(robot))


def tell(policy: Policy, name: str) -> None:
    """What a policy that ran has to say of its task, on standard error; most have nothing."""
    if told := getattr(policy, "told", ""):
        complain(f"{name}: {told}")


def require_blind(policies: Mapping[str, Policy], where: str) -> None:
    """Refuse policies that need to be told where things are.

    Raises:
        PolicyError: If one does.
    """
    from policy.errors import PolicyError

    if told := [name for name, policy in policies.items() if getattr(policy, "sees_objects", False)]:
        raise PolicyError(f"{told[0]} needs to be told where things are, which `wholebody {where}` does not: use run")


def _warnings(policy: Policy, images: str) -> Iterator[Finding]:
    """A policy's warnings; of its cameras, only those that are not drawn see grey."""
    from policy.placeholder_cameras import blind
    from wholebody.sim.cameras import MOUNTS

    drawn = MOUNTS if images == "rendered" else ()
    for finding in getattr(policy, "warnings", ()):
        if finding.check != "cameras":
            yield finding
        elif grey := [camera for camera in policy.cameras if camera not in drawn]:
            yield blind(grey)


def length(policy: Policy, duration: float) -> float:
    """Seconds to run: as long as was said, else as long as the policy.

    Raises:
        ValueError: If neither has an end.
    """
    seconds = duration or getattr(policy, "duration", None)
    if seconds is None:
        raise ValueError(NO_END)
    require_run("duration", seconds, "the length of the input")
    return seconds


def expanded(name: str, episodes: str) -> list[str]:
    """A dataset folder as one name an episode, ``FOLDER#3``, one of files as their names; anything else as it is.

    A policy in the package has as many episodes as are asked for: what so many seeds draw.

    Args:
        name: What the user named.
        episodes: Episodes such as ``0-3,7``; all if empty.

    Raises:
        DatasetError: If the dataset cannot be read, or the text names no episodes.
    """
    if name in LEARNED and episodes:
        from policy.dataset.open import episode_numbers

        return [f"{name}#{number}" for number in episode_numbers(episodes)]
    if not is_dataset(name):
        return [name] if is_checkpoint(name) else files(name) or [name]
    from policy.dataset.open import episode_numbers, open_dataset
    from policy.errors import DatasetError

    there = len(open_dataset(name).episodes)
    numbers = episode_numbers(episodes) if episodes else range(there)
    if wrong := [number for number in numbers if number >= there]:
        raise DatasetError(f"{name} has no episode {wrong[0]}; it has 0 to {there - 1}")
    return [f"{name}#{number}" for number in numbers]


def files(folder: str) -> list[str]:
    """Chunk and motion files of a folder, by name; none of anything else."""
    found = Path(folder).iterdir() if Path(folder).is_dir() else ()
    return sorted(str(path) for path in found if path.suffix.lower() in RECORDINGS)


def is_dataset(name: str) -> bool:
    """Whether a name is a dataset: a LeRobot folder, JSON episodes of xr_teleoperate, HDF5."""
    from policy.dataset.open import is_dataset as known

    return known(name)


def is_checkpoint(name: str) -> bool:
    """Whether a name is the folder of a LeRobot checkpoint, or of the training run that it belongs to."""
    from policy.lerobot.folder import CONFIG_FILE, checkpoint_folder

    return (checkpoint_folder(name) / CONFIG_FILE).is_file()


def _require_no_path(name: str) -> None:
    """Refuse folders that hold nothing to run, and paths that lead nowhere."""
    from policy.errors import PolicyError
    from policy.lerobot.folder import BELOW, whereabouts
    from policy.recorded.exports import advice

    if Path(name).exists() and (how := advice(name)):
        raise PolicyError(f"'{name}': {how}")
    if Path(name).is_dir():
        raise PolicyError(
            f"folder '{name}' has no chunks (.npz, .npy) and no motions (.csv), and is neither a checkpoint (it has no "
            f"config.json, and no {BELOW[-1]}, where LeRobot's training writes it) nor a dataset (no meta/info.json)"
        )
    if Path(name).is_file():
        raise PolicyError(
            f"'{name}' is no input: chunk files are .npz with actions, fps and spec (`wholebody layouts NAME --write "
            "FILE.npz` makes one), arrays .npy with --layout NAME, motions .csv"
        )
    if "/" in name or "\\" in name:
        raise PolicyError(f"there is no folder '{name}', and no script of that name; {whereabouts(name)}")


def layout_named(text: str, robot: RobotSpec | None = None) -> ActionSpec | None:
    """A layout that the user names: a built-in one, its state (``wbc32_state``), or a JSON file; None for no text.

    Raises:
        SpecError: If there is none of that name, or the file is malformed.
        OSError: If the file cannot be read.
    """
    from policy.action_spec.builtin import builtin
    from policy.action_spec.spec import ActionSpec
    from policy.action_spec.state import STATE_OF, state_layout
    from policy.errors import SpecError
    from policy.reading import SPEC_MAX, ReadingError, read_text

    if not text:
        return None
    if text.endswith(STATE_OF):
        return state_layout(builtin(text.removesuffix(STATE_OF), robot))
    if not text.endswith(".json"):
        return builtin(text, robot)
    try:
        return ActionSpec.from_json(read_text(text, SPEC_MAX), robot)
    except (ReadingError, SpecError) as error:
        raise SpecError(f"{text}: {error}") from error
