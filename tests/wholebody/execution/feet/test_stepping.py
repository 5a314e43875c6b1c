"""Strategy: a supervisor that may step is told to walk in MuJoCo: with a chunk in hand, too fast, to be lowered, badly.

It does not fall; hands keep their place about the robot; what it stands on and is planned from is where its feet are.
One that is never told to walk does to the bit what one does that never steps.
"""

import numpy as np
import pytest

from models import g1
from policy.scripted.library import scripted_policy
from tests.support.felt import Felt
from tests.support.steps import held, is_in, run
from tests.support.wide import wide
from wholebody.config import ControllerConfig, RobotConfig
from wholebody.episode.run import EpisodeConfig, followed, observe, run_episode
from wholebody.errors import ConfigError, InputError
from wholebody.execution.feet import wanted
from wholebody.execution.feet.stepping import LASTS
from wholebody.execution.feet.walker import Walker
from wholebody.execution.states import State
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.limit_monitor import LimitMonitor
from wholebody.sim.pictures.scene import scene_at
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.recorder import Recorder
from wholebody.types import Reason
from wholebody.walking.gait import Phase

SPEC, CONFIG = g1(), ControllerConfig(steps="reach")


@pytest.fixture(scope="module")
def supervisor():
    return Supervisor(SPEC, CONFIG)


@pytest.fixture
def plant(supervisor):
    plant = MujocoPlant(SPEC)
    supervisor.reset(plant.reset())
    return plant


def reaching(supervisor, plant):
    policy = scripted_policy("reach")
    policy.reset()
    chunk = policy.infer(observe(SPEC, supervisor, plant.state()))
    supervisor.accept(chunk)
    return chunk


def palms(supervisor, plant):
    """Distance of the worse palm from its command [m]."""
    robot, state = supervisor.robot, plant.state()
    robot.place(state.q, state.v)
    commanded = supervisor.palm_reference()
    return max(
        np.linalg.norm(robot.pose(tool.palm_frame).translation - commanded[tool.side][:3, 3]) for tool in SPEC.tools
    )


def test_it_walks_to_a_base_with_what_its_hands_did_carried_along(supervisor, plant):
    reaching(supervisor, plant)
    run(supervisor, plant, lambda: supervisor.state is State.FOLLOWING and plant.state().time > 1.0, 2.0)
    assert supervisor.walk_to((0.25, 0.1, 0.3)).reason is Reason.WALKING
    off, lifted, here = [], set(), supervisor.palm_reference()["left"]

    def look():
        off.append(palms(supervisor, plant))
        lifted.add(supervisor.contacts.at(0.0).stands)
        assert supervisor.status.reason in (Reason.WALKING, None, Reason.STARVED, Reason.NO_CHUNK)

    run(supervisor, plant, is_in(supervisor, State.HOLDING), 8.0, look)
    assert lifted == {(True, True), (True, False), (False, True)}
    x, y, heading = supervisor.base
    assert np.hypot(x - 0.25, y - 0.1) < 0.03
    assert abs(heading - 0.3) < 0.06
    assert np.hypot(*(plant.soles()[:, :2].mean(axis=0) - (x, y))) < 2e-3
    assert np.sqrt(np.mean(np.square(off))) < 2e-3
    there = supervisor.palm_reference()["left"]
    moved = there[:2, 3] - here[:2, 3]
    assert np.hypot(*moved) > 0.1
    assert there[2, 3] == pytest.approx(here[2, 3], abs=0.05)  # it comes to rest on its way down
    run(supervisor, plant, is_in(supervisor, State.FOLLOWING), 9.0)
    end = plant.state().time + 2.0
    run(supervisor, plant, lambda: plant.state().time > end, 12.0)
    assert palms(supervisor, plant) < 2e-3
    assert np.allclose(supervisor.palm_reference()["left"][:3, 3], there[:3, 3], atol=0.02)


def test_a_chunk_that_comes_while_it_walks_is_followed_once_it_stands(supervisor, plant):
    supervisor.walk_to((0.1, 0.0, 0.0))
    run(supervisor, plant, lambda: plant.state().time > 2.0, 3.0)
    chunk = reaching(supervisor, plant)
    assert supervisor.chunk is None
    run(supervisor, plant, lambda: supervisor.chunk is not None, 8.0)
    assert supervisor.chunk.seq == chunk.seq
    assert supervisor.state is State.FOLLOWING


@pytest.mark.parametrize(
    ("told", "index", "most"), [((3.0, 0.0, 0.0), 0, wanted.FASTEST[1]), ((0.0, 3.0, 0.0), 1, wanted.FASTEST[2])]
)
def test_a_velocity_keeps_its_direction(supervisor, plant, told, index, most):
    way = wanted.velocity(told).way
    assert (way.real, way.imag)[index] == pytest.approx(most)
    assert (way.real, way.imag)[1 - index] == 0.0


