"""What commands show on the terminal, and the files that they write."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event, Thread
from time import monotonic
from typing import TYPE_CHECKING, TextIO

from policy import writing
from policy.errors import printable
from policy.writing import OutputError
from wholebody.errors import require_extra

LINE_MAX = 4000
"""Most characters of a line on the terminal."""
FIRST_BEAT, HEARTBEAT = 1.0, 3.0
"""Time after which something that takes long first says so in a pipe, and period of its further lines [s]; chosen: 5
s never pass without a word."""

if TYPE_CHECKING:
    from wholebody.sim.recorder import Recorder
    from wholebody.verdict.verdict import Verdict


class _Sentences(logging.Formatter):
    """Format of log messages: ours begin as errors do, messages of libraries name their source."""

    def format(self, record: logging.LogRecord) -> str:
        name = record.name.partition(".")[0]
        source = "wholebody" if name in ("models", "policy", "wholebody") else record.name
        message = record.getMessage()
        # Only our own messages have lines of their own, and quote those of others behind a bar.
        lines = message.split("\n") if source == "wholebody" else [message]
        return f"{source}: " + "\n".join(printable(line) for line in lines)


def log_to_terminal() -> None:
    """Warnings go to standard error, one line each; without effect where logging is configured already."""
    handler = logging.StreamHandler()
    handler.setFormatter(_Sentences())
    logging.basicConfig(handlers=[handler], level=logging.WARNING)


def say(*lines: str, to_errors: bool = False) -> None:
    """Print lines, in which names and notes from outside can neither move the cursor nor begin another line."""
    print("\n".join(printable(line, LINE_MAX) for line in lines), file=sys.stderr if to_errors else None, flush=True)


def complain(text: str) -> None:
    """A sentence on standard error, as all of ours begin."""
    say(f"wholebody: {text}", to_errors=True)


def check_places(
    json_to: str, video: Path | None = None, sheet: Path | None = None, record: Path | None = None
) -> None:
    """Refuse outputs that cannot be written before minutes of simulation, not after."""
    for path, endings in ((video, (".mp4", ".gif")), (sheet, (".png",)), (record, (".npz",))):
        if path is not None and path.suffix not in endings:
            raise ValueError(f"cannot write '{path}': its name must end in {' or '.join(endings)}")
    if video is not None and video.suffix == ".mp4":
        require_extra("video", "imageio_ffmpeg", "--video")
    for path in (video, sheet, record, Path(json_to) if json_to not in ("", "-") else None):
        if path is not None:
            check_folder(path)


def check_folder(path: Path) -> None:
    """Refuse an output whose folder does not exist, or that is one."""
    if path.is_dir():
        raise ValueError(f"cannot write '{path}': it is a folder")
    if not path.absolute().parent.is_dir():
        raise ValueError(f"cannot write '{path}': there is no folder '{path.parent}'")


def print_verdict(verdict: Verdict) -> None:
    """The answer in words, its first line the verdict."""
    from wholebody.verdict.report import lines

    say(*lines(verdict))


def print_nothing(verdict: Verdict) -> None:
    """Standard output is for JSON alone."""


def table_printer(names: list[str]) -> Callable[[Verdict], None]:
    """Print the heading; what it returns prints a motion's row as soon as that motion is over."""
    from wholebody.verdict.report import HEADINGS, row, table_line

    width = max(len(Path(name).stem) for name in names)
    say(table_line(HEADINGS, width))
    return lambda verdict: say(table_line(row(verdict), width))


@contextmanager
def waiting(text: str, quiet: bool = False) -> Iterator[None]:
    """A note for as long as something takes: moving on a terminal, in a pipe a plain line every few seconds."""
    if quiet:
        yield
    elif sys.stderr.isatty():
        from rich.console import Console

        with Console(stderr=True, markup=False).status(printable(text)):
            yield
    else:
        with heartbeat(lambda seconds: f"{text} ({seconds:.0f} s)"):
            yield


@contextmanager
def progress_bar(
    name: str, *, quiet: bool = False, before_frames: str = ""
) -> Iterator[Callable[[float, float], None] | None]:
    """How far a simulation is, or work on frames: a bar on a terminal, in a pipe a plain line every few seconds.

    Args:
        name: Of what is worked on.
        quiet: Show nothing.
        before_frames: What is done before the first frame, of work on frames; of a simulation empty.
    """
    if quiet:
        yield None
    elif sys.stderr.isatty():
        from rich.console import Console
        from rich.markup import escape
        from rich.progress import Progress, SpinnerColumn, TimeElapsedColumn

        columns = (SpinnerColumn(), *Progress.get_default_columns()[:-1], TimeElapsedColumn())
        with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
            slow = "" if before_frames else ", compiling if it is the first time"
            task = bar.add_task(f"{escape(printable(name, 200))}{slow}", total=1.0)
            yield lambda time, end: bar.update(task, completed=time / end, description=escape(printable(name, 200)))
    else:
        lines = _FrameLines(name, before_frames) if before_frames else _ProgressLines(name)
        with heartbeat(lines.line):
            yield lines.update


