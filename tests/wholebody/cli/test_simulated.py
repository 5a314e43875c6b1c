"""Strategy: the options about time that planning takes, as settings of the supervisor."""

import pytest

from wholebody.cli.options import Simulation
from wholebody.cli.simulated import planning
from wholebody.config import PlanningConfig


def test_nothing_said_leaves_the_settings_as_they_are():
    config = PlanningConfig(lead=0.2)
    assert planning(config, Simulation()) is config


def test_a_fixed_time_is_latency_and_lead():
    config = planning(PlanningConfig(latency="measured", factor=2.0), Simulation(planning_ms=300.0))
    assert (config.lead, config.latency, config.factor) == (0.3, "fixed", 1.0)


def test_measured_times_are_multiplied():
    config = planning(PlanningConfig(), Simulation(planning_times=3.0))
    assert (config.lead, config.latency, config.factor) == (0.1, "measured", 3.0)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"planning_ms": -1.0}, "--planning-ms is -1 ms"),
        ({"planning_times": float("nan")}, "--planning-times is nan"),
        ({"planning_ms": 100.0, "planning_times": 1.0}, "give one of them"),
    ],
)
def test_what_cannot_be_is_refused(options, said):
    with pytest.raises(ValueError, match=said):
        planning(PlanningConfig(), Simulation(**options))
