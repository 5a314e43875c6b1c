"""Strategy: kernels on packed memory, compiled, against the same kernels interpreted on a second memory: all of it must
be equal afterwards. The programs of the tick are such kernels too.
"""

import numpy as np
import pytest

from models import g1
from models.pinocchio_model import stance_q
from tests.support.body_cases import standing
from wholebody.control.controller import WholeBodyController
from wholebody.jit import entry
from wholebody.jit.packed import Packed
from wholebody.qp.kernels import assemble, residuals, solve
from wholebody.types import RobotState


def count_up(tick):
    """A scalar of integers, read and written."""
    tick.n = tick.n + 2


def scaled(tick, k):
    """A row of a cube by a scalar."""
    for i in range(3):
        tick.g[i] += tick.tolerance * tick.cube[1, k, i]


def each(tick, first, second):
    """Kernels given as arguments."""
    for k in range(tick.rows.shape[0]):
        first(tick)
        second(tick, tick.rows[k])


def run(tick):
    """Returns a scalar."""
    each(tick, count_up, scaled)
    tick.tolerance = 0.5 * tick.tolerance + tick.n
    return tick.H[1, 0]


def make(extra=0):
    reals = {"H": (2, 2), "g": (3,), "tolerance": (), "cube": (2, 3, 3), "more": (extra, 4)}
    tick = Packed(reals, {"rows": (2,), "n": ()})
    tick.H[:], tick.tolerance, tick.rows[:] = [[1.0, 2.0], [3.0, 4.0]], 2.0, [2, 0]
    tick.cube[:] = np.arange(18.0).reshape(2, 3, 3)
    return tick


def test_a_compiled_kernel_does_to_packed_memory_what_the_interpreted_one_does(monkeypatch):
    monkeypatch.setattr(entry, "PACKAGES", ("wholebody", "tests"))
    compiled, interpreted, compiled_run = make(), make(), entry.Entry(run)
    assert compiled_run(compiled) == run(interpreted) == 3.0
    assert np.array_equal(compiled.memory, interpreted.memory)
    assert compiled.n == 4
    assert compiled.tolerance == 5.0


def test_what_is_compiled_for_some_fields_serves_memories_of_any_length(monkeypatch):
    monkeypatch.setattr(entry, "PACKAGES", ("wholebody", "tests"))
    compiled_run = entry.Entry(run)
    for extra in (0, 7):
        assert compiled_run(make(extra)) == 3.0


def test_fields_share_the_memory_and_follow_each_other():
    tick = make()
    span = tick.span("g", "cube")
    assert len(span) == 3 + 1 + 18
    span[:] = 7.0
    assert tick.g[0] == tick.tolerance == tick.cube[1, 2, 2] == 7.0
    assert tick.H[1, 1] == 4.0


def test_a_field_that_does_not_exist_is_named():
    tick = make()
    with pytest.raises(AttributeError, match="no field 'h'"):
        _ = tick.h
    with pytest.raises(AttributeError, match=r"`\.g\[:\] = "):
        tick.g = np.zeros(3)
    with pytest.raises(ValueError, match="'a'"):
        Packed({"a": (2,)}, {"a": ()})


def test_the_kernels_of_the_tick_run_interpreted_as_they_stand():
    controller = WholeBodyController(g1())
    q, compiled = stance_q(controller.spec, controller.robot.model), controller.compiled
    v = 0.1 * np.random.default_rng(1).normal(size=controller.robot.nv)
    controller.reset(RobotState(0.0, q, v))
    controller.set_reference(standing(controller, q))
    assert compiled.compute(q, v)
    wanted, residual = compiled.answer().solution(), compiled.residuals.copy()
    compiled.reset()
    for array in (compiled.dv, compiled.forces, compiled.tau):
        array[:] = np.nan
    tick = compiled.tick
    assemble.move(tick)
    assert assemble.assemble(tick) == 0
    assert solve.search(tick) == 0
    assert residuals.conclude(tick)
    np.testing.assert_allclose(compiled.dv, wanted.dv, atol=1e-9)
    np.testing.assert_allclose(compiled.tau, wanted.tau, atol=1e-8)
    assert np.abs(compiled.residuals - residual).max() < 1e-8
