"""Scripted policies: the palm follows the formula, chunks agree with each other, nothing jumps."""

import numpy as np
import pytest

from models import g1
from models.unitree_g1 import LOCKED
from policy import SCRIPTS, PolicyError, scripted_policy
from policy.action_spec.hands import grasp_posture
from policy.scripted.contact import FINGERS_AHEAD
from policy.scripted.library import OBJECT_IN_PALM, grasp, lissajous, pick, reach, scripts_of, two_hand_lift, wave
from policy.scripted.policy import minimum_jerk, palm_offset, stance_pose
from policy.scripted.waypoints import Waypoint, waypoint_policy
from tests.support.policy_cases import observation

TIMES = np.arange(0.0, 26.0, 0.002)


def palms(chunk):
    pairs = ((chunk.T_world_lhand, "left"), (chunk.T_world_rhand, "right"))
    return [T[:, :3, 3] + T[:, :3, :3] @ palm_offset(side) for T, side in pairs]


def test_lissajous_is_the_curve_of_the_definition_and_the_right_hand_its_mirror():
    policy = lissajous()
    policy.reset()
    policy.infer(observation(5.0))
    chunk = policy.infer(observation(5.0 + 7.3))
    t = 7.3 + np.arange(50) / 30.0
    left = np.array([0.24, 0.21, 0.86]) + 0.15 * np.stack([np.sin(2 * t), np.sin(4 * t), np.sin(6 * t)], axis=1)
    found_left, found_right = palms(chunk)
    assert np.abs(found_left - left).max() < 1e-12
    assert np.abs(found_right - left * [1.0, -1.0, 1.0]).max() < 1e-12
    R_left, R_right, mirror = chunk.T_world_lhand[:, :3, :3], chunk.T_world_rhand[:, :3, :3], np.diag([1.0, -1.0, 1.0])
    assert np.abs(R_left - R_left[0]).max() < 1e-12
    # The stance itself is mirrored to 1e-7 only.
    assert np.abs(R_right - mirror @ R_left @ mirror).max() < 1e-6


def test_lissajous_has_the_speed_and_acceleration_of_the_definition_and_ends_at_rest():
    p = lissajous().script(TIMES).p_world_lpalm
    v = np.gradient(p, 0.002, axis=0)
    a = np.gradient(v, 0.002, axis=0)
    scored = (TIMES > 2.0) & (TIMES < 22.0)
    assert np.linalg.norm(v[scored], axis=1).max() == pytest.approx(1.12, abs=0.01)
    assert np.linalg.norm(a[scored], axis=1).max() == pytest.approx(5.84, abs=0.05)
    assert np.linalg.norm(a[5:-5], axis=1).max() < 6.5
    assert np.linalg.norm(v[TIMES > 24.01], axis=1).max() < 1e-9


@pytest.mark.parametrize(("x", "z"), [(0.40, 0.30), (0.45, 0.60), (0.50, 1.00), (0.40, 1.40), (0.25, 1.50)])
def test_reach_takes_three_seconds_and_holds(x, z):
    motion = reach(x, z).script(np.array([0.0, 1.5, 3.0, 5.0, 100.0]))
    stance = stance_pose()
    goal = np.array([x, 0.16, z])
    assert np.allclose(motion.p_world_lpalm[0], stance.p_world_lpalm)
    assert np.allclose(motion.p_world_lpalm[1], 0.5 * (stance.p_world_lpalm + goal))
    assert np.allclose(motion.p_world_lpalm[2:], goal)
    assert np.allclose(motion.p_world_rpalm[2:], goal * [1.0, -1.0, 1.0])
    assert reach(x, z).duration == 7.0


@pytest.mark.parametrize("name", SCRIPTS)
def test_every_script_begins_at_the_stance_and_moves_smoothly(name):
    policy = scripted_policy(name)
    motion = policy.script(TIMES[policy.duration + 1.0 > TIMES])
    stance = stance_pose()
    for hand in ("l", "r"):
        p = getattr(motion, f"p_world_{hand}palm")
        assert np.allclose(p[0], getattr(stance, f"p_world_{hand}palm"), atol=1e-9)
        a = np.gradient(np.gradient(p, 0.002, axis=0), 0.002, axis=0)
        assert np.linalg.norm(a, axis=1).max() < 12.0
        assert np.linalg.norm(p[-1] - p[-200]) < 1e-9


@pytest.mark.parametrize("name", SCRIPTS)
def test_fingers_stay_within_their_limits(name):
    policy, spec = scripted_policy(name), g1()
    motion = policy.script(TIMES)
    for side, q in (("left", motion.q_lhand), ("right", motion.q_rhand)):
        at = spec.indices(spec.tool(side).finger_joints)
        assert (np.atleast_2d(q) >= spec.position_min[at] - 1e-12).all()
        assert (np.atleast_2d(q) <= spec.position_max[at] + 1e-12).all()


