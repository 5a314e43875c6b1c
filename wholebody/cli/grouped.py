"""Help by what it is for: commands under their tasks, options under the group that they are declared in."""

from __future__ import annotations

from typing import Any

from typer import Context
from typer.core import TyperArgument, TyperCommand, TyperGroup

Rows = dict[str, list[tuple[str, str]]]


def _write(formatter: Any, rows: Rows) -> None:
    for title, entries in rows.items():
        with formatter.section(title):
            formatter.write_dl(entries)


class OptionsByGroup(TyperCommand):
    """A command that shows its options by ``rich_help_panel``."""

    def format_options(self, ctx: Context, formatter: Any) -> None:
        """Write arguments and options, a section a group."""
        rows: Rows = {}
        for param in self.get_params(ctx):
            record = param.get_help_record(ctx)
            if record is not None:
                usual = "Arguments" if isinstance(param, TyperArgument) else "Options"
                rows.setdefault(getattr(param, "rich_help_panel", None) or usual, []).append(record)
        _write(formatter, rows)


class CommandsByTask(TyperGroup):
    """A group that shows its commands by ``rich_help_panel``, in the order in which they were added."""

    def format_commands(self, ctx: Context, formatter: Any) -> None:
        """Write the commands, a section a task."""
        rows: Rows = {}
        width = max(map(len, self.commands), default=0)
        for name, command in self.commands.items():
            text = command.get_short_help_str(formatter.width - 6 - width)
            task = getattr(command, "rich_help_panel", None) or "Commands"
            rows.setdefault(task, []).append((name.ljust(width), text))
        _write(formatter, rows)

    def list_commands(self, ctx: Context) -> list[str]:
        """Names in the order in which they were added."""
        return list(self.commands)
