"""Strategy: who plans beside the loop, with plans that are made in no time, slowly, or not at all."""

import threading
import time

import numpy as np
import pytest

from wholebody.config import PlanningConfig
from wholebody.errors import ConfigError, PlanningError
from wholebody.execution.background_planner import PlanRequest, SimulatedPlanner, ThreadPlanner


def request(asked=1.0):
    return PlanRequest(chunk=None, asked=asked, due=asked + 0.1, start=None)


def same(request):
    return request


def busy(_):
    begin = time.thread_time()
    while time.thread_time() - begin < 0.02:
        pass


def no_plan(_):
    raise PlanningError("no steps were found")


def broken(_):
    np.linalg.cholesky(-np.eye(2))


def test_a_simulated_plan_comes_when_its_latency_is_over_and_once():
    planner, one = SimulatedPlanner(same, PlanningConfig(lead=0.1)), request()
    planner.submit(one)
    assert planner.poll(1.098) is None
    assert planner.poll(1.1).plan is one
    assert planner.poll(1.2) is None


def test_a_simulated_plan_takes_the_time_that_was_measured():
    planner = SimulatedPlanner(busy, PlanningConfig(latency="measured", factor=3.0))
    planner.submit(request())
    assert planner.poll(1.05) is None
    assert planner.poll(1.5) is not None


def test_what_was_asked_for_last_is_what_comes():
    planner = SimulatedPlanner(same, PlanningConfig())
    planner.submit(request(1.0))
    planner.submit(request(1.05))
    assert planner.poll(1.1) is None
    assert planner.poll(1.15).request.asked == 1.05
    planner.submit(request())
    planner.close()
    assert planner.poll(9.0) is None


def out_of_memory(_):
    raise MemoryError


@pytest.mark.parametrize(
    ("compute", "error"), [(no_plan, PlanningError), (broken, np.linalg.LinAlgError), (out_of_memory, MemoryError)]
)
def test_whatever_fails_is_an_answer_and_the_loop_goes_on(compute, error):
    planner = SimulatedPlanner(compute, PlanningConfig(lead=0.0))
    planner.submit(request())
    assert isinstance(planner.poll(1.0).error, error)
    # A request that interrupts the program is none that failed.
    with pytest.raises(KeyboardInterrupt):
        SimulatedPlanner(interrupted, PlanningConfig()).submit(request())


def interrupted(_):
    raise KeyboardInterrupt


def test_an_unknown_latency_is_refused():
    with pytest.raises(ConfigError, match="'fixed' or 'measured'"):
        SimulatedPlanner(same, PlanningConfig(latency="none"))


def answer_of(planner):
    """The answer, waited for."""
    end = time.monotonic() + 20.0
    while time.monotonic() < end:
        answer = planner.poll(0.0)
        if answer is not None:
            return answer
        time.sleep(1e-3)
    raise AssertionError("no answer in 20 s")


def test_a_thread_plans_while_the_loop_goes_on():
    go = threading.Event()
    planner, one = ThreadPlanner(lambda request: go.wait(20.0) and request), request()
    planner.submit(one)
    assert planner.poll(0.0) is None
    go.set()
    assert answer_of(planner).plan is one
    planner.close()


def test_a_thread_drops_what_is_not_wanted_any_more():
    go, planned = threading.Event(), []

    def slow(request):
        planned.append(request.asked)
        return go.wait(20.0) and request

    planner = ThreadPlanner(slow)
    for asked in (1.0, 2.0, 3.0):
        planner.submit(request(asked))
        while not planned:
            time.sleep(1e-3)
    go.set()
    assert answer_of(planner).request.asked == 3.0
    assert planned == [1.0, 3.0]
    planner.close()


def test_whatever_goes_wrong_in_a_thread_is_an_answer():
    planner = ThreadPlanner(broken)
    planner.submit(request())
    assert isinstance(answer_of(planner).error, np.linalg.LinAlgError)
    planner.submit(request())
    assert answer_of(planner).error is not None, "the thread goes on"
    planner.close()
