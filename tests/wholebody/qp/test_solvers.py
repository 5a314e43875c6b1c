"""Strategy: two programs with active rows and one that needs slack, by every solver; daqp is the measure.

Then each solver alone, with no second one to help, closes the loop over standing and the beginning of a reach.
"""

import numpy as np
import pytest
from typer.testing import CliRunner

from models import g1
from models.pinocchio_model import stance_q
from policy.scripted.library import reach
from tests.support.body_cases import standing
from tests.support.wide import wide
from wholebody.bench.commands import bench
from wholebody.bench.solvers import HEADINGS, SolverRow, cells, study
from wholebody.control.controller import WholeBodyController
from wholebody.episode.run import EpisodeConfig
from wholebody.qp.presolve import polish, prepare
from wholebody.qp.residuals import kkt_residuals
from wholebody.qp.solvers import ACCEPTED, available, solve
from wholebody.types import RobotState

SOLVERS = ("daqp", "quadprog", "proxqp", "piqp", "osqp")
# Forwards speed of the whole robot [m/s] at which bounds are active, and at which no hard program has a solution.
PUSHED, LOST = 0.6, 1.5


@pytest.fixture(scope="module")
def programs():
    """The program at the stance for a hand reference 20 mm higher, by the speed of the pelvis [m/s]."""
    controller = WholeBodyController(g1())
    q = stance_q(controller.spec, controller.robot.model)
    found = {}
    for speed in (0.0, PUSHED, LOST):
        controller.reset(RobotState(0.0, q, np.zeros(controller.robot.nv)))
        controller.set_reference(standing(controller, q, lift=0.02))
        controller.robot.update(q, speed * np.eye(controller.robot.nv)[0])
        found[speed] = controller.build()
    return found


def test_every_solver_of_the_table_is_installed():
    assert set(available()) == set(SOLVERS) == set(ACCEPTED)


@pytest.mark.parametrize("solver", SOLVERS[1:])
@pytest.mark.parametrize("speed", [0.0, PUSHED])
def test_every_solver_finds_the_answer_of_daqp(programs, solver, speed):
    program = programs[speed]
    expected, answer = solve(program), solve(program, solver)
    assert expected.ok
    assert answer.ok, answer.residuals
    assert (np.abs(np.concatenate([expected.z, expected.z_box[:-2]])) > 1e-3).any()
    np.testing.assert_allclose(answer.x[:49], expected.x[:49], atol=1e-4)


@pytest.mark.parametrize("solver", ["quadprog", "proxqp", "piqp"])
def test_where_a_safety_bound_is_already_broken_the_slack_is_used(programs, solver):
    expected, answer = solve(programs[LOST]), solve(programs[LOST], solver)
    assert answer.ok, answer.residuals
    assert answer.x[-2] > 1.0
    np.testing.assert_allclose(answer.x[-2:], expected.x[-2:], atol=1e-4)


def test_osqp_says_so_where_it_does_not_arrive(programs):
    expected, answer = solve(programs[LOST]), solve(programs[LOST], "osqp")
    assert not answer.ok or np.abs(answer.x - expected.x)[:49].max() < 1e-2


def test_preparing_and_restoring_change_neither_the_answer_nor_its_multipliers(programs):
    program = programs[PUSHED]
    for slack in (False, True):
        prepared = prepare(program, slack=slack)
        np.testing.assert_allclose(np.diag(prepared.program.H), 1.0)
        inner = solve(prepared.program)
        outer = prepared.restore((inner.x, inner.y, inner.z, inner.z_box))
        assert kkt_residuals(program, *outer).within(1e-6, 1e-6)


def test_slacks_that_ought_to_be_used_are_noticed_when_they_were_fixed(programs):
    program = programs[LOST]
    prepared = prepare(program, slack=False)
    x = np.zeros(len(prepared.scale))
    z = np.zeros(len(program.upper))
    z[-1] = 2.0 * program.g[-1]
    restored = prepared.restore((x, np.zeros(len(program.b)), z, np.zeros_like(x)))
    assert restored[3][-1] > 0.0
    assert not kkt_residuals(program, *restored).within(1e9, 1.0)


def test_polishing_gets_from_four_digits_to_ten(programs):
    program = prepare(programs[PUSHED], slack=False).program
    exact = solve(program)
    rough = tuple(a * (1.0 + 1e-4) for a in (exact.x, exact.y, exact.z, exact.z_box))
    assert not kkt_residuals(program, *rough).within(1e-6, 1e-6)
    polished = polish(program, rough)
    assert kkt_residuals(program, *polished).within(1e-8, 1e-8)
    np.testing.assert_allclose(polished[0], exact.x, atol=1e-6)


def test_a_multiplier_on_a_side_that_does_not_exist_is_an_error(programs):
    """It used to count as none, since an infinite distance was taken for zero."""
    program = programs[0.0]
    answer = solve(program)
    row = int(np.flatnonzero(np.isneginf(program.lower))[0])
    z = answer.z.copy()
    z[row] = -1e3
    assert kkt_residuals(program, answer.x, answer.y, z, answer.z_box).complementarity > 1e-3


@pytest.mark.parametrize("solver", ["daqp", "quadprog", "compiled", *wide("proxqp", "piqp", "osqp")])
def test_each_solver_alone_stands_and_begins_a_reach(solver):
    times = EpisodeConfig(settle=0.1, hold=0.1)
    (row,) = study(g1(), solver, [reach(0.45, 1.0)], seconds=0.5, episode=times)
    assert row.solver == solver
    assert row.ticks == 350
    assert row.failures == 0
    assert not row.fell
    assert row.largest < 2e-3
    assert row.time_factor == pytest.approx(1.0, abs=0.01)
    assert row.primal <= ACCEPTED.get(solver, 1e-6)


def test_the_table_has_a_cell_for_every_heading():
    row = SolverRow("daqp", "reach", 600, 1, False, 1e-3, 2.5e-3, 1.0, 1e-9, 1e-7, 5e-4, 2e-3)
    expected = ("daqp", "reach", "no", "1 of 600", "1.00 / 2.5", "1.000", "1e-09", "1e-07", "0.50 / 2.00")
    assert cells(row) == expected
    assert len(HEADINGS) == len(expected)
    typed = CliRunner().invoke(bench, ["solvers", "--names", "daqp,gurobi"])
    assert isinstance(typed.exception, ValueError)
    assert "gurobi" in str(typed.exception)
