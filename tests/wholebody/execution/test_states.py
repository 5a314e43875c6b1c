"""Strategy: every row of the table on a real supervisor and plant, brought into each of its states; its drawing."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from models import g1
from policy.scripted.library import scripted_policy
from tests.studies import spent_waist
from wholebody.config import ControllerConfig, PlanningConfig
from wholebody.episode.run import observe
from wholebody.errors import PlanningError
from wholebody.execution.ending.crouch import crouch
from wholebody.execution.handover import WAIT
from wholebody.execution.states import TABLE, Event, Machine, State, Transition
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.state import Robot
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Reason, Status
from wholebody.walking.gait import Phase

SPEC = g1()
LEAD = PlanningConfig().lead
CONFIG = ControllerConfig(steps="reach")
UP, ON_BOTH_FEET = (next(row.states for row in TABLE if row.event is one) for one in (Event.FELL, Event.LOWER))
GOAL = (0.1, 0.0, 0.0)


class Loop:
    """Supervisor and plant, and what they are brought into."""

    def __init__(self, supervisor, plant, monkeypatch):
        self.supervisor, self.plant, self.patch = supervisor, plant, monkeypatch

    def put(self, q=None):
        self.plant.reset()
        if q is not None:
            zero = np.zeros(self.supervisor.robot.nv)
            self.plant._conversion.to_mujoco(q, zero, self.plant.data.qpos, self.plant.data.qvel)
            mujoco.mj_forward(self.plant.model, self.plant.data)
        self.supervisor.reset(self.plant.state())

    def step(self, until, longest=2.0):
        while not until():
            state = self.plant.state()
            assert state.time < longest, "it does not come about"
            self.plant.step(self.supervisor.step(state))

    def is_in(self, state):
        return lambda: self.supervisor.state is state

    @property
    def planning(self):
        return self.supervisor.handover._states.now

    def chunk(self):
        policy = scripted_policy("reach")
        policy.reset()
        chunk = policy.infer(observe(SPEC, self.supervisor, self.plant.state()))
        return replace(chunk, t_obs=self.plant.state().time, seq=0 if self.supervisor._newest is None else 1)

    def accept(self):
        self.supervisor.accept(self.chunk())

    def no_plan(self):
        def fails(*_, **__):
            raise PlanningError("no steps were found")

        self.patch.setattr(self.supervisor.planner, "plan", fails)

    def lose(self):
        """Hands that have given way to the last, for one tick."""
        with self.patch.context() as patch:
            patch.setattr(type(self.supervisor._follower), "trust", 0.0)
            self.supervisor.step(self.plant.state())

    def to(self, state):
        """From the beginning into a state; `NEW` needs nothing."""
        ways = {
            State.HOLDING: [],
            State.FOLLOWING: [self.accept, lambda: self.step(self.is_in(State.FOLLOWING))],
            State.LOWERED: [self.supervisor.lower, lambda: self.step(self.is_in(State.LOWERED))],
            State.LOWERING: [self.supervisor.lower],
            State.RAISING: [self.supervisor.raise_],
            State.RISING: [self.squat, self.walk],
            State.WALKING: [self.walk],
            State.RECOVERING: [self.push, lambda: self.step(self.is_in(State.RECOVERING))],
            State.PLANNING: [self.accept],
            State.READY: [self.accept, lambda: self.step(lambda: self.planning is State.READY)],
        }
        ways[State.STANDING] = [*ways[State.FOLLOWING], self.no_plan, self.lose]
        ways[State.RETURNING] = [*ways[State.STANDING], lambda: self.step(self.is_in(State.RETURNING))]
        ways[State.DESCENDING] = [self.throw]
        ways[State.FALLEN] = [lambda: self.to(State.HOLDING), self.fall]
        if state is State.NEW:
            self.supervisor = Supervisor(SPEC, CONFIG)
            return
        self.put(crouch(SPEC, self.supervisor.robot.model, self.feet()) if state is State.LOWERED else None)
        for one in ways.get(state, []):
            one()
        if state in {*UP, State.DESCENDING}:
            assert self.supervisor.state is state

    def walk(self):
        assert self.supervisor.walk_to(GOAL).reason is Reason.WALKING

    def push(self):
        """A robot whose capture point is 2 cm ahead of its soles: it was pushed; one that walks is as it settles."""
        if self.supervisor.state is State.WALKING:
            walk = self.supervisor._stepping._walker.walk
            self.step(lambda: walk.state is Phase.SETTLE, longest=8.0)
        state = self.plant.state()
        v = state.v.copy()
        v[0] += 0.42
        zero = self.plant.data
        self.plant._conversion.to_mujoco(state.q, v, zero.qpos, zero.qvel)

    def throw(self):
        """A robot that no step catches any more."""
        state = self.plant.state()
        v = state.v.copy()
        v[0] += 1.5
        self.plant._conversion.to_mujoco(state.q, v, self.plant.data.qpos, self.plant.data.qvel)
        self.step(self.is_in(State.DESCENDING), longest=state.time + 0.5)

    def squat(self):
        """Crouch; a plan is followed still, where one was."""
        following = self.supervisor.state is State.FOLLOWING
        self.put(crouch(SPEC, self.supervisor.robot.model, self.feet()))
        if following:
            self.supervisor._states.on(Event.TAKEN_OVER)

    def feet(self):
        self.put()
        return self.supervisor._planted.feet

    def fall(self):
        """Several states of a robot that lies, one a period."""
        state = self.plant.state()
        q = state.q.copy()
        q[2], q[3:7] = 0.1, [1.0, 0.0, 0.0, 0.0]
        for k in range(1, 200):
            self.supervisor.step(replace(state, time=state.time + 0.002 * k, q=q, v=0.0 * state.v))


def reset(loop):
    loop.supervisor.reset(loop.plant.reset())
    assert loop.supervisor.status.reason is Reason.NO_CHUNK


def taken_over(loop):
    loop.patch.undo()
    loop.accept()
    loop.step(lambda: loop.supervisor.plan is not None)
    assert loop.supervisor.chunk is not None
    assert loop.supervisor._reflex._back is None


def lost(loop):
    loop.no_plan()
    loop.lose()
    assert loop.supervisor.plan is None
    assert loop.supervisor.status.reason is Reason.OFF_PLAN


def spent(loop):
    q = spent_waist.postures(Robot(SPEC), 1)[0]
    loop.put(q)
    loop.supervisor._states.on(Event.TAKEN_OVER)
    loop.supervisor._reflex.stand(loop.plant.state(), 0.0)
    assert not loop.supervisor._reflex._back.straight


def no_way(loop):
    loop.no_plan()
    if loop.supervisor.state is State.HOLDING:
        q = loop.plant.state().q.copy()
        q[7 + loop.supervisor.robot.joint_names.index("left_elbow_joint")] += 0.4
        loop.put(q)
        loop.accept()
    elif loop.supervisor.state is State.RETURNING:
        loop.step(loop.is_in(State.STANDING))
    loop.step(loop.is_in(State.RETURNING))
    assert "slowly to its stance" in loop.supervisor.status.detail


def planned_from(loop):
    loop.step(loop.is_in(State.STANDING))
    assert loop.planning is State.PLANNING
    assert loop.supervisor._reflex._back is None


def lower(loop):
    assert loop.supervisor.lower().reason is Reason.LOWERING
    assert loop.supervisor.accept(loop.chunk()).reason is Reason.LOWERING
    assert loop.supervisor.plan is None


def raise_(loop):
    assert loop.supervisor.raise_().reason is Reason.RAISING
    assert loop.supervisor.accept(loop.chunk()).reason is Reason.RAISING


def arrived(loop):
    down = loop.supervisor.state is State.LOWERING
    if down:
        loop.put(crouch(SPEC, loop.supervisor.robot.model, loop.feet()))
        loop.supervisor.lower()
    loop.step(lambda: loop.supervisor.state in (State.LOWERED, State.HOLDING))
    loop.step(lambda: loop.supervisor.lowered == down, longest=3.0)


def walk_low(loop):
    loop.squat()
    loop.walk()
    assert "goes to its stance" in loop.supervisor.status.detail


def walk(loop):
    if loop.supervisor.state is State.RISING:
        loop.step(loop.is_in(State.WALKING), longest=8.0)
    else:
        loop.walk()
    assert loop.supervisor.plan is None
    assert loop.planning is State.IDLE


def pushed(loop):
    loop.push()
    loop.step(loop.is_in(State.RECOVERING), longest=8.0)
    assert loop.supervisor.status.reason is Reason.RECOVERING
    assert loop.supervisor.plan is None


def settled(loop):
    caught = loop.supervisor.state is State.RECOVERING
    loop.step(loop.is_in(State.HOLDING), longest=6.0)
    assert (loop.supervisor.base[0] > 0.05) if caught else (abs(loop.supervisor.base[0] - GOAL[0]) < 0.03)


def lost_for_good(loop):
    loop.throw()
    assert loop.supervisor.status.reason is Reason.DESCENDING


def down(loop):
    loop.step(loop.is_in(State.FALLEN), longest=8.0)
    assert loop.supervisor.status.status is Status.DAMPING


def fell(loop):
    loop.fall()
    assert loop.supervisor.status.status is Status.DAMPING


def asked(loop):
    loop.accept()
    assert loop.supervisor.handover._asked.due == pytest.approx(loop.plant.state().time + LEAD)


def cleared(loop):
    loop.step(lambda: loop.planning is State.READY)
    assert loop.supervisor.plan is None


def refused(loop):
    loop.put()
    loop.no_plan()
    loop.accept()
    loop.step(lambda: loop.planning is State.IDLE)
    assert loop.supervisor.take_refusal().reason is Reason.PLANNING_FAILED


def late(loop):
    loop.supervisor.handover._planner._done += 0.01
    loop.step(lambda: loop.supervisor.handover.late == 1)
    assert loop.supervisor.handover.lead == 2.0 * LEAD
    loop.step(lambda: loop.supervisor.plan is not None)


def due(loop):
    loop.step(lambda: loop.supervisor.plan is not None)


def missed(loop):
    handover = loop.supervisor.handover
    assert handover.take(handover._ready[0].due + WAIT, handover._ready[0].start.s - 0.01, 0.0) is None
    assert handover.take_dropped() is loop.supervisor._newest


def cancelled(loop):
    loop.supervisor.lower()
    loop.step(lambda: loop.supervisor.plan is not None or loop.plant.state().time > 2.0 * LEAD)
    assert loop.supervisor.plan is None


SHOWN = {one.__name__.removesuffix("_"): one for one in (
    reset, taken_over, lost, spent, no_way, planned_from, lower, raise_, arrived, walk_low, walk, pushed, settled,
    lost_for_good, down, fell, asked, cleared, refused, late, due, missed, cancelled,
)}  # fmt: skip


@pytest.fixture(scope="module")
def parts():
    return Supervisor(SPEC, CONFIG), MujocoPlant(SPEC)


@pytest.fixture
def loop(parts, monkeypatch):
    return Loop(*parts, monkeypatch)


@pytest.mark.parametrize(
    ("row", "state"),
    [pytest.param(row, one, id=f"{one.value}-{row.event.name.lower()}") for row in TABLE for one in row.states],
)
def test_the_supervisor_goes_by_the_row(loop, row, state):
    loop.to(state)
    SHOWN[row.event.name.lower()](loop)
    assert (loop.supervisor.state if row.next in {*UP, State.DESCENDING, State.FALLEN} else loop.planning) is row.next


def test_each_move_stands_once_and_every_state_but_the_first_is_reached():
    moves = [(state, row.event) for row in TABLE for state in row.states]
    assert len(moves) == len(set(moves))
    assert {row.next for row in TABLE} == set(State) - {State.NEW}
    assert {row.event for row in TABLE} == set(Event)


def test_what_the_table_does_not_have_moves_nothing():
    machine = Machine(State.FALLEN)
    machine.on(Event.LOWER)
    assert machine.now is State.FALLEN


def names(row: Transition) -> str:
    groups = {UP: "any but descending and fallen", ON_BOTH_FEET: "any but walking, recovering, descending and fallen"}
    said = ", ".join(one.value for one in row.states)
    return "any" if len(row.states) > len(UP) else groups.get(row.states, said)


def drawn() -> str:
    """The table as docs/architecture.md has it: the moves that few states have as arrows, all of them as rows."""
    arrows = [
        f"    {one.value} --> {row.next.value}: {row.event.name.lower().replace('_', ' ')}"
        for row in TABLE
        for one in (row.states if row.states not in (UP, ON_BOTH_FEET) and State.NEW not in row.states else ())
    ]
    rows = [f"| {names(row)} | {row.event.value} | {row.next.value} | {row.does} |" for row in TABLE]
    table = ["| State | Event | Next | What is done |", "|---|---|---|---|", *rows]
    return "\n".join(["```mermaid", "stateDiagram-v2", "    [*] --> holding", *arrows, "```", "", *table])


def test_the_architecture_page_draws_the_table():
    """What is missing there can be pasted from here."""
    text = (Path(__file__).parents[3] / "docs/architecture.md").read_text()
    assert drawn() in text, drawn()
