"""The reports of ``wholebody check --report``: a page an input, and of several inputs an index."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from shlex import join
from typing import TYPE_CHECKING, Any

from typer import Context

from wholebody.cli.console import check_folder

if TYPE_CHECKING:
    from policy.base import Policy
    from wholebody.verdict.check import Checker
    from wholebody.verdict.page.reporting import Run
    from wholebody.verdict.verdict import Verdict

NAME_MAX = 60
"""Most characters of an input's name in the name of its page."""


@dataclass(frozen=True)
class Pages:
    """Where reports go.

    Attributes:
        path: Of the one page, or of the index.
        names: The inputs, in order; the pages of several lie in the folder beside the index.
        options: Words of the command line that the verdicts depend on.
    """

    path: Path
    names: tuple[str, ...]
    options: tuple[str, ...] = ()

    @classmethod
    def at(cls, path: Path, names: Sequence[str], context: Context) -> Pages:
        """Made before anything is run, by a command line.

        Raises:
            InputError: If the extra is not installed.
            ValueError: If the file's name is no page's.
            OSError: If the folder of the pages cannot be made.
        """
        from wholebody.verdict.page.page import require_packages

        require_packages()
        if path.suffix != ".html":
            raise ValueError(f"cannot write '{path}': its name must end in .html")
        check_folder(path)
        pages = cls(path, tuple(names), tuple(_as_given(context)))
        if len(names) > 1:
            pages.folder.mkdir(exist_ok=True)
        return pages

    @property
    def folder(self) -> Path:
        """Folder of the pages of several inputs."""
        return self.path.with_suffix("")

    def place(self, name: str) -> Path:
        """The page of an input."""
        if len(self.names) == 1:
            return self.path
        short = re.sub(r"[^A-Za-z0-9._-]+", "_", Path(name).stem if "#" not in name else Path(name).name)
        return self.folder / f"{self.names.index(name):04d}_{short[-NAME_MAX:]}.html"

    def run(self, checker: Checker, policy: Policy, name: str, seconds: float, **shown: Any) -> Run:
        """Simulate an input for its page; ``shown`` as in `wholebody.verdict.page.reporting.simulated`."""
        from wholebody.verdict.page.reporting import simulated

        return simulated(checker, policy, name, seconds, **shown)

    def write(self, checker: Checker, run: Run) -> Verdict:
        """Write the page of a run; its verdict, with why where it is not feasible."""
        from wholebody.verdict.page.reporting import write_report

        return write_report(checker, run, self.place(run.name), self.command(run.name))

    def command(self, name: str) -> str:
        """What makes the page of one input again."""
        return join(["wholebody", "check", name, *self.options, "--report", str(self.place(name))])

    def write_index(self, verdicts: Sequence[Verdict]) -> None:
        """Rank the pages of several inputs, and name those without one."""
        from wholebody.verdict.page.index import write_index

        if len(self.names) > 1:
            pages = {v.name: f"{self.folder.name}/{self.place(v.name).name}" for v in verdicts}
            write_index(self.path, verdicts, pages, [name for name in self.names if name not in pages])


def _as_given(context: Context) -> Iterator[str]:
    """The options of a command line that say how an input is judged."""
    for option in context.command.params:
        source = context.get_parameter_source(option.name)
        if source is None or source.name != "COMMANDLINE" or option.name in NOT_SETTINGS:
            continue
        value = context.params[option.name]
        if option.is_flag:
            yield (option.opts if value else option.secondary_opts)[-1]
        else:
            yield option.opts[0]
            yield from map(str, value if isinstance(value, tuple | list) else (value,))


NOT_SETTINGS = ("inputs", "episodes", "jobs", "json_to", "report")
"""Parameters of ``check`` that say which inputs there are, and where answers go."""
