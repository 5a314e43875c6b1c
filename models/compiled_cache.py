"""MuJoCo's compiled models in the user's cache: loading one takes a tenth of the time of compiling it.

A file is named by what the model was made of and by its own content, so one that is old or damaged is never loaded.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

import mujoco

from models.cache import cache_dir, whole_file
from models.spec import RobotSpec
from models.urdf import light_urdf

MODELS_KEPT = 8
"""Models that are kept, 17 MB each; the oldest goes when one more is made."""


def compiled(spec: RobotSpec, build: Callable[[], mujoco.MjSpec], **settings: object) -> mujoco.MjModel:
    """The model that ``build().compile()`` gives, from the cache or made now.

    Args:
        spec: The robot.
        build: Makes what is to be compiled.
        settings: All that it depends on beside the robot and the sources of this package.

    Raises:
        RobotSpecError: If the cache cannot be written.
    """
    folder, key = cache_dir() / "mujoco", _key(spec, settings)
    for path in folder.glob(f"{key}-*.mjb"):
        with suppress(FileNotFoundError):  # another process has just deleted it
            if path.stem == f"{key}-{_content(path)}":
                os.utime(path)
                return mujoco.MjModel.from_binary_path(str(path))
        path.unlink(missing_ok=True)
    model = build().compile()
    made = folder / f"{key}.{os.getpid()}"  # its name follows from its content
    with whole_file(made) as temporary:
        mujoco.mj_saveModel(model, str(temporary), None)
    made.replace(folder / f"{key}-{_content(made)}.mjb")
    for old in sorted(folder.glob("*.mjb"), key=_used)[:-MODELS_KEPT]:
        old.unlink(missing_ok=True)
    return model


def _used(path: Path) -> float:
    """Time at which a file was used last [s]; 0 for one that another process has just deleted."""
    try:
        return path.stat().st_mtime
    except FileNotFoundError:
        return 0.0


def _key(spec: RobotSpec, settings: dict[str, object]) -> str:
    described = [mujoco.__version__, str(light_urdf(spec)), asdict(spec), settings]
    digest = hashlib.sha256(json.dumps(described, default=str).encode())
    for source in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _content(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:16]
