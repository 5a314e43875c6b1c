"""Strategy: robots in MuJoCo push against furniture; what they feel is held against MuJoCo's own contact forces.

The studies (`python -m tests.studies.touch`) have the many cases, `make regression` one a direction; here are two,
and what must hold by itself: the formula of the force that tips, an estimate that is right, no touch in free space.
"""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from policy.action_spec.builtin import builtin
from policy.errors import ChunkError
from policy.scripted.contact import touch, wipe
from policy.scripted.library import lissajous, scripted_policy
from policy.scripted.policy import stance_pose, to_chunk
from tests.support.felt import Felt, Run, robot_in
from tests.support.wide import wide
from wholebody.config import ControllerConfig
from wholebody.config.touch import TouchConfig
from wholebody.control.asked_forces import STIFFEST
from wholebody.control.touch import GRAVITY
from wholebody.episode.run import EpisodeConfig, observe, run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.touch import AXIS_MAX, STIFFNESS, stretched
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Reason, Status

SPEC = g1()


@pytest.fixture(scope="module")
def supervisor():
    found = Supervisor(SPEC)
    found.reset(MujocoPlant(SPEC).state())
    return found


@pytest.mark.parametrize("direction", ["down", *wide("ahead", "side", "up")])
def test_hands_that_are_sent_into_furniture_push_within_their_limit_and_come_back(direction):
    """They fell, but for 5 mm: nothing bounded the force, and a touch was `off_plan`."""
    scenes = {"down": "table", "ahead": "wall", "side": "corridor", "up": "shelf"}
    run = Run(touch(direction=direction, hands="both", speed=0.15, depth=0.06), scenes[direction])
    assert run.result.fall is None
    felt = run.sizes.max(axis=1)
    first = run.times[np.argmax(felt > 10.0)]
    found = run.felt.column(4).any(axis=1)
    assert 0.0 <= run.times[np.argmax(found)] - first + 0.002 <= 0.03
    assert felt[run.times > first + 0.3].max() <= 1.1 * ControllerConfig().touch.force_max
    assert run.errors[-1].max() < 1e-3
    assert run.told()["off_plan_s"] == 0.0


@pytest.mark.parametrize("duration", [11.7, *wide(None)], ids=["in", "and out"])
def test_a_hand_that_is_sent_far_into_a_wall_stays_where_it_met_it(duration):
    """Plans kept it out along its push with friction, and made more friction by that: it wandered off, and fell."""
    way = touch(direction="ahead", hands="right", speed=0.071, depth=0.19, along=(0.016, 0.133), fist=True)
    run = Run(way, "wall", hold=0.0 if duration else 2.0, duration=duration)
    assert run.result.fall is None
    assert run.sizes.max() <= 1.1 * ControllerConfig().touch.force_max
    met = run.palms[np.argmax(run.sizes[:, 1] > 10.0), 1]
    assert np.linalg.norm((run.palms[run.sizes[:, 1] > 10.0, 1] - met)[:, 1:], axis=1).max() < 0.02
    assert run.told()["off_plan_s"] == 0.0


def test_a_force_on_a_palm_is_felt_as_it_is_and_yielded_to_above_the_limit(supervisor):
    plant = MujocoPlant(SPEC)
    state = plant.state()
    supervisor.reset(state)
    force = np.array([-15.0, 8.0, 12.0])
    tool = SPEC.tools[0]
    body = plant.model.body(tool.wrist_frame).id
    for _ in range(500):
        at = plant.data.site(tool.palm_frame).xpos - plant.data.xipos[body]
        plant.data.xfrc_applied[body] = [*force, *np.cross(at, force)]
        state = plant.step(supervisor.step(state))
    np.testing.assert_allclose(supervisor.touch.forces[0], force, atol=0.5)
    assert supervisor.touch.shares == [1.0, 0.0]
    assert supervisor.touch.since[0] == pytest.approx(0.03, abs=0.03)
    status = supervisor.touch.status(supervisor.status.__class__(Status.TRACKING))
    assert (status.reason, status.status) == (Reason.TOUCHING, Status.SLOWED)
    assert status.detail.startswith("the left hand pushes with 21 N since 0.0")


