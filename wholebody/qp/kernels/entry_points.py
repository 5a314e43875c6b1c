"""What a tick calls one after the other; compiles with numba as it stands.

Each of these only hands on: a stage has other options than what it calls, so whatever it called itself would be
compiled twice.
"""

from wholebody.qp.kernels import assemble as assemble_core
from wholebody.qp.kernels import command as command_core
from wholebody.qp.kernels import proximity as nearest_core
from wholebody.qp.kernels import residuals as judge_core
from wholebody.qp.kernels import solve as solve_core

_move, _nearest, _assemble = assemble_core.move, nearest_core.nearest, assemble_core.assemble
_search, _conclude, _command = solve_core.search, judge_core.conclude, command_core.command


def move(reals, ints):
    """`assemble_core.move`."""
    _move(reals, ints)


def nearest(reals, ints):
    """`nearest_core.nearest`."""
    return _nearest(reals, ints)


def assemble(reals, ints):
    """`assemble_core.assemble`."""
    return _assemble(reals, ints)


def search(reals, ints):
    """`solve_core.search`."""
    return _search(reals, ints)


def conclude(reals, ints):
    """`judge_core.conclude`."""
    return _conclude(reals, ints)


def command(reals, ints):
    """`command_core.command`."""
    _command(reals, ints)