@pytest.mark.parametrize("name", SCRIPTS)
def test_points_are_within_the_measured_reach(name):
    motion = scripted_policy(name).script(TIMES)
    for p in (motion.p_world_lpalm, motion.p_world_rpalm):
        assert p[:, 2].min() > 0.30
        assert p[:, 2].max() < 1.50
        assert (p[:, 0].max() <= 0.50) == (name != "walk_reach"), "only that one is made to be out of reach"


def test_closing_the_left_hand_mirrors_the_right_by_name():
    left, right = (dict(zip(g1().tool(s).finger_joints, grasp_posture(s, 1.0), strict=True)) for s in ("left", "right"))
    assert any(left.values())
    for name, angle in left.items():
        assert right[name.replace("left", "right")] == pytest.approx(-angle, abs=1e-9)


def test_grasp_brings_the_object_between_the_fingers_and_lifts_it():
    policy = grasp((0.36, -0.10, 0.83), side="right", lift=0.10)
    motion = policy.script(np.array([4.5, 6.0, 8.0, 13.0]))
    R = stance_pose().R_world_rhand
    centre = motion.p_world_rpalm[0] + R @ (OBJECT_IN_PALM * [1.0, -1.0, 1.0])
    assert np.allclose(centre, [0.36, -0.10, 0.83])
    assert np.allclose(motion.q_rhand[0], grasp_posture("right", 0.0))
    assert np.allclose(motion.q_rhand[1:], grasp_posture("right", 1.0))
    assert np.allclose(motion.p_world_rpalm[3] - motion.p_world_rpalm[0], [0.0, 0.0, 0.10])


def test_grasp_is_meant_for_the_cylinder_of_the_scene():
    motion = grasp().script(np.array([4.5]))
    centre = motion.p_world_lpalm[0] + stance_pose().R_world_lhand @ OBJECT_IN_PALM
    assert np.allclose(centre, [0.42, 0.15, 0.75 + 0.08])


def test_grasp_comes_from_the_open_side_of_the_hand():
    aside = grasp((0.36, -0.10, 0.83), side="right").script(np.array([2.5])).p_world_rpalm[0]
    assert aside[1] < -0.2


def test_a_grasp_around_goes_aside_before_it_goes_ahead():
    """Strategy: the cylinder in front of the hand, whose tips would meet it on a straight way."""
    at, clear = np.array([0.40, 0.19, 0.83]), []
    for around in (False, True):
        palms = grasp(tuple(at), around=around).script(np.arange(0.0, 2.5, 0.01)).p_world_lpalm
        beside = palms[palms[:, 0] + FINGERS_AHEAD > at[0] - 0.03]
        clear.append(beside[:, 1].min() > at[1] + 0.085)
    assert clear == [False, True]


def test_the_other_hand_stays_in_the_stance():
    for policy in (pick("low"), pick("high", side="right"), wave(), grasp((0.36, -0.10, 0.83), side="right")):
        p = policy.script(TIMES).p_world_lpalm
        assert np.abs(p - stance_pose().p_world_lpalm).max() < 1e-12


def test_two_hand_lift_keeps_the_width_while_it_carries():
    motion = two_hand_lift(width=0.30).script(np.arange(3.5, 9.5, 0.01))
    assert np.abs((motion.p_world_lpalm - motion.p_world_rpalm)[:, 1] - 0.30).max() < 1e-9


def test_minimum_jerk_is_at_rest_at_both_ends():
    t = np.linspace(-0.2, 1.2, 2801)
    s = minimum_jerk(t)
    assert (s[0], s[-1]) == (0.0, 1.0)
    v = np.gradient(s, t)
    assert v.max() == pytest.approx(1.875, abs=1e-3)
    assert np.abs(np.gradient(v, t)[np.abs(t) < 1e-3]).max() < 0.1


def test_waypoint_times_must_increase():
    with pytest.raises(PolicyError, match="must increase"):
        waypoint_policy("x", [Waypoint(2.0), Waypoint(1.0)])


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda: scripted_policy("lissajus"), "did you mean 'lissajous'"),
        (lambda: scripted_policy("reach", height=1.0), "does not take these settings"),
        (lambda: pick("middle"), "it is 'low' or 'high'"),
        (lambda: wave(side="both"), "it is 'left' or 'right'"),
    ],
)
def test_misuse_says_what_would_work(call, complaint):
    with pytest.raises(PolicyError, match=complaint):
        call()


def test_scripts_for_furniture_are_the_g1s_and_said_to_be():
    other = g1(locked=LOCKED["27dof"])
    assert set(scripts_of()) == set(SCRIPTS)
    assert "wave" in scripts_of(other)
    assert scripted_policy("wave", other).spec.robot == other
    with pytest.raises(PolicyError, match="made for the G1 with Dex3 hands; of g1_dex3_27"):
        scripted_policy("wipe", other)
