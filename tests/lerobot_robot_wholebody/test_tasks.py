"""Strategy: tasks without a robot, by what they are told is seen; the wipe once on the robot, whose hand pushes."""

import numpy as np
import pytest

from lerobot_robot_wholebody.config_wholebody_g1 import TOLD
from lerobot_robot_wholebody.environment import FPS, G1Env
from lerobot_robot_wholebody.target import wrist_at
from lerobot_robot_wholebody.tasks import THINGS, task_of
from lerobot_robot_wholebody.wiping import GONE, SPOTS
from models.places import TABLE_HEIGHT
from policy.action_spec.anchor import Anchor
from policy.action_spec.codec import encode_valid
from policy.chunk import ActionChunk
from policy.observation import Observation
from policy.scripted.chores import WIPED_PAST, wipe_off
from policy.scripted.contact import HAND_HALF
from tests.support.wide import wide
from wholebody.live.served.messages import Seen

AWAY = np.array([[0.26, 0.2, 0.86], [0.26, -0.2, 0.86]])


def seen(force=(0.0, 0.0, 0.0), objects=None):
    """A view of a robot whose left palm feels a force."""
    observation = Observation(0.0, np.zeros(29), np.zeros(7), np.zeros(7), np.eye(4), objects=objects)
    return Seen(observation, forces=np.array([force, np.zeros(3)]))


def on(spot):
    """Palms of which the left one is on a spot of the table."""
    return np.array([[*spot, TABLE_HEIGHT + HAND_HALF], AWAY[1]])


@pytest.mark.parametrize(("task", "way"), [
    ("pick_low", (0.0, 0.0, 0.065)), ("shelf", (-0.01, 0.0, 0.4)), ("open_drawer", (-0.26, 0.0, 0.0)),
])  # fmt: skip
def test_a_thing_is_to_be_moved_and_done_where_it_was(task, way):
    one = task_of(task, 3)
    begin = one.objects(np.array([[0.46, 0.15, 0.88, 1.0, 0.0, 0.0, 0.0]]))
    here, there = begin.copy(), begin.copy()
    there[0, :3] += way
    if task == "shelf":
        there[0, :2] = 0.46, 0.16
    assert one.far(seen(objects=here), AWAY) > 0.05
    assert one.far(seen(objects=there), AWAY) <= 0.0
    assert one.held == THINGS[task].held == 10
    assert one.script().duration < one.steps / FPS


def test_tasks_that_tell_forces_are_those_whose_expert_does_more_than_press():
    """Only they have the longer action; the button yields to a hand that is led on."""
    told = {name for name, about in THINGS.items() if tells(about.script(np.zeros(2)))}
    assert told - {"press", "hand_over"} == set(TOLD)


def tells(script):
    """Whether a script tells any force."""
    motion = script.script(np.arange(0.0, script.duration, 0.1))
    return bool(motion.f_world_lpalm.any() or motion.f_world_rpalm.any())


@pytest.mark.parametrize(
    ("task", "seed", "told"),
    [("lift", 1, True), *wide(("lift", 2, True), ("lift_crate", 0, True), ("lift", 1, False), ("lift", 2, False))],
)
def test_a_box_is_lifted_by_palms_a_centimetre_aside_anew_in_each_chunk_if_forces_are_told(task, seed, told):
    """So a policy leads them, and along with the box where that slips."""
    env, rng = G1Env(task=task), np.random.default_rng(seed)
    try:
        env.reset(seed=seed)
        script, begin, aside = env._task.script().script, env._seen.objects[0, :2].copy(), np.zeros((2, 3))
        for step in range(env._max_episode_steps):
            if step >= 3 * FPS and step % 20 == 0:
                aside = rng.normal(0.0, 0.01, (2, 3))
                aside[:, :2] += env._seen.objects[0, :2] - begin
            action = as_action(script(np.array([step / FPS])), aside, env._numbers)
            action[32:] *= told
            *_, ended, _, info = env.step(action)
            if ended:
                break
        assert info["is_success"] == told
        assert not info["fell"]
    finally:
        env.close()


def as_action(motion, aside, numbers):
    """Action of the first row of a scripted motion, its palms led aside (2, 3) [m]."""
    poses = (
        wrist_at(motion.p_world_lpalm[0] + aside[0], motion.R_world_lhand[0], "left", numbers),
        wrist_at(motion.p_world_rpalm[0] + aside[1], motion.R_world_rhand[0], "right", numbers),
    )
    rows = [part[None] for part in (*poses, motion.q_lhand[0], motion.q_rhand[0])]
    forces = {name: getattr(motion, name).reshape(-1, 3)[:1] for name in ("f_world_lpalm", "f_world_rpalm")}
    chunk = ActionChunk(numbers.spec.id, 0, 0.0, 30.0, *rows, **forces)
    return encode_valid(numbers.spec, chunk, Anchor.nominal())[0].astype(np.float32)


def test_a_streak_is_wiped_off_spot_by_spot_by_a_palm_that_pushes_as_it_should():
    task, anchor = task_of("wipe", 0), Anchor.nominal()
    first, push = task.spots[0], (0.0, 3.0, 10.0)
    assert task.far(seen(push), AWAY) > 0.16  # the hand is elsewhere
    for force in ((0.0, 0.0, 0.0), (0.0, 0.0, 4.0), (0.0, 0.0, 25.0)):
        assert task.far(seen(force), on(first)) == pytest.approx(0.16)
    assert task.far(seen(push), on(first)) == pytest.approx(0.16)  # 40 mm on to the next, and along what is left
    assert [ball[2] for ball in task.in_world(anchor)] == [GONE, *[TABLE_HEIGHT] * (SPOTS - 1)]
    shown = np.reshape([*task.shown(seen(), anchor, on(first)).values()], (2, 3))
    np.testing.assert_allclose(shown[:, :2], task.spots[[1, -1]] - first, atol=1e-12)
    for spot in task.spots[1:]:
        far = task.far(seen(push), on(spot))
    assert far == 0.0
    assert not any(task.shown(seen(), anchor, AWAY).values())
    assert task.objects(np.zeros((0, 7))) is None
    assert task.left.all()  # dirty again


def test_streaks_are_elsewhere_by_the_seed():
    a, b, again = (task_of("wipe", seed).spots for seed in (0, 1, 0))
    assert np.abs(a - b).max() > 5e-3
    assert np.array_equal(a, again)


def test_a_hand_that_is_led_into_the_table_wipes_what_is_under_it():
    env = G1Env(task="wipe")
    try:
        env.reset(seed=0)
        spots = env._task.spots
        way = spots[-1] - spots[0]
        script = wipe_off([spots[0] + WIPED_PAST * way / np.linalg.norm(way), spots[-1]])  # down on the first spot
        for step in range(round(4.0 * FPS)):
            motion = script.script(np.array([1.2 * step / FPS]))
            *_, info = env.step(as_action(motion, np.zeros((2, 3)), env._numbers))
            if not env._task.left.all():
                break
        assert env._task.left.tolist() == [False, True, True, True, True]
        assert info["taken"]
        assert not info["fell"]
        assert 5.0 <= env._seen.forces[0, 2] <= 20.0
    finally:
        env.close()
