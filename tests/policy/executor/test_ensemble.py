"""Strategy: averages of known chunks: agreement changes nothing, weights are ACT's, nothing jumps at a chunk's end."""

import dataclasses

import numpy as np
import pytest

from policy.errors import ChunkError
from policy.executor.ensemble import TAPER, TemporalEnsemble, mean_rotation
from policy.executor.executor import ExecutorConfig
from policy.executor.simulated import simulated_executor
from policy.geometry.rotations import rotation_residual, rotvec_to_matrix
from policy.scripted.library import scripted_policy
from tests.support.policy_cases import observation


def chunks(*times, name="wave"):
    policy = scripted_policy(name)
    policy.reset()
    return [policy.infer(observation(time)) for time in times]


def shifted(chunk, metres):
    T = chunk.T_world_lhand.copy()
    T[:, 0, 3] += metres
    return dataclasses.replace(chunk, T_world_lhand=T)


def test_the_first_chunk_is_passed_on_as_it_is():
    (chunk,) = chunks(0.0)
    assert TemporalEnsemble().add(chunk) is chunk


def test_chunks_that_agree_are_not_changed():
    ensemble, pair = TemporalEnsemble(), chunks(0.0, 0.5)
    ensemble.add(pair[0])
    mean = ensemble.add(pair[1])
    # The older one is interpolated linearly between its steps, hence a tenth of a millimetre.
    np.testing.assert_allclose(mean.T_world_rhand, pair[1].T_world_rhand, atol=2e-4)
    assert (mean.seq, mean.t_obs) == (1, 0.5)
    mean.validate(after=pair[0])


def test_weights_are_those_of_act_oldest_first():
    ensemble, pair = TemporalEnsemble(decay=0.5), chunks(0.0, 0.1)
    ensemble.add(pair[0])
    mean = ensemble.add(shifted(pair[1], 0.1))
    newest = np.exp(-0.5) / (1.0 + np.exp(-0.5))
    np.testing.assert_allclose((mean.T_world_lhand - pair[1].T_world_lhand)[0, 0, 3], 0.1 * newest, atol=1e-3)


def test_the_older_chunk_fades_out_before_its_end_without_a_jump():
    ensemble, pair = TemporalEnsemble(decay=0.0), chunks(0.0, 0.5)
    ensemble.add(shifted(pair[0], -0.1))
    mean = ensemble.add(pair[1])
    offset = (mean.T_world_lhand - pair[1].T_world_lhand)[:, 0, 3]
    end = pair[0].times[-1]
    assert np.abs(offset[pair[1].times >= end]).max() == 0.0
    np.testing.assert_allclose(offset[pair[1].times < end - TAPER], -0.05, atol=1e-3)
    assert np.abs(np.diff(offset)).max() < 0.05 / 3


def test_a_chunk_that_is_over_no_longer_counts_and_only_so_many_do(monkeypatch):
    monkeypatch.setattr("policy.executor.ensemble.CHUNKS_MAX", 2)
    ensemble, trio = TemporalEnsemble(decay=0.0), chunks(0.0, 0.1, 5.0)
    ensemble.add(shifted(trio[0], 0.3))
    ensemble.add(trio[1])
    assert ensemble.add(trio[2]) is trio[2]
    many = chunks(0.0, 0.1, 0.2)
    ensemble.reset()
    ensemble.add(shifted(many[0], 0.3))
    ensemble.add(many[1])
    mean = ensemble.add(many[2])
    np.testing.assert_allclose(mean.T_world_lhand, many[2].T_world_lhand, atol=1e-3)


def test_a_refused_chunk_is_forgotten():
    ensemble, trio = TemporalEnsemble(decay=0.0), chunks(0.0, 0.1, 0.2)
    ensemble.add(trio[0])
    ensemble.add(shifted(trio[1], 1.0))
    ensemble.drop_newest()
    mean = ensemble.add(trio[2])
    np.testing.assert_allclose(mean.T_world_lhand, trio[2].T_world_lhand, atol=1e-3)


def test_another_layout_is_refused():
    ensemble, (chunk,) = TemporalEnsemble(), chunks(0.0)
    ensemble.add(chunk)
    with pytest.raises(ChunkError, match="cannot be averaged"):
        ensemble.add(dataclasses.replace(chunk, spec_id="joint28", seq=1, t_obs=0.5))


def test_the_mean_of_two_rotations_lies_half_way_between_them():
    axis = np.array([0.6, 0.0, 0.8])
    R = rotvec_to_matrix(np.array([0.2, 1.4])[:, None] * axis)[:, None]
    mean = mean_rotation(R, np.full((2, 1), 0.5))
    np.testing.assert_allclose(mean[0], rotvec_to_matrix(0.8 * axis), atol=1e-12)
    assert rotation_residual(mean).max() < 1e-12


def test_rotations_that_cancel_out_give_the_newest():
    R = rotvec_to_matrix(np.array([[0.0, 0.0, 0.0], [np.pi, 0.0, 0.0]]))[:, None]
    np.testing.assert_allclose(mean_rotation(R, np.full((2, 1), 0.5))[0], R[1, 0])


def test_a_decay_that_makes_no_sense_is_refused():
    with pytest.raises(ValueError, match="decay is nan"):
        TemporalEnsemble(float("nan"))


def test_an_executor_averages_if_told_so_and_halves_the_noise_of_four_chunks():
    noise, rng = 0.01, np.random.default_rng(0)

    def spread(ensemble):
        policy = scripted_policy("wave")
        exact, script = policy.infer, scripted_policy("wave").script
        policy.infer = lambda seen: shifted(exact(seen), noise * rng.normal(size=50))
        runner = simulated_executor(policy, config=ExecutorConfig(replace_every=5, ensemble=ensemble))
        runner.reset()
        offsets = []
        for time in 0.002 * np.arange(2500):
            runner.clock.set(time)
            chunk = runner.poll(lambda: observation(runner.clock.now()))
            if chunk is not None and time > 1.0:
                motion = script(chunk.times)
                palm = chunk.T_world_lhand[:, :3, 3] - motion.p_world_lpalm
                offsets.append((palm - palm.mean(axis=0))[:10, 0])
        return float(np.std(offsets))

    assert spread(0.0) < 0.5 * spread(None)
