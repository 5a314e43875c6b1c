"""Strategy: the whole-body program alone follows chunks exactly as they are, which nothing else in the house does."""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from tests.support.hostile_chunks import hostile_chunk
from tests.support.sent_chunks import sent
from wholebody.control.reference_packet import PALM
from wholebody.errors import StateError
from wholebody.execution.as_given import AsGiven, palm_rows
from wholebody.execution.kernels.plan_follower import palm
from wholebody.reference import HandMotion, HandPath
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Reason, Status

SPEC = g1()


@pytest.fixture(scope="module")
def loop():
    return AsGiven(SPEC), MujocoPlant(SPEC)


def test_palms_of_a_path_are_those_that_the_control_tick_computes():
    chunk, offset = sent(to=(0.2, 0.1, 0.2), time=0.8), np.array(SPEC.tools[0].palm_offset)
    motion = HandPath.from_knots(chunk.times, chunk.T_world_lhand, chunk.q_lhand).sample(np.linspace(0.0, 1.6, 30))
    motion.rows[:, 13:19] = np.random.default_rng(0).normal(size=(30, 6))  # angular rates, which that chunk has not
    row = np.zeros(PALM)
    for rows, found in zip(motion.rows, palm_rows(HandMotion(motion.rows), offset), strict=True):
        palm(rows, offset, row)
        assert np.abs(found - row).max() < 1e-12


def test_a_chunk_is_commanded_exactly_as_it_is_and_followed(loop):
    follower, plant = loop
    state, chunk = plant.reset(), sent(to=(0.10, 0.0, 0.05), time=1.0)
    follower.reset(state)
    assert follower.accept(chunk).status is Status.TRACKING
    T, off = follower.spec.tools[0], []
    for k in range(500):
        state = plant.step(follower.step(state))
        if k % 50 == 49:  # the command of this tick is for its beginning
            asked = HandPath.from_knots(chunk.times, chunk.T_world_lhand, chunk.q_lhand).sample(np.array([0.002 * k]))
            at = asked.T_world_hand[0] @ np.append(T.palm_offset, 1.0)
            assert np.abs(follower.palm_reference()["left"][:3, 3] - at[:3]).max() < 1e-9
            off.append(np.linalg.norm(follower.robot.pose(T.palm_frame).translation - at[:3]))
    assert max(off) < 5e-3
    assert follower.status.status is Status.TRACKING


def test_hands_that_are_elsewhere_jump_at_once(loop):
    follower, plant = loop
    state = plant.reset()
    follower.reset(state)
    before = follower.palm_reference()["left"].copy()
    follower.accept(sent(jump=(0.2, 0.0, 0.0)))
    follower.step(state)
    assert np.linalg.norm(follower.palm_reference()["left"][:3, 3] - before[:3, 3]) == pytest.approx(0.2, abs=2e-3)


def test_only_what_is_no_chunk_is_refused(loop):
    follower, plant = loop
    follower.reset(plant.reset())
    nan = hostile_chunk("nan", np.random.default_rng(0), 0, 0.0)
    assert follower.accept(nan).reason is Reason.CHUNK_INVALID
    assert follower.accept(replace(sent(), t_obs=1.0)).reason is Reason.CHUNK_FROM_FUTURE
    assert follower.chunk is None
    assert follower.ahead(np.zeros(1)) is None


def test_a_robot_that_begins_elsewhere_goes_to_its_stance(loop):
    follower, plant = loop
    follower.reset(plant.reset())
    stance = plant.reset()
    bent = replace(stance, q=stance.q.copy())
    bent.q[7 + follower.robot.joint_indices(["left_elbow_joint"])] += 0.3
    state = plant.reset(bent)
    follower.reset(state)
    away = follower._memory.posture[0].copy()
    for _ in range(400):
        state = plant.step(follower.step(state))
    assert np.abs(away - stance.q[7:]).max() == pytest.approx(0.3)
    assert np.abs(follower._memory.posture[0] - stance.q[7:]).max() < 1e-9


def test_nothing_is_followed_before_the_first_state():
    with pytest.raises(StateError, match="reset"):
        AsGiven(SPEC).accept(sent())
    with pytest.raises(StateError, match="reset"):
        AsGiven(SPEC).step(MujocoPlant(SPEC).reset())