def test_a_hand_that_sinks_under_a_load_is_held_back_by_nothing(supervisor):
    """Plans were to keep it out of the load that it sank under: one from where it sank to, and 0.8 s later off it."""
    plant = MujocoPlant(SPEC, payload_kg=(3.0, 0.0))
    state, touched = plant.state(), []
    supervisor.reset(state)
    for _ in range(100):
        state = plant.step(supervisor.step(state))
        touched.append(supervisor.touch.shares[0])
        assert not supervisor.touch.changed
    assert max(touched) == 1.0
    assert supervisor.touch.met() == (None, None)


def test_the_force_that_tips_puts_the_centre_of_pressure_at_the_edge(supervisor):
    rng = np.random.default_rng(0)
    controller = supervisor.controller
    com, weight, support = controller.robot.com, GRAVITY * controller.robot.mass, controller.balance.support
    for _ in range(200):
        palm, u = rng.uniform([0.1, -0.4, 0.3], [0.6, 0.4, 1.5]), rng.normal(size=3)
        u /= np.linalg.norm(u)
        f = supervisor.touch.tipping_force(palm, u) * u
        pressure = (weight * com[:2] + palm[2] * f[:2] - f[2] * palm[:2]) / (weight - f[2])
        room = support.offsets - support.normals @ pressure
        assert room.min() == pytest.approx(0.0, abs=1e-9) or np.linalg.norm(f) == pytest.approx(weight)


@pytest.mark.parametrize("seed", [*wide(None), 2])
def test_nothing_is_touched_in_free_space(seed):
    """Realistic arms have friction and masses that the model lacks."""
    supervisor, policy, touched = Supervisor(SPEC), lissajous(scored=2.0), []
    plant, sensors = robot_in("floor", seed)
    step = plant.step

    def watched(command):
        touched.append(supervisor.touch.active)
        return step(command)

    plant.step = watched
    run_episode(policy, supervisor, plant, duration=policy.duration, config=EpisodeConfig(hold=0.5), sensors=sensors)
    assert not any(touched)


def test_a_hand_that_is_told_of_a_force_pushes_with_it(supervisor):
    """Told 12 N by a chunk that leads it a little further in, and rests there."""
    from_stance = stance_pose()
    steps = 60
    way = np.minimum(np.arange(steps) / 40.0, 1.0)[:, None]
    push = np.array([0.0, 0.0, 12.0])
    motion = replace(
        from_stance,
        p_world_lpalm=from_stance.p_world_lpalm + way * (np.array([0.36, 0.2, 0.785]) - from_stance.p_world_lpalm),
        p_world_rpalm=np.tile(from_stance.p_world_rpalm, (steps, 1)),
        f_world_lpalm=push,
    )
    plant, sup = MujocoPlant(SPEC, scene="table"), Supervisor(SPEC)
    state = plant.state()
    sup.reset(state)
    chunk = to_chunk(motion, builtin("wbc32").id, 0, 0.0, 15.0, steps)
    chunk.validate()
    np.testing.assert_array_equal(chunk.f_world_lpalm, np.tile(push, (steps, 1)))
    assert chunk.f_world_rpalm is None
    sup.accept(chunk)
    felt = []
    while state.time < 3.9:
        state = plant.step(sup.step(state))
        felt.append(sup.touch.forces[0, 2])
    assert np.median(felt[-200:]) == pytest.approx(12.0, abs=0.5)


def test_forces_limits_and_stiffness_of_a_chunk_are_checked():
    chunk = scripted_policy("wave").infer(observe(SPEC, *standing()))
    with pytest.raises(ChunkError, match=r"f_world_lpalm has shape \(3,\)"):
        replace(chunk, f_world_lpalm=np.zeros(3)).validate()
    with pytest.raises(ChunkError, match="force_max is -1; it must not be negative"):
        replace(chunk, force_max=np.full((len(chunk), 2), -1.0)).validate()
    with pytest.raises(ChunkError, match="stiffness is nan at step 0"):
        replace(chunk, stiffness=np.full((len(chunk), 2), np.nan)).validate()
    replace(chunk, force_max=np.full((len(chunk), 2, 3), 9.0)).validate()
    with pytest.raises(ChunkError, match=r"stiffness has shape \(\d+, 2, 2\); \(\d+, 2, 3\) is expected"):
        replace(chunk, stiffness=np.full((len(chunk), 2, 2), 9.0)).validate()
    with pytest.raises(ChunkError, match="force_max is -2; it must not be negative"):
        replace(chunk, force_max=np.full((len(chunk), 2, 3), -2.0)).validate()