class _ProgressLines:
    """How far a simulation is, and why it does not get on: its parts are compiled when they are first used."""

    def __init__(self, name: str) -> None:
        self.name, self.now, self.shown = name, "0 s simulated", ""

    def update(self, time: float, end: float) -> None:
        self.now = f"{time:.1f} of {end:.1f} s simulated"

    def line(self, seconds: float) -> str:
        why = ", compiling if it is the first time" if self.now == self.shown else ""
        self.shown = self.now
        return f"{self.name}: {self.now}{why} ({seconds:.0f} s)"


class _FrameLines:
    """How many frames of all are drawn, or converted."""

    def __init__(self, name: str, before: str) -> None:
        self.name, self.now = name, before

    def update(self, done: float, total: float) -> None:
        self.now = f"{done:.0f} of {total:.0f} frames"

    def line(self, seconds: float) -> str:
        return f"{self.name}: {self.now} ({seconds:.0f} s)"


@contextmanager
def heartbeat(line: Callable[[float], str], *, quiet: bool = False) -> Iterator[None]:
    """A line on standard error every `HEARTBEAT` seconds, made of the seconds since the beginning."""
    if quiet:
        yield
        return
    begin, over = monotonic(), Event()

    def beat() -> None:
        pause = FIRST_BEAT
        while not over.wait(pause):
            complain(line(monotonic() - begin))
            pause = HEARTBEAT

    thread = Thread(target=beat, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def write_pictures(recorder: Recorder, video: Path | None, sheet: Path | None, record: Path | None) -> None:
    """The recording and what is drawn from it; without OpenGL the run still counts."""
    from wholebody.errors import RenderError
    from wholebody.sim.pictures.render import render

    with TemporaryDirectory() as folder:
        file = record or Path(folder) / "run.npz"
        recorder.save(file)
        if record is not None:
            say(f"wrote {record}", to_errors=True)
        for output in (video, sheet):
            if output is None:
                continue
            try:
                with progress_bar(f"drawing {output}", before_frames="loading the robot") as progress:
                    render(file, output, progress=progress)
                say(f"wrote {output}", to_errors=True)
            except RenderError as error:
                complain(f"'{output}' was not written: {error}")


class JsonVerdicts:
    """Verdicts as JSON, a line each as soon as there is one: a list, or in a file ``.jsonl`` the lines alone.

    Whatever happens in between, a list that was begun is closed.

    Args:
        target: A file, ``-`` for standard output, empty for nothing.

    Raises:
        OSError: On entering, if the file cannot be written.
    """

    def __init__(self, target: str) -> None:
        self.target, self.begin, self.between, self.end = target, "[\n", ",\n", "\n]\n"
        if target.endswith(".jsonl"):
            self.begin, self.between, self.end = "", "\n", "\n"
        self._count = 0

    def __enter__(self) -> JsonVerdicts:
        self._file: TextIO | None = None
        if self.target:
            self._file = sys.stdout if self.target == "-" else Path(self.target).open("w")
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._count:
            self._write(self.end)
        elif kind is None and self.begin:
            self._write("[]\n")
        if self._file not in (None, sys.stdout):
            self._file.close()
            if kind is None:
                say(f"wrote {self.target}", to_errors=True)

    def add(self, verdict: Verdict) -> None:
        """Write a verdict."""
        from wholebody.verdict.report import json_line

        self._write(f"{self.between if self._count else self.begin}{json_line(verdict)}")
        self._count += 1

    def _write(self, text: str) -> None:
        if self._file is None:
            return
        try:
            self._file.write(text)
            self._file.flush()
        except OSError as error:
            if self._file is sys.stdout:
                raise
            self._give_up()
            raise OutputError(error.errno, f"cannot write '{self.target}': {error.strerror}") from error

    def _give_up(self) -> None:
        """Leave no empty file behind."""
        file, self._file, self._count = self._file, None, 0
        with suppress(OSError):
            file.close()
        place = Path(self.target)
        if place.is_file() and not place.stat().st_size:
            place.unlink()


def write_text(target: str, text: str) -> None:
    """Text to a file, or with '-' to standard output."""
    if target == "-":
        print(text)
    else:
        writing.write_text(target, text + "\n")
