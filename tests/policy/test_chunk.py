"""Chunks and observations refuse what cannot be executed, naming the step and the field."""

import dataclasses
from typing import get_args

import numpy as np
import pytest

from policy import ActionChunk, Anchor, ChunkError, ObservationError
from policy.action_spec.slot import Frame
from policy.chunk import BASE_SPEED_MAX
from tests.support.policy_cases import observation, wandering_chunk


@pytest.fixture(scope="module")
def chunk():
    return wandering_chunk(Anchor.nominal())


def spoiled(chunk, name, index, value):
    array = np.array(getattr(chunk, name))
    array[index] = value
    return dataclasses.replace(chunk, **{name: array})


def test_times_are_the_steps_from_the_observation(chunk):
    assert np.allclose(chunk.times, 1.5 + np.arange(6) / 30.0)
    chunk.validate()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ["T_world_lhand", "T_world_rhand", "q_lhand", "q_rhand"])
def test_a_value_that_is_not_finite_is_named_with_step_and_field(chunk, name, value):
    index = (4, 0, 3) if name.startswith("T") else (4, 0)
    with pytest.raises(ChunkError, match=f"{name} is .* at step 4") as refusal:
        spoiled(chunk, name, index, value).validate()
    assert (refusal.value.step, refusal.value.slot) == (4, name)


@pytest.mark.parametrize(
    ("index", "value"), [((2, 0, 0), 1.01), ((2, slice(3), slice(3)), np.diag([1.0, 1.0, -1.0])), ((2, 3, 3), 0.0)]
)
def test_a_matrix_that_is_no_rigid_transform_is_named(chunk, index, value):
    with pytest.raises(ChunkError, match="no rigid transform at step 2") as refusal:
        spoiled(chunk, "T_world_rhand", index, value).validate()
    assert refusal.value.step == 2


@pytest.mark.parametrize(
    ("change", "slot"),
    [
        ({"fps": 0.0}, "fps"),
        ({"fps": -30.0}, "fps"),
        ({"fps": np.nan}, "fps"),
        ({"t_obs": np.inf}, "t_obs"),
        ({"t_obs": 1e300}, "t_obs"),
        ({"q_lhand": np.zeros((6, 6))}, "q_lhand"),
        ({"q_rhand": np.zeros((5, 7))}, "q_rhand"),
        ({"T_world_rhand": np.zeros((6, 3, 4))}, "T_world_rhand"),
        ({"T_world_lhand": np.zeros((0, 4, 4))}, "T_world_lhand"),
        ({"q_waist": np.zeros((6, 2))}, "q_waist"),
        ({"base_height": np.zeros((6, 1))}, "base_height"),
        ({"q_lhand": np.zeros((6, 7), dtype=object)}, "q_lhand"),
    ],
)
def test_wrong_shapes_types_and_clocks_are_named(chunk, change, slot):
    with pytest.raises(ChunkError) as refusal:
        dataclasses.replace(chunk, **change).validate()
    assert refusal.value.slot == slot


def test_a_repeated_a_late_and_an_old_chunk_are_refused(chunk):
    later = dataclasses.replace(chunk, seq=4, t_obs=2.0)
    later.validate(after=chunk)
    with pytest.raises(ChunkError, match="repeated or late"):
        dataclasses.replace(later, t_obs=chunk.t_obs).validate(after=chunk)
    with pytest.raises(ChunkError, match="before a reset"):
        dataclasses.replace(later, seq=0).validate(after=chunk)


@pytest.mark.parametrize("frame", [*get_args(Frame), "soles"])
def test_hands_are_in_a_frame_that_layouts_have(chunk, frame):
    dataclasses.replace(chunk, hands_in=frame).validate()


def test_an_unknown_frame_is_refused_with_those_there_are(chunk):
    with pytest.raises(ChunkError, match=r"hands_in is 'wrld'.* did you mean 'world'\? there are: pelvis, ") as refusal:
        dataclasses.replace(chunk, hands_in="wrld").validate()
    assert refusal.value.slot == "hands_in"


def test_a_base_that_nothing_could_follow_is_refused_and_a_fast_one_is_not(chunk):
    velocity = np.zeros((6, 3))
    velocity[4, 2] = 1.0 + BASE_SPEED_MAX
    with pytest.raises(ChunkError, match=r"base_velocity is 11 at step 4; up to 10 m/s and rad/s .* mm/s") as refusal:
        dataclasses.replace(chunk, base_velocity=velocity).validate()
    assert (refusal.value.step, refusal.value.slot) == (4, "base_velocity")
    dataclasses.replace(chunk, base_velocity=np.full((6, 3), -BASE_SPEED_MAX)).validate()


def test_optional_parts_are_listed_only_where_they_are(chunk):
    assert set(chunk.arrays()) == {"T_world_lhand", "T_world_rhand", "q_lhand", "q_rhand"}
    assert "base_height" in dataclasses.replace(chunk, base_height=np.ones(6)).arrays()


def test_chunk_errors_are_value_errors():
    assert issubclass(ChunkError, ValueError)
    assert (
        len(ActionChunk("x", 0, 0.0, 30.0, np.eye(4)[None], np.eye(4)[None], np.zeros((1, 7)), np.zeros((1, 7)))) == 1
    )


def test_a_good_observation_passes():
    observation(1.0, lean=0.2).validate()


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"time": np.nan}, "time is nan"),
        ({"q_body": np.zeros(43)}, r"q_body has shape \(43,\); \(29,\)"),
        ({"q_rhand": np.full(7, np.nan)}, r"q_rhand is not finite at \[0\]"),
        ({"T_world_base": np.diag([1.0, 1.0, 1.1, 1.0])}, "no rotation"),
        ({"images": {"head": np.zeros((4, 4, 3))}}, "image 'head' is float64"),
        ({"images": {"head": np.zeros((3, 4, 4), dtype=np.uint8)}}, "image 'head'"),
    ],
)
def test_a_malformed_observation_is_refused(change, complaint):
    with pytest.raises(ObservationError, match=complaint):
        dataclasses.replace(observation(), **change).validate()
