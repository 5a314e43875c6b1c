"""Strategy: the seam of curves with a known jump, from poses alone; the commanded chunk of a real supervisor."""

import numpy as np
import pytest

from models import g1
from policy.geometry.rotations import rotvec_to_matrix
from policy.geometry.se3 import make_transform
from policy.scripted.library import scripted_policy
from wholebody.episode.chunk_seams import SeamMeter, commanded_chunk
from wholebody.episode.run import observe
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant

DT = 0.002


def pose(t, *, jump=0.0, turn=0.0, speed=0.0, spin=0.0):
    """A palm on a circle of 1.1 m/s, turning at 2 rad/s, with something added."""
    p = 0.15 * np.array([np.cos(7.3 * t), np.sin(7.3 * t), 0.1 * t]) + [jump + speed * t, 0.0, 0.0]
    return make_transform(rotvec_to_matrix(np.array([0.0, 0.0, 2.0 * t + turn + spin * t])), p)


def measured(**change):
    """Seam of a path that changes at time 0; the other hand goes on as it did."""
    meter = SeamMeter(DT)
    for k in range(-10, 0):
        meter.add({"left": pose(DT * k), "right": pose(DT * k)})
    meter.mark(0.0)
    for k in range(10):
        meter.add({"left": pose(DT * k), "right": pose(DT * k, **change)})
    (seam,) = meter.seams
    return seam


def test_a_smooth_path_has_no_seam():
    seam = measured()
    assert seam.time == 0.0
    assert seam.distance < 1e-6
    assert seam.angle < 1e-6
    assert seam.velocity < 1e-3
    assert seam.angular_velocity < 1e-3


@pytest.mark.parametrize(
    ("change", "field", "value"),
    [
        ({"jump": 0.003}, "distance", 0.003),
        ({"turn": 0.02}, "angle", 0.02),
        ({"speed": 0.2}, "velocity", 0.2),
        ({"spin": 0.5}, "angular_velocity", 0.5),
    ],
)
def test_a_jump_is_measured_in_the_hand_that_jumps(change, field, value):
    assert getattr(measured(**change), field) == pytest.approx(value, rel=0.02)


def test_a_jump_alone_is_no_change_of_velocity():
    assert measured(jump=0.003).velocity < 1e-3


def test_a_seam_in_the_first_period_is_compared_with_rest():
    meter = SeamMeter(DT)
    meter.mark(0.0)
    assert meter.seams == []
    still = {"left": pose(0.0), "right": pose(0.0)}
    meter.add(still)
    meter.mark(DT)
    for _ in range(5):
        meter.add(still)
    (seam,) = meter.seams
    assert seam.distance == 0.0
    assert seam.velocity == 0.0


def test_two_seams_within_three_periods_are_both_measured():
    meter = SeamMeter(DT)
    for k in range(-10, 10):
        if k in (0, 1):
            meter.mark(DT * k)
        meter.add({side: pose(DT * k, jump=0.002 * (k >= 1)) for side in ("left", "right")})
    assert [seam.time for seam in meter.seams] == [0.0, DT]
    assert meter.seams[1].distance > 1e-3


def test_the_commanded_chunk_is_where_the_hands_are_told_to_be_now_and_later():
    plant = MujocoPlant(g1())
    supervisor = Supervisor(plant.spec)
    state = plant.reset()
    supervisor.reset(state)
    assert commanded_chunk(supervisor, 0.0, 10, 30.0) is None
    assert supervisor.chunk is None
    policy = scripted_policy("wave")
    policy.reset()
    chunk = policy.infer(observe(plant.spec, supervisor, state))
    supervisor.accept(chunk)
    for _ in range(100):
        state = plant.step(supervisor.step(state))
    ahead = commanded_chunk(supervisor, 0.198, 60, 30.0)
    ahead.validate()
    assert ahead.spec_id == chunk.spec_id
    palms = supervisor.palm_reference()
    offset = np.append(plant.spec.tools[1].palm_offset, 1.0)
    np.testing.assert_allclose(ahead.T_world_rhand[0] @ offset, palms["right"][:, 3], atol=5e-4)
    later = policy.script(ahead.times[:20])
    reached = ahead.T_world_rhand[:20] @ offset
    np.testing.assert_allclose(reached[:, :3], later.p_world_rpalm, atol=3e-3)
    np.testing.assert_allclose(ahead.T_world_rhand[-1], ahead.T_world_rhand[-5], atol=1e-9)
