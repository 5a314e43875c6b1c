"""Strategy: a real process that plans; the same plan as here, and what happens when it is killed."""

import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from models import g1
from policy.scripted.library import scripted_policy
from wholebody.config import ControllerConfig
from wholebody.episode.run import observe
from wholebody.errors import PlanningError
from wholebody.execution.background_planner import PlanRequest, ThreadPlanner
from wholebody.execution.gate import RejectedError
from wholebody.execution.planner_process import PlannerProcess
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Reason
from wholebody.verdict.chunk_gate import gate_of


@pytest.fixture(scope="module")
def request_and_plan():
    """A request of a supervisor, and the plan that it makes of it itself."""
    kept = []

    class Here:
        measured = False

        def __init__(self, compute):
            self.compute = compute

        def submit(self, request):
            kept.append((request, self.compute(request)))

        def poll(self, now):
            return None

        def close(self):
            pass

    spec = g1()
    state = MujocoPlant(spec).state()
    supervisor = Supervisor(spec, planner=Here)
    supervisor.reset(state)
    supervisor.step(state)
    supervisor.accept(scripted_policy("wave").infer(observe(spec, supervisor, state)))
    return kept[0]


@pytest.fixture(scope="module")
def process():
    process = PlannerProcess(g1(), ControllerConfig(), gate=partial(gate_of, ControllerConfig(), {}))
    yield process
    process.close()


def test_the_plan_is_the_one_that_is_made_here(process, request_and_plan):
    request, here = request_and_plan
    there = process(request)
    np.testing.assert_array_equal(there.trajectory.q, here.trajectory.q)
    assert there.report.reasons == here.report.reasons
    assert len(process.seconds) == 1


def test_what_a_gate_there_holds_comes_with_what_it_says(process, request_and_plan):
    request, _ = request_and_plan
    away = request.chunk.T_world_lhand.copy()
    away[5:, 0, 3] += 1.0
    with pytest.raises(RejectedError) as held:
        process(replace(request, chunk=replace(request.chunk, T_world_lhand=away)))
    assert held.value.report.reason is Reason.NOT_CLEARED
    assert "mm off at row 5 (0.17 s), 50 mm allowed: out of reach" in str(held.value)


def test_a_chunk_without_a_plan_is_an_answer(process, request_and_plan):
    request, _ = request_and_plan
    broken = PlanRequest(request.chunk, request.asked, float("nan"), request.start)
    with pytest.raises(PlanningError):
        process(broken)


def test_a_killed_planner_is_told_and_another_one_takes_its_place(process, request_and_plan):
    request, here = request_and_plan
    planner = ThreadPlanner(process)
    process._process.kill()
    planner.submit(request)
    answer = _answer(planner)
    assert isinstance(answer.error, PlanningError)
    planner.submit(replace(request))
    np.testing.assert_array_equal(_answer(planner).plan.trajectory.q, here.trajectory.q)
    planner.close()


def _answer(planner):
    end = time.monotonic() + 120.0
    while time.monotonic() < end:
        if (answer := planner.poll(0.0)) is not None:
            return answer
        time.sleep(0.01)
    raise TimeoutError
