"""Strategy: a thousand pairs of wrist poses from random postures inside all bounds; Pinocchio judges the answers."""

import time

import numpy as np
import pinocchio as pin
import pytest

from models.g1 import g1
from tests.support.posture_cases import PostureCases
from wholebody.config import ControllerConfig
from wholebody.planning.posture import PostureSolver

pytestmark = [pytest.mark.regression, pytest.mark.timeout(0)]

PAIRS, SEED = 1000, 11
SHARE, MEDIAN_MS = 0.98, 20.0


def test_joint_targets_for_a_thousand_pairs_of_wrist_poses_are_balanced():
    spec, config = g1(), ControllerConfig()
    cases, solver, generator = PostureCases(spec, config), PostureSolver(spec, config), np.random.default_rng(SEED)
    solver.solve(*cases.wrist_poses(cases.body.q_full))
    reached, times = 0, []
    for _ in range(PAIRS):
        targets = cases.wrist_poses(cases.draw(generator))
        begin = time.perf_counter()
        found = solver.solve(*targets)
        times.append(1e3 * (time.perf_counter() - begin))
        assert found.reached or found.reasons
        assert cases.keeps_bounds(found.q)
        pairs = zip(cases.wrist_poses(found.q), targets, strict=True)
        position, turn = np.array([_error(*pair) for pair in pairs]).T
        reached += bool(position.max() <= 1e-3 and turn.max() <= np.deg2rad(0.2))
    print(f"{reached} of {PAIRS} pairs, median {np.median(times):.1f} ms, 99 % {np.percentile(times, 99):.0f} ms")
    assert reached >= SHARE * PAIRS
    assert np.median(times) <= MEDIAN_MS


def _error(T, wanted):
    return np.linalg.norm(T[:3, 3] - wanted[:3, 3]), np.linalg.norm(pin.log3(T[:3, :3].T @ wanted[:3, :3]))
