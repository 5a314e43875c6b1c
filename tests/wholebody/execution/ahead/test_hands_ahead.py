"""Strategy: a supervisor in its stance whose planner never answers: what then moves, newer chunks have led."""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from tests.support.chunk_streams import Stream, still_chunk
from tests.support.one_step_targets import follow
from wholebody.config import ControllerConfig
from wholebody.execution.ahead.hands_ahead import JUDGED_LEASH, LEASH
from wholebody.execution.background_planner import SimulatedPlanner
from wholebody.execution.supervisor import Supervisor
from wholebody.planning.changes import PlanChange
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Reason, Status, StatusReport
from wholebody.verdict.chunk_gate import ChunkGate
from wholebody.verdict.fast import FastChecker

REJECTED = StatusReport(Status.HOLD, Reason.NOT_CLEARED, "not this one")


class Stopped(SimulatedPlanner):
    """A planner that does not answer any more once it is told."""

    stopped = False

    def poll(self, now):
        return None if self.stopped else super().poll(now)


@pytest.fixture
def followed():
    """A supervisor that follows a chunk of its own stance, and asks in vain for the plan of the next one."""
    return waiting()


def waiting(gate=None):
    """Its loop, and where the left palm is."""
    planners = []

    def planner(compute):
        planners.append(Stopped(compute, ControllerConfig().planning))
        return planners[0]

    loop = Stream(Supervisor(g1(), planner=planner, gate=gate), MujocoPlant(g1()))
    palm = loop.supervisor.palm_reference()["left"][:3, 3].copy()
    loop.supervisor.accept(still_chunk(palm, 0, loop.state.time), loop.state.time)
    for _ in range(100):
        loop.tick()
    planners[0].stopped = True
    loop.supervisor.accept(still_chunk(palm, 1, loop.state.time), loop.state.time)
    return loop, palm


def gone(loop, palm, way, count=12):
    """How far the left palm goes when chunks lead it on by that way each 1/30 s (3,) [m]."""
    supervisor = loop.supervisor
    for k in range(1, count + 1):
        supervisor.accept(still_chunk(palm + k * way, 1 + k, loop.state.time), loop.state.time)
        for _ in range(16):
            loop.tick()
    assert loop.fall is None
    return supervisor.palm_reference()["left"][:3, 3] - palm


def test_hands_follow_chunks_whose_plans_are_not_there_yet(followed):
    way = np.array([0.004, 0.0, 0.002])
    went = gone(*followed, way)
    assert went @ way > 0.6 * 12 * way @ way
    assert followed[0].supervisor.ahead(np.array([followed[0].state.time]))[0].v[0] @ way > 0.0


def test_they_go_no_further_than_their_leash(followed):
    went = gone(*followed, np.array([0.004, 0.0, 0.0]), 50)
    assert LEASH[0] - 0.03 < np.linalg.norm(went) < LEASH[0] + 0.005


def test_a_chunk_that_jumps_waits_for_its_plan(followed):
    assert np.linalg.norm(gone(*followed, np.array([0.2, 0.0, 0.0]), 3)) < 1e-3


def test_chunks_that_come_seldom_wait_for_their_plans(followed):
    loop, palm = followed
    for k in range(1, 4):
        loop.supervisor.accept(still_chunk(palm + 0.01 * k * np.eye(3)[0], 1 + k, loop.state.time), loop.state.time)
        for _ in range(100):
            loop.tick()
    assert np.linalg.norm(loop.supervisor.palm_reference()["left"][:3, 3] - palm) < 1e-3


def test_where_the_plan_moved_the_hands_it_keeps_them(followed):
    loop, palm = followed
    plan = loop.supervisor.plan
    n = len(plan.report.steps)
    far = {Reason.OUT_OF_REACH: PlanChange(np.full(n, 0.05), np.ones(n, dtype=bool), "out of reach")}
    loop.supervisor.plan = replace(plan, report=replace(plan.report, changes=far))
    assert np.linalg.norm(gone(loop, palm, np.array([0.004, 0.0, 0.0]))) < 0.012