def standing():
    """A supervisor, and the state that it stands in."""
    found, state = Supervisor(SPEC), MujocoPlant(SPEC).state()
    found.reset(state)
    return found, state


@pytest.mark.parametrize(("palm", "ends"), [((0.5, 0.0, 0.0), 2.0), ((0.4, 0.0, 0.0), -6.0), ((0.47, 0.0, 0.0), -0.4)])
def test_an_arm_ends_where_it_is_nearly_straight_along_what_draws_it(palm, ends):
    shoulder, palm = np.zeros(3), np.array(palm)
    aside = np.sqrt(max(0.25**2 - (0.5 * palm[0]) ** 2, 0.0))
    elbow = np.array([0.5 * palm[0], aside, 0.0])
    assert stretched(shoulder, elbow, palm, palm) == pytest.approx(ends)
    assert stretched(shoulder, elbow, palm, -palm) == 0.0


def test_the_force_that_an_arm_has_is_the_same_while_it_pushes(supervisor):
    """What the program counts on is taken off its torques, and was taken for torque that is spent: half was left."""
    plant = MujocoPlant(SPEC)
    state = plant.state()
    supervisor.reset(state)
    tool, down = SPEC.tools[0], np.array([0.0, 0.0, -1.0])
    body = plant.model.body(tool.wrist_frame).id
    state = plant.step(supervisor.step(state))
    free = supervisor.touch.arm_force(0, down)
    for _ in range(500):
        at = plant.data.site(tool.palm_frame).xpos - plant.data.xipos[body]
        plant.data.xfrc_applied[body] = [0.0, 0.0, 15.0, *np.cross(at, [0.0, 0.0, 15.0])]
        state = plant.step(supervisor.step(state))
    assert supervisor.touch.forces[0, 2] == pytest.approx(15.0, abs=0.5)
    assert supervisor.touch.arm_force(0, down) == pytest.approx(free, rel=0.1)


def test_a_chunk_may_lower_the_limits_of_a_hand_and_not_raise_them(supervisor):
    supervisor.reset(MujocoPlant(SPEC).state())
    touch, chunk = supervisor.touch, scripted_policy("wave").infer(observe(SPEC, *standing()))
    steps, limit = len(chunk), ControllerConfig().touch.force_max
    touch.expect(
        replace(chunk, force_max=np.tile([10.0, 1e6], (steps, 1)), stiffness=np.tile([100.0, 1e6], (steps, 1)))
    )
    touch.asked.listen(chunk.t_obs)
    assert touch.asked.limits.tolist() == [10.0, limit]
    mass = ControllerConfig().touch.mass
    stiffness = mass * supervisor.controller.touch[:, STIFFNESS:AXIS_MAX]
    assert stiffness.tolist() == [[100.0] * 3, [STIFFEST] * 3]
    assert not touch.asked.by_axis
    by_axis = {
        "force_max": np.tile([5.0, 40.0, 1e6], (steps, 2, 1)),
        "stiffness": np.tile([300.0, 9.0, 1e6], (steps, 2, 1)),
    }
    touch.expect(replace(chunk, **by_axis))
    touch.asked.listen(chunk.t_obs)
    assert (touch.asked.limits.tolist(), touch.asked.axes.tolist()) == ([limit] * 2, [[5.0, 40.0, 1e6]] * 2)
    stiffness = mass * supervisor.controller.touch[:, STIFFNESS:AXIS_MAX]
    assert stiffness.tolist() == [[300.0, 9.0, STIFFEST]] * 2


