"""Strategy: loads that nobody tells the controller, in MuJoCo; the whole study is `python -m tests.studies.loads`."""

import numpy as np
import pytest

from policy.scripted.library import reach
from tests.support.carried import SPEC, Changed, still
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant

SHORT = EpisodeConfig(settle=0.5, hold=0.5)


@pytest.fixture(scope="module")
def supervisor():
    return Supervisor(SPEC)


def test_half_a_kilo_in_each_hand_is_carried_to_where_it_used_to_fall(supervisor):
    plant = MujocoPlant(SPEC, payload_kg=(0.5, 0.5))
    result = run_episode(reach(0.50, 1.00), supervisor, plant, duration=4.0, config=SHORT)
    assert result.fall is None
    assert result.errors[-1].max() < 5e-3
    assert np.rad2deg(result.turns[-1].max()) < 20.0


def test_two_kilos_put_into_a_hand_while_it_waits_are_planned_for_and_let_go_of_again(supervisor):
    plant = Changed(SPEC, payload_kg=(1e-4, 1e-4))
    plant.after, plant.at = (2.0, 1e-4), 0.2
    result = run_episode(still(2.5), supervisor, plant, duration=2.5, config=SHORT)
    assert result.fall is None
    assert result.errors[-1].max() < 5e-3
    assert supervisor.carrying.loads.masses[0] == pytest.approx(2.0, abs=0.05)
    plant.before, plant.after, plant.at = (2.0, 1e-4), (1e-4, 1e-4), 1.0
    result = run_episode(still(1.5), supervisor, plant, duration=1.5, config=SHORT)
    assert result.fall is None
    assert supervisor.carrying.loads.masses == (0.0, 0.0)
