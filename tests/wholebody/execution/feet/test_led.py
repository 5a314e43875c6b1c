"""Strategy: policies of each layout that has a base velocity say one, in their own numbers, and are followed in MuJoCo.

The base goes as it is told, hands stay in the frame of the layout, and the verdict is that of any other chunk. Where
no step is allowed, or none is safe, it is said that the velocity is not followed.
"""

from dataclasses import replace

import numpy as np
import pytest

from policy.action_spec.anchor import Anchor
from policy.remote.wire import chunk_from_map, chunk_to_map
from tests.support.walked_chunks import LAYOUTS, ROOM, SPEC, Walks
from tests.support.wide import wide
from wholebody.config import ControllerConfig
from wholebody.episode.run import EpisodeConfig, observe, run_episode
from wholebody.execution.feet import led, wanted
from wholebody.execution.states import State
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Reason, Status
from wholebody.verdict.verdict import verdict_of

CONFIG, SHORT = ControllerConfig(steps="reach"), EpisodeConfig(settle=0.3, hold=0.5)


@pytest.fixture(scope="module")
def supervisor():
    return Supervisor(SPEC, CONFIG)


@pytest.fixture
def plant():
    return MujocoPlant(SPEC)


def run(policy, supervisor, plant, duration):
    result = run_episode(policy, supervisor, plant, duration=duration, config=SHORT)
    assert result.fall is None
    return result, verdict_of("led", result)


@pytest.mark.parametrize(
    ("layout", "velocity"),
    [
        ("wbc27", (0.25, 0.0, 0.0)),
        ("gr00t_g1", (0.0, 0.12, 0.3)),
        *wide(("openhlm34", (0.0, 0.0, 0.4)), ("in_the_room", (-0.08, 0.0, 0.0))),
    ],
)
def test_a_base_velocity_is_walked_with_hands_in_the_frame_of_the_layout(supervisor, plant, layout, velocity):
    policy = Walks(LAYOUTS[layout], velocity, until=9.0, sway=0.06)
    supervisor.config, begin = CONFIG, plant.soles()[:, :2].mean(axis=0)
    result, verdict = run(policy, supervisor, plant, 2.5)
    assert supervisor.state is State.WALKING
    guide = supervisor._stepping._walker.walk.guide
    told = np.array([guide.velocity.way.real, guide.velocity.way.imag, guide.velocity.turn])
    np.testing.assert_allclose(told, velocity, atol=1e-9)
    assert np.hypot(*(plant.soles()[:, :2].mean(axis=0) - begin)) > 0.05 * (layout != "openhlm34")
    # The pelvis goes down by 4 cm as it begins to walk, and what is given in it from one chunk to the next.
    assert np.sqrt(np.mean(result.palms.errors**2)) < 1e-2
    assert np.sqrt(np.mean(result.palms.errors[-25:] ** 2)) < 3e-3
    assert np.sqrt(np.mean(result.palms.lags**2)) < 2e-3
    assert not [note for note in result.notes if "base_velocity" in note.text]
    assert verdict.verdict in ("feasible", "feasible_after_repair")
    assert len(verdict.steps) >= 2
    assert {one.foot for one in verdict.steps} == {"left", "right"}
    assert result.seconds.get("hold", 0.0) < 1.0  # nothing but the time before the first chunk


def test_hands_in_the_room_stay_there(supervisor, plant):
    before = None

    def look(policy):
        nonlocal before
        before = supervisor.palm_reference()["left"].copy() if before is None else before

    supervisor.reset(plant.reset())
    look(None)
    run(Walks(ROOM, (0.08, 0.0, 0.0), until=9.0), supervisor, plant, 3.0)
    assert supervisor.base[0] > 0.08
    np.testing.assert_allclose(supervisor.palm_reference()["left"], before, atol=2e-3)


def test_it_comes_to_a_stand_when_the_policy_says_so_and_plans_again(supervisor, plant):
    policy = Walks(LAYOUTS["wbc27"], (0.2, 0.0, 0.0), until=1.0, sway=0.05)
    result, _ = run(policy, supervisor, plant, 6.0)
    assert supervisor.state is State.FOLLOWING
    assert Reason.WALK_REFUSED not in result.reasons
    assert np.sqrt(np.mean(result.palms.lags**2)) < 2e-3


