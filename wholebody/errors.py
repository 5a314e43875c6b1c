"""Exceptions of the package: one base, each class also the builtin that fits.

*Infeasible* is never an exception: it is a status in a result. These are for misuse and for things that broke.
A message says what, the value with its unit, the bound, and what would work; the fields are kept as attributes.
"""

from __future__ import annotations

from importlib.util import find_spec


class WholebodyError(Exception):
    """Base of everything that `wholebody` raises on purpose.

    Attributes:
        fields: What the message was made of, by name (for reports); empty if there is nothing to add.
    """

    def __init__(self, message: str, **fields: object) -> None:
        super().__init__(message)
        self.fields = fields


class InputError(WholebodyError, ValueError):
    """An argument or a file has a wrong value, name, shape, unit or format."""


class ConfigError(WholebodyError, ValueError):
    """A configuration has an unknown key or a value out of range."""


class StateError(WholebodyError, RuntimeError):
    """A call came at a wrong time, for example `step` before `reset`."""


class PlanningError(WholebodyError, RuntimeError):
    """No plan could be computed for a chunk (a plan that is not balanced is a report, not this)."""


class SimulationError(WholebodyError, RuntimeError):
    """A simulation did not begin, ended, or is no longer finite: in the last case, which joint and when."""


class RenderError(WholebodyError, RuntimeError):
    """No picture could be made, for example because no OpenGL library is installed."""


def require_extra(extra: str, package: str, what: str) -> None:
    """Refuse what needs an optional package, before any work is done.

    Args:
        extra: Extra of this distribution that brings the package.
        package: Its import name.
        what: What needs it.

    Raises:
        InputError: If it is not installed, with the line that installs it.
    """
    if find_spec(package) is None:
        raise InputError(f"{what} needs the extra `{extra}`: pip install 'g1-wholebody[{extra}]'")
