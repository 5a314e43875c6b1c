"""Strategy: the panels of a plot are looked at as matplotlib has them."""

import subprocess
import sys

import imageio.v3
import numpy as np
import pytest
from matplotlib.figure import Figure

from tests.support.recordings import made_record, stepped_record
from wholebody.sim.pictures import plot as plotting
from wholebody.sim.pictures.plot import plot


def panel(draw, record):
    axes = Figure().subplots()
    draw(axes, record, record["time"])
    return axes


def levels(axes):
    """Where dashed bounds are."""
    return {round(float(line.get_ydata()[0]), 6) for line in axes.get_lines() if line.get_color() == plotting.BOUND}


@pytest.fixture
def record():
    measured = np.tile(np.eye(4), (3000, 2, 1, 1))
    measured[1234, 0, 0, 3] = 0.3
    asked = np.zeros((3000, 43))
    asked[:, 3], asked[50, 20] = 5.0, 12.0
    planning = np.repeat([0.0, 0.04, 0.06], 1000)
    changed = {"T_world_palms_measured": measured, "torque_asked": asked, "planning_time": planning}
    return made_record(3000, balance_margin=np.array(0.02), **changed)


def test_a_recording_of_one_period_before_any_chunk_is_plotted(tmp_path):
    record = made_record(1, T_world_palms_asked=np.full((1, 2, 4, 4), np.nan), pressure_margin=np.array([np.nan]))
    plot(record, tmp_path / "run.png")
    assert (tmp_path / "run.png").stat().st_size > 10_000


def test_errors_have_the_bounds_of_the_verdict_and_no_peak_is_lost(record):
    axes = panel(plotting._errors, record)
    assert levels(axes) == {20.0, 50.0}
    assert max(line.get_ydata().max() for line in axes.get_lines()[:4]) == pytest.approx(300.0)


def test_an_orientation_that_is_free_has_no_bound(record):
    assert levels(panel(plotting._turns, record)) == {10.0, 25.0}
    free = made_record(100, orientation_free=np.array([1, 1]))
    assert levels(panel(plotting._turns, free)) == set()


def test_c7_margins_have_the_edge_and_the_margin_of_the_configuration(record):
    assert levels(panel(plotting._margins, record)) == {0.0, 20.0}


def test_torques_are_shares_of_the_limits_and_the_worst_joint_is_named(record):
    axes = panel(plotting._torques, record)
    assert levels(axes) == {1.0}
    assert axes.get_lines()[0].get_ydata().max() == pytest.approx(1.2)
    name = str(record["motor_names"][3]).removesuffix("_joint").replace("_", " ")
    assert f"{name} is the worst" in [line.get_label() for line in axes.get_lines()]


def test_a_plan_is_a_point_with_its_time_beside_the_lead(record):
    axes = panel(plotting._speed, record)
    (beside,) = (other for other in axes.figure.axes if other is not axes)
    points, lead = beside.get_lines()
    assert points.get_ydata() == pytest.approx([40.0, 60.0])
    assert lead.get_ydata()[0] == 100.0


def test_a_robot_that_makes_steps_is_seen_from_above(tmp_path):
    axes = panel(lambda axes, record, time: plotting._from_above(axes, record), stepped_record())
    assert [text.get_text().splitlines()[0] for text in axes.texts] == ["0", "0", "1"]
    heights = []
    for name, record in (("stands", made_record(30)), ("steps", stepped_record())):
        plot(record, tmp_path / f"{name}.png")
        heights.append(imageio.v3.imread(tmp_path / f"{name}.png").shape[0])
    assert heights[0] < heights[1]


def test_matplotlib_is_loaded_only_to_plot():
    code = "import sys, wholebody.sim.pictures.plot, wholebody.cli.commands.plot; print('matplotlib' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