def test_a_velocity_that_begins_later_is_walked_when_it_is_due(supervisor, plant):
    supervisor.reset(plant.reset())
    policy = Walks(LAYOUTS["wbc27"], (0.2, 0.0, 0.0), until=9.0)
    chunk = policy.infer(observe(SPEC, supervisor, plant.state()))
    chunk.base_velocity[:30] = 0.0
    supervisor.accept(chunk)
    begun = None
    while plant.state().time < 1.3:
        plant.step(supervisor.step(plant.state()))
        if begun is None and supervisor.state is State.WALKING:
            begun = plant.state().time
    assert begun == pytest.approx(1.0, abs=0.01)


def test_where_no_step_is_taken_the_verdict_says_so(plant):
    never = Supervisor(SPEC, ControllerConfig())
    result, verdict = run(Walks(LAYOUTS["wbc27"], (0.25, 0.0, 0.0), until=9.0), never, plant, 0.7)
    assert verdict.verdict == "feasible_after_repair"
    assert verdict.violations[0].code is Reason.CHANGED_NUMBERS
    assert any("is not followed: the feet stay" in note.text for note in result.notes)
    assert verdict.steps == []


def test_what_a_gate_judges_is_planned_for_a_stand(plant):
    gated = Supervisor(SPEC, CONFIG, gate=lambda request, plan: None)
    run(Walks(LAYOUTS["wbc27"], (0.25, 0.0, 0.0), until=9.0), gated, plant, 0.7)
    assert gated.state in (State.HOLDING, State.FOLLOWING)
    assert not gated.walks


def chunk_of(layout, velocity, supervisor, plant):
    supervisor.reset(plant.reset())
    return Walks(LAYOUTS[layout], velocity, until=9.0).infer(observe(SPEC, supervisor, plant.state()))


def test_a_velocity_beyond_what_is_walked_is_said_and_scaled(supervisor, plant):
    chunk = chunk_of("wbc27", (0.9, 0.0, 0.1), supervisor, plant)
    (note,) = (text for text in led.notes(chunk, walked=True) if "base_velocity" in text)
    assert "is not followed: the robot walks slower" in note
    assert supervisor.accept(chunk).status is Status.TRACKING
    told = supervisor._stepping._wanted
    assert told.way.real / told.turn == pytest.approx(9.0)
    assert np.hypot(told.way.real / wanted.FASTEST[1], told.turn / wanted.FASTEST[3]) == pytest.approx(1.0)


def test_a_base_that_scatters_about_rest_is_not_walked(supervisor, plant):
    chunk = chunk_of("wbc27", (0.02, -0.03, 0.04), supervisor, plant)
    supervisor.accept(chunk)
    assert not supervisor.walks
    assert supervisor.state is not State.WALKING


@pytest.mark.parametrize("hands_in", ["pelvis", "pelvis_yaw", "torso", "stance", "soles", "world"])
def test_a_chunk_seen_from_a_base_at_rest_is_where_it_was(supervisor, plant, hands_in):
    """Sway, tilt and lift are taken out of poses, and a robot that stands has none."""
    chunk = replace(chunk_of("wbc27", (0.2, 0.0, 0.0), supervisor, plant), hands_in=hands_in)
    supervisor.accept(chunk)
    moved = supervisor._stepping.led.carried(supervisor._stepping._walker.base)
    np.testing.assert_allclose(moved.T_world_lhand, chunk.T_world_lhand, atol=2e-3)


def test_the_frame_of_the_hands_goes_over_the_wire(supervisor, plant):
    chunks = {name: chunk_of(name, (0.0, 0.0, 0.2), supervisor, plant) for name in LAYOUTS}
    frames = {name: chunk.hands_in for name, chunk in chunks.items()}
    assert frames == {"wbc27": "pelvis", "gr00t_g1": "pelvis", "openhlm34": "soles", "in_the_room": "world"}
    assert {name: chunk_from_map(chunk_to_map(chunk)).hands_in for name, chunk in chunks.items()} == frames


def test_a_log_has_the_state_of_a_time_and_the_first_before_that():
    log = led.StateLog(0.5)
    assert log.at(0.0) is None
    log.begin(1.0, np.zeros(3))
    log.add(2.0, np.ones(3))
    assert log.at(0.0)[0] == log.at(1.9)[0] == 0.0
    assert log.at(2.0)[0] == 1.0


def test_an_anchor_is_that_of_an_observation(supervisor, plant):
    supervisor.reset(plant.reset())
    state = plant.state()
    ours, theirs = supervisor._stepping._anchor(state.q), Anchor.measured(observe(SPEC, supervisor, state))
    np.testing.assert_allclose(ours.T_world_base, theirs.T_world_base, atol=1e-12)
    np.testing.assert_array_equal(ours.q_body, theirs.q_body)
