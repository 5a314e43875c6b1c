"""Strategy: tasks without a robot, by what they are told is seen; the wipe once on the robot, whose hand pushes."""

import numpy as np
import pytest

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
        spots, numbers, anchor = env._task.spots, env._numbers, Anchor.nominal()
        way = spots[-1] - spots[0]
        script = wipe_off([spots[0] + WIPED_PAST * way / np.linalg.norm(way), spots[-1]])  # down on the first spot
        for step in range(round(4.0 * FPS)):
            motion = script.script(np.array([1.2 * step / FPS]))
            poses = (
                wrist_at(motion.p_world_lpalm[0], motion.R_world_lhand[0], "left", numbers),
                wrist_at(motion.p_world_rpalm[0], motion.R_world_rhand[0], "right", numbers),
            )
            rows = [part[None] for part in (*poses, motion.q_lhand[0], motion.q_rhand[0])]
            action = encode_valid(numbers.spec, ActionChunk(numbers.spec.id, 0, 0.0, 30.0, *rows), anchor)[0]
            *_, info = env.step(action.astype(np.float32))
            if not env._task.left.all():
                break
        assert env._task.left.tolist() == [False, True, True, True, True]
        assert info["taken"]
        assert not info["fell"]
        assert 5.0 <= env._seen.forces[0, 2] <= 20.0
    finally:
        env.close()
