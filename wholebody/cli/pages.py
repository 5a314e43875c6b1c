"""The reports of ``wholebody check --report``: a page an input, and of several inputs an index."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from policy.base import Policy
    from wholebody.episode.run import Cameras
    from wholebody.verdict.check import Checker
    from wholebody.verdict.verdict import Verdict

NAME_MAX = 60
"""Most characters of an input's name in the name of its page."""


@dataclass(frozen=True)
class Pages:
    """Where reports go.

    Attributes:
        path: Of the one page, or of the index.
        names: The inputs, in order; the pages of several lie in the folder beside the index.
    """

    path: Path
    names: tuple[str, ...]

    @classmethod
    def at(cls, path: Path, names: Sequence[str]) -> Pages:
        """Made before anything is run.

        Raises:
            InputError: If the extra is not installed.
            ValueError: If the file's name is no page's.
            OSError: If the folder of the pages cannot be made.
        """
        from wholebody.verdict.page.page import require_packages

        require_packages()
        if path.suffix != ".html":
            raise ValueError(f"cannot write '{path}': its name must end in .html")
        if not path.absolute().parent.is_dir():
            raise ValueError(f"cannot write '{path}': there is no folder '{path.parent}'")
        pages = cls(path, tuple(names))
        if len(names) > 1:
            pages.folder.mkdir(exist_ok=True)
        return pages

    @property
    def folder(self) -> Path:
        """Of the pages of several inputs."""
        return self.path.with_suffix("")

    def place(self, name: str) -> Path:
        """The page of an input."""
        if len(self.names) == 1:
            return self.path
        short = re.sub(r"[^A-Za-z0-9._-]+", "_", Path(name).stem if "#" not in name else Path(name).name)
        return self.folder / f"{self.names.index(name):04d}_{short[-NAME_MAX:]}.html"

    def check(
        self,
        checker: Checker,
        policy: Policy,
        name: str,
        seconds: float,
        cameras: Cameras | None,
        progress: Callable[[float, float], None] | None,
    ) -> Verdict:
        """Judge an input, say why where it is not feasible, and write its page."""
        from wholebody.verdict.page.reporting import report

        return report(checker, policy, name, seconds, self.place(name), command(name), cameras, progress)

    def write_index(self, verdicts: Sequence[Verdict]) -> None:
        """Rank the pages of several inputs."""
        from wholebody.verdict.page.index import write_index

        if len(self.names) > 1:
            write_index(
                self.path, verdicts, {v.name: f"{self.folder.name}/{self.place(v.name).name}" for v in verdicts}
            )


def command(name: str) -> str:
    """What makes the page of one input again: the options as they were given."""
    from shlex import join

    options, skip = [], False
    for word in sys.argv[2:]:
        if word.startswith("-"):
            options.append(word)
            skip = "=" not in word and word not in FLAGS
        elif skip:
            options.append(word)
            skip = False
    return join(["wholebody", "check", name, *options])


FLAGS = ("--fast", "--why", "--realistic", "--payload-known")
"""Options of ``check`` without a value."""
