"""Strategy: a page that sends what no slider would, and a robot that takes note of what it is told."""

from types import SimpleNamespace

import numpy as np
import pytest

from models import g1
from policy.executor.executor import ExecutorConfig
from policy.scripted.library import scripted_policy
from policy.targets.dragged_hands import DraggedHands
from wholebody.config import ControllerConfig
from wholebody.execution.statuses import NO_CHUNK
from wholebody.execution.supervisor import Supervisor
from wholebody.live.person import BOUNDS, Person
from wholebody.live.snapshot import UserCommand
from wholebody.sim.plant import MujocoPlant

POSES = np.tile(np.eye(4), (2, 1, 1))


class Page:
    def __init__(self):
        self.sent, self.alive = [], True

    def wishes(self):
        sent, self.sent = self.sent, []
        yield from sent

    def show(self, glance):
        """Not looked at."""


class Clock:
    def now(self):
        return 0.0


@pytest.fixture
def person():
    supervisor = SimpleNamespace(
        palm_reference=lambda: {"left": np.eye(4), "right": np.eye(4)},
        status=NO_CHUNK,
        config=SimpleNamespace(planning=SimpleNamespace(lead=0.1)),
    )
    loop = SimpleNamespace(stopped=False, executor=None, clock=Clock(), task="", supervisor=supervisor, spec=g1())
    orders = []
    robot = SimpleNamespace(order=orders.append, orders=orders)
    sources = {"wave": scripted_policy("wave"), "hands": DraggedHands()}
    person = Person(Page(), loop, robot, sources, ExecutorConfig(), [])
    person.test = SimpleNamespace(page=person._page, loop=loop, robot=robot, sources=sources)
    person.asking(True)
    person._shown = np.inf
    yield person
    person.asking(False)


def wish(person, what, *numbers):
    person.test.page.sent.append((what, np.array(numbers, dtype=float)))
    person.look(0.0)


@pytest.mark.parametrize(
    "what",
    [
        UserCommand.PUSH,
        UserCommand.PAYLOAD,
        UserCommand.FRICTION,
        UserCommand.LATENCY,
        UserCommand.SOURCE,
        UserCommand.TARGETS,
    ],
)
@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_not_done(person, what, number):
    wish(person, what, *[number] * 32)
    assert person.test.robot.orders == []
    assert person.test.loop.executor.policy is person.test.sources["wave"]


@pytest.mark.parametrize("what", [UserCommand.PUSH, UserCommand.PAYLOAD, UserCommand.FRICTION])
def test_what_is_beyond_the_bounds_is_done_at_the_bound(person, what):
    wish(person, what, 1e300, -1e300)
    (order,) = person.test.robot.orders
    assert order.what == what.name.lower()
    assert order.numbers == BOUNDS[what][::-1]


def test_no_page_can_do_more_to_the_robot_than_a_person_could(person):
    """What a push, a mass and friction may be at most is said here once more: [N], [kg], [1]."""
    for what, most in ((UserCommand.PUSH, 500.0), (UserCommand.PAYLOAD, 10.0), (UserCommand.FRICTION, 2.0)):
        wish(person, what, 1e300)
        assert person.test.robot.orders[-1].numbers == (most,)


def test_a_source_that_there_is_not_is_the_last_one(person):
    wish(person, UserCommand.SOURCE, 1e9)
    assert person.test.loop.executor.policy is person.test.sources["hands"]


def test_dragging_takes_the_hands_over_whatever_ran(person):
    wish(person, UserCommand.TARGETS, *POSES.ravel())
    hands = person.test.sources["hands"]
    assert person.test.loop.executor.policy is hands
    np.testing.assert_array_equal(hands.targets, POSES)


def test_a_drag_is_acted_on_at_once_and_a_stream_of_them_ten_times_a_second(person):
    asked = []
    wish(person, UserCommand.TARGETS, *POSES.ravel())
    person.test.loop.executor = SimpleNamespace(hasten=lambda: asked.append(now), close=lambda: None)
    for k in range(40):
        now = 1.0 + k * 0.01
        person.test.page.sent.append((UserCommand.TARGETS, POSES.ravel()))
        person.look(now)
    assert asked == pytest.approx([1.0, 1.1, 1.2, 1.3], abs=0.02)


def test_a_pose_that_is_none_is_not_gone_to(person):
    wish(person, UserCommand.TARGETS, *(2.0 * POSES).ravel())
    assert person.test.sources["hands"].targets is None


def test_the_latency_of_the_policy_is_that_of_the_next_source_too(person):
    wish(person, UserCommand.LATENCY, 0.2)
    assert person.test.loop.executor.worker.latency == 0.2
    wish(person, UserCommand.SOURCE, 1)
    assert person.test.loop.executor.worker.latency == 0.2


@pytest.mark.parametrize("how", ["page", "interrupt"])
def test_a_pause_ends_with_the_page_and_with_an_interrupt(person, how):
    person.test.page.alive, person.test.loop.stopped = how != "page", how == "interrupt"
    person.test.robot.origin, person.test.loop.lateness = 0.0, SimpleNamespace(pause=lambda: None)
    wish(person, UserCommand.PAUSE, 1.0)
    assert [order.what for order in person.test.robot.orders] == ["pause", "resume"]
    assert person.test.robot.origin >= 0.0


def test_a_robot_that_is_sent_somewhere_goes_there_and_its_hands_are_dragged_from_there_on(person):
    """Other sources, and hands where they were dragged to before, would have it walk back."""
    supervisor, plant = Supervisor(g1(), ControllerConfig(steps="reach")), MujocoPlant(g1())
    state = plant.reset()
    supervisor.reset(state)
    person.test.loop.supervisor = supervisor
    wish(person, UserCommand.WALK, 0.15, 0.05, 0.3)
    person.asking(True)
    while person.test.loop.executor is None and state.time < 6.0:
        state = plant.step(supervisor.step(state))
        person.asking(True)
    assert state.time > 1.0
    assert supervisor.base == pytest.approx((0.15, 0.05, 0.3), abs=0.06)
    assert person.test.loop.executor.policy is person.test.sources["hands"]


def test_a_robot_that_may_not_walk_says_so_and_its_source_goes_on(person, caplog):
    supervisor = Supervisor(g1())
    supervisor.reset(MujocoPlant(g1()).reset())
    person.test.loop.supervisor = supervisor
    wish(person, UserCommand.WALK, 0.2, 0.0, 0.0)
    assert "with `steps: reach` the robot walks" in caplog.text
    assert person.test.loop.executor.policy is person.test.sources["wave"]
