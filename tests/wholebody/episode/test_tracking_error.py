"""Strategy: states and chunks made by hand, one step asked for somewhere else or turned; nothing is simulated."""

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import load_pinocchio, stance_q
from policy.chunk import ActionChunk
from policy.geometry.rotations import rotvec_to_matrix
from policy.geometry.se3 import make_transform
from policy.scripted.policy import stance_pose
from wholebody.episode.tracking_error import DEMANDABLE_DISTANCE, TrackingError, demandable, start_jump
from wholebody.robot.state import Robot
from wholebody.types import Reason, RobotState

SPEC = g1()
MODEL = load_pinocchio(SPEC)
FPS, STEPS = 30.0, 10


def chunk(*, moved=(0.0, 0.0, 0.0), turned=(0.0, 0.0, 0.0), t_obs=0.0):
    """Both hands as in the stance; the left one moved [m] and turned about its own wrist [rad]."""
    data = MODEL.createData()
    pin.framesForwardKinematics(MODEL, data, stance_q(SPEC, MODEL))
    T = [np.tile(data.oMf[MODEL.getFrameId(t.wrist_frame)].homogeneous, (STEPS, 1, 1)) for t in SPEC.tools]
    T[0][:, :3, :3] = T[0][:, :3, :3] @ rotvec_to_matrix(np.array([turned]))[0]
    T[0][:, :3, 3] += moved
    stance = stance_pose()
    fingers = [np.tile(q, (STEPS, 1)) for q in (stance.q_lhand, stance.q_rhand)]
    return ActionChunk("wbc32", 0, t_obs, FPS, *T, *fingers)


def report(missed=0.0):
    """A plan that starts at the chunk's first step and ends past its last, everywhere as far from it."""
    steps = np.arange(0.0, 0.5, 1.0 / 60.0)
    return SimpleNamespace(steps=steps, tracking_error=np.full((len(steps), 2), missed))


def tracking_error():
    return TrackingError(SimpleNamespace(robot=Robot(SPEC), spec=SPEC))


def commanded(*, ahead=0.0):
    """Palm poses of the stance by side, that far ahead [m]."""
    stance = stance_pose()
    palms = {
        "left": make_transform(stance.R_world_lhand, stance.p_world_lpalm),
        "right": make_transform(stance.R_world_rhand, stance.p_world_rpalm),
    }
    for T in palms.values():
        T[0, 3] += ahead
    return palms


def still(meter, start=0.0, end=0.4):
    for tick in range(round(start / 0.002) + 1, round(end / 0.002) + 1):
        meter.measure(RobotState(0.002 * tick, stance_q(SPEC, MODEL), np.zeros(MODEL.nv)), commanded(ahead=0.02))
    return meter


def test_every_step_is_scored_once_against_what_was_asked():
    meter = tracking_error()
    meter.follow(chunk(moved=(0.03, 0.0, 0.04)), report())
    palms = still(meter).result()
    times, errors = palms.times, palms.errors
    assert np.allclose(times, np.arange(1, STEPS) / FPS)  # the first was due as the chunk came
    assert np.allclose(errors[:, 0], 0.05, atol=1e-9)
    assert np.allclose(errors[:, 1], 0.0, atol=1e-9)
    assert np.allclose(palms.turns, 0.0, atol=1e-6)
    assert np.allclose(palms.lags, 0.02, atol=1e-9)
    assert np.allclose(palms.moved[:, 1], 0.02, atol=1e-9)
    assert np.allclose(palms.moved[:, 0], np.hypot(0.03 - 0.02, 0.04), atol=1e-9)


def test_a_turned_hand_has_an_angle_and_its_palm_is_off_by_the_lever():
    meter = tracking_error()
    meter.follow(chunk(turned=(0.0, 0.0, 0.1)), report())
    palms = still(meter).result()
    errors = palms.errors
    for turns in (palms.turns, palms.moved_turns):
        assert np.allclose(turns[:, 0], 0.1)
        assert np.allclose(turns[:, 1], 0.0, atol=1e-6)
    assert np.allclose(palms.lag_turns, 0.0, atol=1e-6)
    lever = np.hypot(*SPEC.tools[0].palm_offset[:2])
    assert np.allclose(errors[:, 0], 2.0 * lever * np.sin(0.05), rtol=1e-6)


def test_errors_are_taken_at_the_steps_not_at_the_ticks():
    """A base that moves at 1 m/s is 2 mm further a tick later."""
    meter, q = tracking_error(), stance_q(SPEC, MODEL)
    meter.follow(chunk(), report())
    for tick in range(200):
        moved = q.copy()
        moved[0] += 0.003 * tick
        meter.measure(RobotState(0.003 * tick, moved, np.zeros(MODEL.nv)), commanded())
    times, errors = meter.result().times, meter.result().errors
    assert np.allclose(errors[:, 1], times, atol=1e-9)