def test_a_plan_that_is_slower_than_its_chunk_keeps_them(followed):
    loop, palm = followed
    plan = loop.supervisor.plan
    loop.supervisor.plan = replace(plan, report=replace(plan.report, slowdown=1.5))
    assert np.linalg.norm(gone(loop, palm, np.array([0.004, 0.0, 0.0]))) < 1e-3


def test_a_refusal_gives_them_back_to_the_plan(followed):
    loop, palm = followed
    gone(loop, palm, np.array([0.004, 0.0, 0.0]))
    loop.supervisor._ahead.end(loop.supervisor.plan)
    for _ in range(800):
        loop.tick()
    assert loop.fall is None
    assert np.linalg.norm(loop.supervisor.palm_reference()["left"][:3, 3] - palm) < 1e-3


def gated(answers, way, ticks=60):
    """A supervisor behind a gate that rejects what it is told to, by chunk number; how far the left palm went [m]."""
    loop = Stream(
        Supervisor(g1(), gate=lambda request, plan: REJECTED if request.chunk.seq in answers else None),
        MujocoPlant(g1()),
    )
    supervisor, gone = loop.supervisor, []
    palm = supervisor.palm_reference()["left"][:3, 3].copy()
    for k, off in enumerate(way):
        supervisor.accept(still_chunk(palm + off, k, loop.state.time), loop.state.time)
        for _ in range(ticks if k == 0 else 16):
            loop.tick()
            gone.append((k, supervisor.palm_reference()["left"][:3, 3] - palm, supervisor._follower.leads))
    return gone


def test_behind_a_gate_a_stream_that_it_clears_is_followed_as_without_one():
    """To the bit: how far off and how late the palms are says so of all of them."""
    plant = MujocoPlant(g1())
    followed = [follow(Supervisor(g1(), gate=gate), plant, "reach", 2.0) for gate in (None, ChunkGate(FastChecker()))]
    assert followed[0] == followed[1]


def test_behind_a_gate_what_is_not_judged_yet_leads_hands_no_further_than_a_shorter_leash():
    went = gone(*waiting(lambda request, plan: None), np.array([0.004, 0.0, 0.0]), 20)
    assert JUDGED_LEASH[0] - 0.03 < np.linalg.norm(went) < JUDGED_LEASH[0] + 0.005


def test_what_a_gate_rejects_from_the_first_on_leads_hands_nowhere():
    far = [
        np.linalg.norm(off) for _, off, _ in gated(range(1, 99), [np.array([0.01 * k, 0.0, 0.0]) for k in range(12)])
    ]
    assert max(far) < 5e-3


def test_behind_a_gate_a_target_that_jumps_waits_for_its_judgement():
    gone = gated({1}, [np.zeros(3), np.array([0.1, 0.0, 0.0])])
    assert max(float(np.linalg.norm(off)) for _, off, _ in gone) < 1e-3


def test_where_a_gate_rejected_one_hands_are_led_again_once_another_is_cleared():
    way = [np.array([0.004 * k, 0.0, 0.0]) for k in range(60)]
    rejected = range(1, 24)
    leads = {k: led for k, _, led in gated(rejected, way)}
    first = next(k for k in leads if k and not leads[k] and leads[k - 1])
    back = next((k for k in leads if k > first and leads[k]), None)
    assert first <= 14
    assert back is not None
    assert back >= 24


def test_what_a_gate_rejects_stops_hands_that_are_fast():
    """They come to rest where the plan that was cleared last leads, and are within the leash of it all the way."""
    cleared, off = [], []

    def gate(request, plan):
        if len(cleared) == 8:
            return REJECTED
        cleared.append(plan)
        return None

    class Watched(Supervisor):
        def step(self, state, now=None):
            command = super().step(state, now)
            if self.plan is not None:
                hands = zip(self._smoother.motion.p, self.plan.paths, strict=True)
                off.append(max(np.linalg.norm(p - path.sample(np.array([self._follower.s])).p[0]) for p, path in hands))
            return command

    supervisor = Watched(g1(), gate=gate)
    assert follow(supervisor, MujocoPlant(g1()), "lissajous", 2.2, rests_from=2.0).drift < 2e-3
    assert supervisor.plan is cleared[-1]
    assert max(off) < JUDGED_LEASH[0] + 0.005
