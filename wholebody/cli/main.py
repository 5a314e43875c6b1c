"""The command `wholebody`: its subcommands, and how it ends when one fails."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from typing import Annotated, TextIO

import typer

from wholebody.bench.commands import bench
from wholebody.cli.commands.audit import audit
from wholebody.cli.commands.check import check
from wholebody.cli.commands.convert import convert
from wholebody.cli.commands.doctor import doctor
from wholebody.cli.commands.layouts import layouts
from wholebody.cli.commands.live import live
from wholebody.cli.commands.plot import plot
from wholebody.cli.commands.reachability import reachability
from wholebody.cli.commands.repair import repair
from wholebody.cli.commands.run import run
from wholebody.cli.commands.serve_policy import serve_policy
from wholebody.cli.commands.settings import config, warmup
from wholebody.cli.commands.spec import spec
from wholebody.cli.console import complain, log_to_terminal
from wholebody.cli.crash import CRASH, sentence
from wholebody.cli.grouped import CommandsByTask, OptionsByGroup
from wholebody.cli.options import flat

MISUSE = 2
OUTPUT_CLOSED = 141
"""Exit code where nobody reads the output any more: what a shell tells of SIGPIPE."""

# What draws is a process of its own and says with which library; here MuJoCo is not to look for one.
os.environ["MUJOCO_GL"] = "disable"

app = typer.Typer(
    cls=CommandsByTask, no_args_is_help=True, rich_markup_mode=None, help="Action chunks in, a balanced G1 out."
)
TASKS = {
    "Check": (check, audit, repair, reachability),
    "Run": (run, live, plot),
    "Convert": (convert, layouts, spec, doctor),
    "Serve": (serve_policy,),
    "Set up": (warmup, config),
}
for task, commands in TASKS.items():
    for command in commands:
        name = command.__name__.replace("_", "-")
        app.command(name, cls=OptionsByGroup, rich_help_panel=task)(flat(command))
app.add_typer(bench, name="bench", rich_help_panel="Measure")


class _Outlet:
    """Standard output whose reader may leave, as ``head`` does: that is no answer, least of all `infeasible`."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> object:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write text, or end."""
        with _while_read():
            return self._stream.write(text)

    def flush(self) -> None:
        """Hand on what was written, or end."""
        with _while_read():
            self._stream.flush()


@contextmanager
def _while_read() -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:
        # Python would fail once more when it flushes at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.__stdout__.fileno())
        sys.exit(OUTPUT_CLOSED)


def main() -> None:
    """Entry point; bad input ends with one sentence and exit code 2, a fault of ours with code 3, never a traceback."""
    from models.spec import RobotSpecError
    from policy.errors import PolicyError
    from wholebody.errors import WholebodyError

    log_to_terminal()
    sys.stdout = _Outlet(sys.stdout)
    try:
        app(prog_name="wholebody")
    except (PolicyError, WholebodyError, RobotSpecError, OSError, ValueError) as error:
        complain(str(error))
        sys.exit(MISUSE)
    except Exception as error:  # noqa: BLE001 - whatever it is, it is a fault of ours and has its exit code
        complain(sentence(error))
        sys.exit(CRASH)


@app.callback(invoke_without_command=True)
def _options(show_version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    if show_version:
        print(version("g1-wholebody"))
        raise typer.Exit