def test_2_what_was_commanded_is_taken_at_the_steps_too_with_the_reason_of_that_time():
    """A command that moves on at 1 m/s is compared between the ticks, and not a tick too late."""
    meter, q = tracking_error(), stance_q(SPEC, MODEL)
    meter.follow(chunk(), report())
    for tick in range(200):
        reason = Reason.OUT_OF_REACH if tick * 0.003 > 0.2 else None
        meter.measure(RobotState(0.003 * tick, q, np.zeros(MODEL.nv)), commanded(ahead=0.003 * tick), reason)
    palms = meter.result()
    assert np.allclose(palms.moved[:, 1], palms.times, atol=1e-9)
    assert np.allclose(palms.lags, palms.times[:, None], atol=1e-9)
    assert palms.reasons == [None] * 5 + [Reason.OUT_OF_REACH] * 4


def test_4_fingers_past_their_range_are_told_by_joint_with_the_worst_value():
    one = chunk()
    one.q_lhand[2:4, 0] = [5.0, -7.0]
    meter = tracking_error()
    meter.follow(one, report())
    (excess,) = (fingers := still(meter).result().fingers).values()
    assert list(fingers) == ["left_hand_thumb_0_joint"]
    assert (excess.worst, excess.bound) == (-7.0, pytest.approx(-1.0472, abs=1e-3))
    assert (excess.first, excess.seconds) == (pytest.approx(2.0 / FPS), pytest.approx(2.0 / FPS))


def test_a_later_chunk_replaces_the_rest_of_the_one_before():
    meter = tracking_error()
    meter.follow(chunk(moved=(0.1, 0.0, 0.0)), report())
    still(meter, end=0.11)
    meter.follow(chunk(t_obs=0.11), report())
    palms = still(meter, 0.11, 0.5).result()
    times, errors = palms.times, palms.errors
    assert np.allclose(times[:4], [1.0 / 30.0, 2.0 / 30.0, 0.1, 0.11 + 1.0 / 30.0])
    assert np.allclose(errors[:3, 0], 0.1, atol=1e-9)
    assert np.allclose(errors[3:, 0], 0.0, atol=1e-9)


def test_5_time_between_chunks_that_is_in_neither_is_told():
    """A chunk may come in time, and be planned only after the last step of the one before."""
    meter = tracking_error()
    meter.follow(chunk(), report())
    meter.follow(chunk(t_obs=STEPS / FPS), report())
    assert meter.result().uncovered == (0.0, 0.0)
    late = report()
    late.steps = late.steps + 0.1
    meter.follow(chunk(t_obs=2 * STEPS / FPS), late)
    assert meter.result().uncovered == pytest.approx(((2 * STEPS - 1) / FPS, 0.1))


def test_a_step_that_two_chunks_have_in_common_is_scored_once():
    """A plan begins with the state that it was made from, one tick before the chunk is taken over."""
    meter = tracking_error()
    meter.follow(chunk(), report())
    still(meter, end=0.1)
    second = report()
    second.steps = second.steps - 0.002
    meter.follow(chunk(t_obs=0.1), second)
    assert np.allclose(still(meter, 0.1, 0.3).result().times, np.arange(1, 10) / FPS)


def test_a_step_that_the_next_chunk_has_a_millisecond_later_is_scored_once():
    """Chunks begin at ticks, so their steps do not fall on the steps of the one before to the millisecond."""
    meter = tracking_error()
    meter.follow(chunk(), report())
    still(meter, end=0.104)
    meter.follow(chunk(t_obs=0.1 - 2 / FPS + 0.001), report())
    times = still(meter, 0.104, 0.3).result().times
    assert np.diff(times).min() > 0.5 / FPS
    assert len(times) == 8


def test_a_first_chunk_far_from_the_hands_is_measured_where_it_is_joined():
    far = chunk(moved=(0.0, 0.3, 0.4), turned=(0.0, 0.5, 0.0))
    distance, angle = start_jump(far, 0.0, commanded(), SPEC)
    assert distance == pytest.approx(0.5, abs=0.1)  # the palm is 0.12 m from the wrist that turns
    assert angle == pytest.approx(0.5)
    assert start_jump(chunk(), 0.0, commanded(), SPEC) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_a_step_may_be_asked_for_if_it_is_slow_and_the_plan_reaches_it():
    assert demandable(chunk(), report()).all()
    assert not demandable(chunk(), report(missed=1.01 * DEMANDABLE_DISTANCE)).any()


@pytest.mark.parametrize(("speed", "fair"), [(1.0, True), (1.2, False)])
def test_a_wrist_faster_than_1_1_metres_a_second_may_not_be_asked_for(speed, fair):
    one = chunk()
    one.T_world_rhand[:, 0, 3] += speed * np.arange(STEPS) / FPS
    assert demandable(one, report())[:, 1].all() == fair
    assert demandable(one, report())[:, 0].all()


def test_a_wrist_that_shakes_at_20_metres_per_second_squared_may_not_be_asked_for():
    one = chunk()
    one.T_world_lhand[:, 2, 3] += 0.05 * np.sin(20.0 * np.arange(STEPS) / FPS)  # 1 m/s and 20 m/s^2 at most
    fair = demandable(one, report())
    assert not fair[:, 0].all()
    assert fair[:, 1].all()