def test_a_state_that_comes_twice_while_it_walks_changes_nothing(supervisor, plant):
    """No time had passed, and velocities were divided by it."""
    supervisor.walk((0.2, 0.0, 0.0))
    seen = set()

    def again():
        seen.add(supervisor._stepping._walker.walk.state)
        if plant.state().time * 10.0 % 1.0 < 0.02:
            supervisor.step(plant.state())

    run(supervisor, plant, is_in(supervisor, State.HOLDING), 7.0, again)
    assert {Phase.SHIFT, Phase.SWING, Phase.SETTLE} <= seen


def test_a_robot_whose_hand_is_pulled_does_not_walk(supervisor, plant):
    """It leant against 12 N as it had stood, and fell on its second step."""
    Felt(plant, pull=("right", lambda t, q: np.array([0.0, 12.0 * min(max(t - 0.3, 0.0) / 0.3, 1.0), 0.0])))
    run(supervisor, plant, lambda: plant.state().time > 1.0, 1.1)
    assert supervisor.touch.active
    report = supervisor.walk_to((0.8, 0.0, 0.0))
    assert report.reason is Reason.WALK_REFUSED
    assert "let go of" in report.detail
    supervisor.accept(held(0.8, 0.8, plant.state().time))
    run(supervisor, plant, lambda: plant.state().time > 3.0, 3.1)
    assert supervisor.state in (State.HOLDING, State.FOLLOWING)


def test_a_velocity_is_scaled_to_what_it_can_do_and_forgotten_after_a_second(supervisor, plant):
    assert supervisor.walk((3.0, 0.0, 0.0)).reason is Reason.WALKING
    fastest = []

    def look():
        guide = supervisor._stepping._walker.walk.guide
        fastest.append(guide.velocity.way.real)

    run(supervisor, plant, is_in(supervisor, State.HOLDING), 7.0, look)
    assert 0.1 < max(fastest) <= wanted.FASTEST[1]
    assert supervisor._stepping._until == -np.inf
    assert plant.state().time > LASTS
    assert supervisor.base[0] > 0.03


@pytest.mark.parametrize(
    ("command", "given", "said"),
    [
        ("walk_to", (np.nan, 0.0, 0.0), "finite x, y"),
        ("walk_to", (1.0, 0.0), "finite x, y"),
        ("walk_to", (50.0, 0.0, 0.0), "50.0 m away; the robot walks 10 m at most"),
        ("walk", (np.inf, 0.0, 0.0), "finite speeds"),
        ("walk", (0.1, 0.0, 0.0, 0.0), "finite speeds"),
    ],
)
def test_bad_commands_are_refused_and_change_nothing(supervisor, plant, command, given, said):
    report = getattr(supervisor, command)(given)
    assert report.reason is Reason.WALK_REFUSED
    assert said in report.detail
    assert supervisor.state is State.HOLDING


@pytest.mark.parametrize("given", ["here", (1.0, None, [2.0]), (0.0, 10**400, 0.0), object(), b"x"])
@pytest.mark.parametrize("command", ["walk_to", "walk"])
def test_what_is_no_numbers_is_a_mistake_of_whoever_calls(supervisor, command, given):
    with pytest.raises(InputError, match="are expected"):
        getattr(supervisor, command)(given)
    assert supervisor.state is State.HOLDING


def test_a_robot_that_is_there_already_does_not_step(supervisor, plant):
    assert supervisor.walk_to((0.02, 0.0, 0.0)).reason is Reason.NO_CHUNK
    assert supervisor.walk((0.0, 0.0, 0.0)).reason is Reason.NO_CHUNK
    assert supervisor.state is State.HOLDING


@pytest.mark.parametrize("impulse", [-12.0, *wide(-14.0, -10.0, -8.0, 10.0, 12.0, 14.0)])
def test_one_that_is_pushed_as_it_settles_takes_a_step(supervisor, plant, impulse):
    """It fell of each of these, since a walk whose last step is made waits for the capture point to come to rest."""
    state, pushed, steps = plant.state(), None, False
    while state.time < (8.0 if pushed is None else pushed + 6.0):  # the feet are closed by then
        if state.time < 1.5:
            supervisor.walk((0.2, 0.0, 0.0))
        if pushed is None and state.time > 1.5 and supervisor._stepping._walker.walk.state is Phase.SETTLE:
            pushed = state.time
            plant.push("torso_link", np.array([10.0 * impulse, 0.0, 0.0]), start=pushed, duration=0.1)
        state = plant.step(supervisor.step(state))
        steps |= supervisor.status.reason is Reason.RECOVERING
    assert steps
    assert supervisor.state in (State.HOLDING, State.FOLLOWING)


