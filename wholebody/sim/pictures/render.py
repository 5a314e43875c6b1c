"""Video and sheet of a recorded run.

Drawing happens in a child process, `wholebody.sim.pictures.drawing`: with a wrong ``MUJOCO_GL`` already
``import mujoco`` can end the process, and the choice of the library is made at import.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from queue import Empty, SimpleQueue
from tempfile import TemporaryDirectory
from threading import Thread
from typing import TextIO

from wholebody.errors import InputError, RenderError, require_extra
from wholebody.sim.opengl import LIBRARIES
from wholebody.sim.pictures.scene import SCENE_COLUMNS
from wholebody.sim.record import read_record

Progress = Callable[[int, int], None]
"""Called with the number of frames that are drawn, and of those to draw."""


def render(
    recording: str | Path, output: str | Path, *, timeout: float = 120.0, progress: Progress | None = None
) -> None:
    """Draw a recording as a video (.mp4, .gif) or as a sheet of six frames (.png); broken off, it leaves no file.

    Args:
        recording: File written by `wholebody.sim.recorder.Recorder.save`.
        output: Where to; the ending says what.
        timeout: Longest time without a frame [s].
        progress: Called after every frame.

    Raises:
        InputError: If the ending is neither, or the recording is missing.
        FileFormatError: If it is damaged.
        RenderError: If no OpenGL back end works here, with the packages that are missing.
    """
    check_output(output)
    if not Path(recording).exists():
        raise InputError(f"there is no recording '{recording}'")
    read_record(recording, SCENE_COLUMNS)
    reasons, output = [], Path(output)
    # Beside its place: a file system renames only within itself.
    with TemporaryDirectory(prefix=".drawing-", dir=output.absolute().parent) as folder:
        for backend, packages in LIBRARIES.items():
            drawn = Path(folder) / output.name
            reason = _child(backend, recording, drawn, timeout, progress or (lambda done, total: None))
            if reason is None:
                drawn.replace(output)
                return
            reasons.append(f"{backend} (Debian packages: {packages}): {reason}")
    raise RenderError("no OpenGL here to render with; install one of: " + "; ".join(reasons))


def check_output(output: str | Path) -> None:
    """Refuse a file name that is neither video nor picture, before any work is done.

    Raises:
        InputError: With the endings that would do, or the extra that a video needs.
    """
    if Path(output).suffix not in (".mp4", ".gif", ".png"):
        raise InputError(
            f"cannot render to '{output}': the ending must be .mp4 (video), .gif (small video) or .png (sheet of six "
            "frames)"
        )
    if Path(output).suffix == ".mp4":
        require_extra("video", "imageio_ffmpeg", "a video")


def _child(backend: str, recording: str | Path, output: str | Path, timeout: float, progress: Progress) -> str | None:
    """Draw in a process of its own; the reason if that failed, else None."""
    command = [sys.executable, "-m", "wholebody.sim.pictures.drawing", str(recording), str(output)]
    environment = {**os.environ, "MUJOCO_GL": backend}
    child = subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, errors="replace"
    )
    answers, complaints = _lines(child.stdout), _lines(child.stderr)
    try:
        while (line := answers.get(timeout=timeout)) is not None:
            done, _, total = line.strip().partition(" ")
            if done.isdigit() and total.isdigit():
                progress(int(done), int(total))
        if child.wait(timeout) == 0:
            return None
    except (Empty, subprocess.TimeoutExpired):
        return f"took longer than {timeout:.0f} s for a frame"
    finally:
        # Also after Ctrl-C: no child draws on.
        child.kill()
        child.wait()
    last = ""
    while (line := complaints.get()) is not None:
        last = line.strip() or last
    return last or f"ended with code {child.returncode}"


def _lines(stream: TextIO) -> SimpleQueue[str | None]:
    """Lines of a stream as they come, None at its end; read by a thread, so that one can wait for them for a time."""
    lines: SimpleQueue[str | None] = SimpleQueue()

    def read() -> None:
        with stream:
            for line in stream:
                lines.put(line)
        lines.put(None)

    Thread(target=read, daemon=True).start()
    return lines
