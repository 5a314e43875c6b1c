"""A target that is repeated, with the real controller: it stands still in the stance and moves on in the pelvis.

Strategy: both palms reach low ahead, which brings the pelvis down and tilts it; then the numbers of that place are
decoded anew at each observation. Longer, and with numbers for the documents: ``benchmarks/stance_frame.py``.
"""

import pytest

from models import g1
from policy import builtin
from tests.support.repeated_target import drift
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant

HELD = 1.5
"""How long the numbers are repeated [s]."""
STILL = 1e-3
"""What a palm may drift in the stance [m]."""


@pytest.fixture(scope="module")
def robot():
    return Supervisor(g1()), MujocoPlant(g1())


def test_a_repeated_target_stands_still_in_the_stance_and_moves_on_in_the_pelvis(robot):
    found = {}
    for name in ("wbc32", "wbc32-v1"):
        result, times, away = drift(builtin(name), *robot, held=HELD)
        assert result.fall is None
        assert times[-1] > HELD - 0.1
        found[name] = away.max()
    assert found["wbc32"] <= STILL
    assert found["wbc32-v1"] >= 5.0 * STILL
