"""Strategy: the bound on palm errors where hands are asked to overlap is held against hands that move by less."""

from dataclasses import replace

import numpy as np

from policy.scripted.policy import ScriptedPolicy
from tests.support.lissajous_variants import hand_distances, least_displacement, variant
from wholebody.config import TrajectoryConfig

PERIOD = 0.5
"""Between the instants that are looked at [s]."""


def moved_apart(policy, times, shift):
    """The script with its left palm elsewhere by ``shift`` (n, 3) [m] at ``times`` (n,), the right one by as much the
    other way.
    """

    def script(t):
        motion, by = policy.script(t), np.stack([np.interp(t, times, x) for x in shift.T], axis=1)
        return replace(motion, p_world_lpalm=motion.p_world_lpalm + by, p_world_rpalm=motion.p_world_rpalm - by)

    return ScriptedPolicy("apart", script, policy.duration)


def test_hands_that_move_by_less_than_the_bound_are_still_too_near_each_other():
    policy, clearance, rng = variant(3), TrajectoryConfig().self_distance, np.random.default_rng(0)
    times, distances = hand_distances(policy, PERIOD)
    bound = least_displacement(distances, clearance)
    near = bound > 0.0
    assert near.sum() > 5
    assert (bound[~near] == 0.0).all()
    for direction in [[0.0, 1.0, 0.0], *rng.normal(size=(5, 3))]:
        away = 0.99 * bound[:, None] * direction / np.linalg.norm(direction)
        _, moved = hand_distances(moved_apart(policy, times, away), PERIOD)
        assert (moved[near] < clearance).all()
