"""JSON episodes of Unitree's xr_teleoperate: a folder an episode with ``data.json``, pictures beside it.

Joints are read, of arms, hands and body; pictures, speeds and torques are not. An end effector of one number is a Dex1
gripper, one of seven a Dex3 hand in motor order; what six numbers are, Inspire or BrainCo, the file does not say.

Source:
    xr_teleoperate ``teleop/utils/episode_writer.py`` and ``teleop_hand_and_arm.py``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np

from policy.dataset.format import ACTION, STATE, Dataset, read_json
from policy.dataset.forms.gathered import Recording, RecordingPlace, gathered
from policy.errors import DatasetError

FORM, FILE = "xr_teleoperate JSON", "data.json"
FPS = 30.0
"""Rate of episodes that do not say one [Hz]; source: xr_teleoperate's ``--frequency``."""
_PARTS = ("left_arm", "right_arm", "left_ee", "right_ee", "left_hand", "right_hand", "body")
_SIDES = {ACTION: "actions", STATE: "states"}
VELOCITY = 3
"""Numbers of a body that are its velocity: x, y and yaw rate."""


def episode_files(folder: Path) -> list[Path]:
    """Files of a folder's episodes, or of the episode that it is; none of another folder."""
    if (folder / FILE).is_file():
        return [folder / FILE]
    return sorted(folder.glob(f"episode_*/{FILE}"))


def read_xr_json(folder: Path) -> Dataset:
    """A folder of episodes, or of one.

    Raises:
        DatasetError: If none of them can be read.
    """
    return gathered(folder, FORM, [RecordingPlace(file) for file in episode_files(folder)], _recording)


def _recording(place: RecordingPlace) -> Recording:
    file = place.file
    try:
        modified_ns = file.stat().st_mtime_ns
    except OSError as error:
        raise DatasetError(f"{file} cannot be read: {error.strerror}") from error
    return _read(file, modified_ns)


@lru_cache(maxsize=8)
def _read(file: Path, modified_ns: int) -> Recording:
    """An episode; the last ones are kept, because they are asked for again and again."""
    stated = read_json(file)
    steps, info, text = stated.get("data"), stated.get("info"), stated.get("text")
    if not isinstance(steps, list) or not steps or not all(isinstance(step, Mapping) for step in steps):
        raise DatasetError(f"{file} has no list of steps called 'data'; an episode of xr_teleoperate is expected")
    columns: dict[str, np.ndarray] = {}
    names: dict[str, tuple[str, ...]] = {}
    for key, side in _SIDES.items():
        for part in _PARTS:
            values = _numbers(file, steps, side, part)
            if values is None:
                continue
            feature = f"{key}.{_called(part, values.shape[1])}"
            columns[feature] = values
            if given := _names(info, part, values.shape[1]):
                names[feature] = given
    if not any(key.startswith(ACTION) for key in columns):
        raise DatasetError(f"{file} has no actions of {', '.join(_PARTS)}")
    return Recording(columns, _rate(info), names, _task(text))


def _numbers(file: Path, steps: list, side: str, part: str) -> np.ndarray | None:
    """Positions (n, D) of a part; None where no step has any."""
    rows = list(_positions(steps, side, part))
    if not any(rows):
        return None
    width = len(rows[0])
    for number, row in enumerate(rows):
        if len(row) != width or not all(type(x) in (int, float) for x in row):
            raise DatasetError(
                f"{file}, step {number}: {side}.{part}.qpos is no list of {width} numbers, as it is in step 0"
            )
    return np.array(rows, dtype=float)


def _positions(steps: list, side: str, part: str) -> Iterator[list]:
    for step in steps:
        parts = step.get(side)
        found = parts.get(part) if isinstance(parts, Mapping) else None
        values = found.get("qpos") if isinstance(found, Mapping) else None
        yield values if isinstance(values, list) else []


def _called(part: str, width: int) -> str:
    """What a part is called here: an end effector is a gripper or a hand, a body's velocity is of the base."""
    side, _, what = part.partition("_")
    if what in ("ee", "hand"):
        return f"{side}_gripper" if width == 1 else f"{side}_hand"
    return "base" if part == "body" and width == VELOCITY else part


def _names(info: object, part: str, width: int) -> tuple[str, ...]:
    stated = info.get("joint_names") if isinstance(info, Mapping) else None
    names = stated.get(part) if isinstance(stated, Mapping) else None
    if not isinstance(names, list) or len(names) != width or not all(isinstance(name, str) for name in names):
        return ()
    return tuple(names)


def _rate(info: object) -> float:
    image = info.get("image") if isinstance(info, Mapping) else None
    fps = image.get("fps") if isinstance(image, Mapping) else None
    return float(fps) if type(fps) in (int, float) else FPS


def _task(text: object) -> str:
    goal = text.get("goal") if isinstance(text, Mapping) else None
    return goal if isinstance(goal, str) else ""
