"""A bare array of numpy (``.npy``) as raw actions; its layout is given by the caller."""

from __future__ import annotations

from pathlib import Path

from models.spec import RobotSpec
from policy.action_spec.builtin import LAYOUTS, builtin
from policy.action_spec.spec import ActionSpec
from policy.archive import read_array
from policy.errors import FileFormatError
from policy.reading import STEPS_MAX, ReadingError, require_rate
from policy.recorded.chunk_file import ChunkFile

RATE_ASSUMED = "the array does not say its rate: {:g} Hz of the layout '{}' assumed; say --fps"


def read_array_file(
    path: str | Path, spec: ActionSpec | None, fps: float | None = None, robot: RobotSpec | None = None
) -> ChunkFile:
    """Read raw actions (H, A), anchored at the nominal stance.

    Args:
        path: The file.
        spec: What the numbers are.
        fps: Steps per second [Hz]; that of the layout if None.
        robot: The robot that they are for; the G1 with Dex3 hands if None.

    Raises:
        FileFormatError: If it is no such array, or there is no layout; names the layouts that are as wide.
    """
    try:
        actions = read_array(Path(path))
    except OSError as error:
        raise FileFormatError(f"cannot be read: {error.strerror or error}", path=str(path)) from error
    except ReadingError as error:
        raise FileFormatError(str(error), path=str(path)) from error
    text = f"has the shape {actions.shape}, type {actions.dtype}"
    if actions.dtype.kind not in "fiu" or actions.ndim != 2 or not 1 <= len(actions) <= STEPS_MAX:
        raise FileFormatError(f"{text}; numbers (steps, width) are expected, at most {STEPS_MAX} steps", path=str(path))
    if spec is None or spec.dim != actions.shape[1]:
        fits = [name for name in LAYOUTS if builtin(name, robot).dim == actions.shape[1]]
        wide = f"as wide: {', '.join(fits)}" if fits else "none that ships is so wide: write your own as JSON"
        mine = "what its numbers are is not said" if spec is None else f"'{spec.name}' has {spec.dim}"
        raise FileFormatError(f"{text}; {mine}: say --layout NAME, {wide}", path=str(path))
    if fps is not None:
        require_rate("fps", fps)
    return ChunkFile(spec, actions.astype(float), spec.fps if fps is None else fps)
