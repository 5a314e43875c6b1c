"""What a tick calls one after the other; compiles with numba as it stands.

Each of these only hands on: a stage has other options than what it calls, so whatever it called itself would be
compiled twice.
"""

from wholebody.qp.kernels.assemble import assemble as _assemble
from wholebody.qp.kernels.assemble import move as _move
from wholebody.qp.kernels.command import command as _command
from wholebody.qp.kernels.proximity import nearest as _nearest
from wholebody.qp.kernels.residuals import conclude as _conclude
from wholebody.qp.kernels.solve import search as _search


def move(reals, ints):
    """`assemble.move`."""
    _move(reals, ints)


def nearest(reals, ints):
    """`proximity.nearest`."""
    return _nearest(reals, ints)


def assemble(reals, ints):
    """`assemble.assemble`."""
    return _assemble(reals, ints)


def search(reals, ints):
    """`solve.search`."""
    return _search(reals, ints)


def conclude(reals, ints):
    """`residuals.conclude`."""
    return _conclude(reals, ints)


def command(reals, ints):
    """`command.command`."""
    _command(reals, ints)