def test_a_hand_may_be_soft_along_one_axis_and_firm_along_the_others():
    """Led 24 mm into a table with 8 N up and 40 N level, and pushed aside with 20 N, it gives way as far as 600 N/m do.

    What it is felt to push with is within a tenth of the limit, and the estimate within 1 N of what is true.
    """
    begin, steps = stance_pose(), 75
    way = np.minimum(np.arange(steps) / 30.0, 1.0)[:, None]
    motion = replace(
        begin,
        p_world_lpalm=begin.p_world_lpalm + way * (np.array([0.36, 0.2, 0.77]) - begin.p_world_lpalm),
        p_world_rpalm=np.tile(begin.p_world_rpalm, (steps, 1)),
    )
    plant, sup = MujocoPlant(SPEC, scene="table"), Supervisor(SPEC)
    felt = Felt(plant, pull=("left", lambda time, q: np.array([0.0, -20.0 if time > 4.0 else 0.0, 0.0])))
    state = plant.state()
    sup.reset(state)
    chunk = to_chunk(motion, builtin("wbc32").id, 0, 0.0, 15.0, steps)
    sup.accept(replace(chunk, force_max=np.tile([40.0, 40.0, 8.0], (steps, 2, 1))))
    seen = []
    while state.time < 6.0:
        state = plant.step(sup.step(state))
        seen.append(sup.touch.forces[0, 2])
    rests = felt.column(0) > 2.5
    assert np.median(np.array(seen)[rests]) <= 1.1 * 8.0
    assert np.median(felt.column(1)[rests, 0, 2]) <= 1.1 * 8.0 + 1.0
    aside = felt.column(2)[:, 0, 1]
    assert 0.015 < aside[np.argmax(felt.column(0) > 4.0)] - aside[-1] < 20.0 / 600.0


@pytest.mark.parametrize(("push", "held"), [((0.0, -12.0, 0.0), False), ((12.0, 0.0, 0.0), True)])
def test_axes_of_settings_turn_with_the_feet(push, held):
    """A robot that looks along y, with 5 N ahead and 40 N aside: pushed back a hand goes, pushed aside it stays."""
    sup = Supervisor(SPEC, ControllerConfig(touch=TouchConfig(force_max=(5.0, 40.0, 40.0))))
    plant = MujocoPlant(SPEC)
    state = plant.state()
    q = state.q.copy()
    q[:2], q[3:7] = [-q[1], q[0]], [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
    state = plant.reset(replace(state, q=q))
    felt = Felt(plant, pull=("left", lambda time, q: np.array(push)))
    sup.reset(state)
    while state.time < 1.0:
        state = plant.step(sup.step(state))
    away = felt.column(2)[:, 0]
    assert (np.linalg.norm(away[-1] - away[0]) < 1.5 * 12.0 / 600.0) == held


@pytest.mark.regression
def test_a_box_of_2_kg_is_carried_by_two_palms_to_where_it_is_to_be():
    """It turned between the hands, which pushed with half of what their arms have."""
    run = Run(scripted_policy("lift_box"), "table_crate")
    crate = run.felt.column(6)
    assert run.result.fall is None
    assert crate[:, 2].max() - crate[0, 2] > 0.08
    np.testing.assert_allclose(crate[-1], crate[0] + [0.0, 0.10, 0.0], atol=0.02)
    assert run.result.scene_contacts == {}


@pytest.mark.regression
def test_a_hand_that_wipes_feels_the_force_that_it_is_told():
    run = Run(wipe(seconds=6.0), "table")
    wiping = (run.times > run.settle + 5.0) & (run.times < run.settle + 9.0)
    # As a sensor of 10 Hz tells it.
    force = np.convolve(run.forces[wiping, 0, 2], np.ones(50) / 50.0, "valid")
    assert np.mean(np.abs(force - 10.0) < 3.0) > 0.95
    assert run.result.scene_contacts == {}


@pytest.mark.regression
def test_a_hand_that_wipes_with_something_in_it_presses_no_harder_by_its_weight():
    """It rested on the table with half of a kilogram that nobody told, and was taken to carry nothing: 15 N."""
    run = Run(wipe(seconds=6.0), "table", loads=[(0.0, (0.5, 0.0))])
    assert run.result.fall is None
    wiping = (run.times > run.settle + 5.0) & (run.times < run.settle + 9.0)
    assert run.forces[wiping, 0, 2].mean() == pytest.approx(10.0, abs=2.0)
