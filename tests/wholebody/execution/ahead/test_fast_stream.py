"""Strategy: single targets of a circle, as `TargetStream` has them, at speeds on both sides of what is fast."""

from dataclasses import replace

import numpy as np
import pytest

from policy.scripted.policy import ScriptedMotion, stance_pose, to_chunk
from wholebody.execution.ahead.fast_stream import CALM, FAST, KEPT, LAG, FastStream
from wholebody.planning.preparation import prepare
from wholebody.reference import HandLimits

RADIUS, RATE, STEPS = 0.1, 30.0, 15
LIMITS = HandLimits(), HandLimits()


def circle(time, speed, seq, steps=STEPS):
    """A chunk of both palms on a circle from a time on [s], at a speed [m/s]."""
    s = stance_pose()
    angle = speed / RADIUS * (time + np.arange(steps) / RATE)
    way = RADIUS * np.stack([0.0 * angle, np.sin(angle), np.cos(angle)], axis=1)
    motion = ScriptedMotion(
        s.p_world_lpalm + way, s.p_world_rpalm + way, s.R_world_lhand, s.R_world_rhand, s.q_lhand, s.q_rhand
    )
    return to_chunk(motion, "wbc32", seq, time, RATE, steps)


def told(stream, count, speed=2.0 * FAST, begin=0.0):
    """What a stream says of the last of so many chunks, and that chunk."""
    for k in range(count):
        chunk = circle(begin + k / RATE, speed, k)
        stream.add(chunk)
    return stream.paths(prepare(chunk, LIMITS)), chunk


def test_a_path_goes_through_what_was_said_before_its_chunk_and_on_along_it():
    paths, chunk = told(FastStream(LIMITS), KEPT + 1)
    there = paths[0].sample(np.array([-LAG])).p[0]
    asked = circle(chunk.t_obs - LAG, 2.0 * FAST, 0).T_world_lhand[0, :3, 3]
    assert np.linalg.norm(there - asked) < 2e-4
    assert np.allclose(paths[1].sample(np.array([3.0 / RATE])).p[0], chunk.T_world_rhand[3, :3, 3], atol=1e-9)


@pytest.mark.parametrize(("speed", "fast"), [(0.7 * FAST, False), (1.5 * FAST, True)])
def test_hands_are_fast_from_a_speed_on_and_for_a_while_after(speed, fast):
    stream = FastStream(LIMITS)
    _, chunk = told(stream, KEPT + 1, speed)
    assert stream.is_fast(chunk.t_obs + 0.9 * CALM) == fast
    assert not stream.is_fast(chunk.t_obs + 1.1 * CALM)


def test_chunks_of_many_steps_and_chunks_after_a_gap_are_none_of_a_stream():
    stream = FastStream(LIMITS)
    told(stream, KEPT + 1)
    stream.add(circle(1.0, FAST, 100, steps=30))
    assert told(stream, KEPT)[0] is None
    assert told(stream, 1, begin=0.5)[0] is None


def test_hands_in_the_floor_are_left_to_plans():
    stream = FastStream(LIMITS)
    _, chunk = told(stream, KEPT + 1)
    T = chunk.T_world_lhand.copy()
    T[:, 2, 3] = -0.3
    low = replace(chunk, t_obs=chunk.t_obs + 1.0 / RATE, T_world_lhand=T)
    stream.add(low)
    assert stream.paths(prepare(low, LIMITS)) is None


def test_a_target_that_jumps_once_is_not_fast():
    stream = FastStream(LIMITS)
    told(stream, KEPT + 1, speed=0.1 * FAST)
    for k in range(2):
        ahead = circle((KEPT + 1) / RATE, 0.1 * FAST, 50 + k)
        T = ahead.T_world_lhand.copy()
        T[:, 0, 3] += 0.03
        stream.add(replace(ahead, t_obs=ahead.t_obs + k / RATE, T_world_lhand=T))
    assert not stream.is_fast(ahead.t_obs + 1.0 / RATE)