def test_one_that_crouches_or_never_steps_is_not_led(supervisor, plant):
    supervisor.lower()
    assert "is lowering" in supervisor.walk_to((0.3, 0.0, 0.0)).detail
    never = Supervisor(SPEC)
    never.reset(plant.state())
    report = never.walk((0.1, 0.0, 0.0))
    assert report.reason is Reason.WALK_REFUSED
    assert "with `steps: reach`" in report.detail


def test_one_that_walks_stands_before_it_is_lowered(supervisor, plant):
    supervisor.walk((0.2, 0.0, 0.0))
    run(supervisor, plant, lambda: plant.state().time > 1.0, 2.0)
    supervisor.lower()
    assert supervisor.state is State.WALKING
    assert "is walking" in supervisor.walk((0.2, 0.0, 0.0)).detail
    run(supervisor, plant, is_in(supervisor, State.LOWERED), 16.0)


def test_blind_it_comes_to_a_stand(supervisor, plant):
    supervisor.walk_to((1.0, 0.0, 0.0))
    run(supervisor, plant, lambda: plant.state().time > 1.5, 2.0)
    last = plant.state()
    while plant.state().time < 1.75:
        supervisor.step(last, plant.state().time)
        plant.step(supervisor.controller.command)
    run(supervisor, plant, is_in(supervisor, State.HOLDING), 8.0)
    assert supervisor.base[0] < 0.6


def test_an_episode_after_a_fall_while_walking_begins_as_any(supervisor, plant):
    supervisor.walk((0.2, 0.0, 0.0))
    run(supervisor, plant, lambda: not all(supervisor.contacts.at(0.0).stands), 2.0)
    supervisor.reset(MujocoPlant(SPEC).reset())
    assert supervisor.state is State.HOLDING
    assert supervisor.controller.balance.active
    assert all(supervisor.controller.contacts.stands)
    fresh = Supervisor(SPEC).controller
    assert np.array_equal(supervisor.controller.tasks.com.weight, fresh.tasks.com.weight)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"steps": "sometimes"}, "never, recover, reach"),
        ({"steps": "reach", "backend": "kinematic", "solver": "daqp"}, "native backend"),
        ({"steps": "reach", "robot": RobotConfig(torque=0.5)}, "robot.torque 1"),
    ],
)
def test_settings_that_do_not_walk_are_refused(settings, said):
    supervisor = Supervisor(SPEC, ControllerConfig(**settings))
    with pytest.raises(ConfigError, match=said):
        supervisor.reset(MujocoPlant(SPEC).reset())


class Commands:
    """A recorder that keeps what was commanded."""

    def __init__(self):
        self.rows = []

    def begin(self, *_):
        pass

    def add(self, state, command, *_):
        self.rows.append(np.concatenate([state.q, command.q, command.dq, command.tau]))


def test_one_that_is_not_told_to_walk_does_what_one_does_that_never_steps():
    found = []
    for config in (ControllerConfig(), CONFIG):
        kept = Commands()
        run_episode(
            scripted_policy("reach"),
            Supervisor(SPEC, config),
            MujocoPlant(SPEC),
            duration=1.5,
            config=EpisodeConfig(hold=0.5),
            recorder=kept,
        )
        found.append(np.array(kept.rows))
    assert np.array_equal(*found)


def test_a_walker_that_walks_again_begins_from_there(supervisor, plant):
    """What a first walk left behind, such as the height of its stand, is not that of the second."""
    walker = Walker(supervisor.controller)
    walker.begin(plant.state())
    first = walker._standing_height
    state = plant.state()
    state.q[2] -= 0.1
    walker.begin(state)
    assert walker._standing_height == pytest.approx(first - 0.1)


def test_pressure_of_a_walk_lies_in_the_soles_that_touch(supervisor, plant):
    """It was 51 mm outside of those that stand by the schedule, as a foot landed early, and 0.45 m of the first."""
    monitor, recorder = LimitMonitor(plant), Recorder(SPEC, "floor", CONFIG)
    recorder.begin((False, False))
    supervisor.walk_to((0.4, 0.0, 0.0))

    def look():
        state = plant.state()
        monitor.look(state.time, supervisor.contacts)
        recorder.add(state, supervisor.controller.command, followed(supervisor, state.time), plant)

    run(supervisor, plant, is_in(supervisor, State.HOLDING), 9.0, look)
    margins = recorder.record()["pressure_margin"]
    assert monitor.margin > -2e-3
    assert np.nanmin(margins) > -2e-3
    support = scene_at(recorder.record(), len(margins) - 1).support
    np.testing.assert_allclose(support.vertices.mean(axis=0), plant.contact_points()[:, :2].mean(axis=0), atol=0.02)
