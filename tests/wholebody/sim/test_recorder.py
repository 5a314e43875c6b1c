"""Strategy: a short run on hand-made commands is recorded and read back without pickle; a real episode is recorded, and
its columns agree with what the episode itself says of its errors and margins.
"""

import numpy as np
import pytest

from models import g1
from policy.scripted.library import scripted_policy
from tests.support.recordings import plant_recording
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.record import COLUMNS, read_record
from wholebody.sim.recorder import Recorder

SPEC = g1()
STEPS = 20


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    return read_record(plant_recording(tmp_path_factory.mktemp("recording") / "run.npz", STEPS))


@pytest.fixture(scope="module")
def episode():
    recorder, policy = Recorder(SPEC), scripted_policy("wave")
    config = EpisodeConfig(settle=0.1, hold=0.1)
    result = run_episode(policy, Supervisor(SPEC), MujocoPlant(SPEC), duration=0.8, config=config, recorder=recorder)
    return recorder, result


def test_every_column_has_a_row_a_control_period(record):
    assert len(record) == STEPS
    assert record["q"].shape == (STEPS, 50)
    assert record["torque"].shape == record["tau_command"].shape == (STEPS, 43)
    assert record["objects"].shape == (STEPS, 1, 7)
    assert np.allclose(np.diff(record["time"]), 0.002)
    assert record["foot_force"][-1] > 0.0
    assert str(record["scene"]) == "table_cylinder"


def test_a_row_tells_what_the_motors_gave_at_the_end_of_the_period_before(record):
    assert not record["torque"][0].any()
    assert record["torque"][-1].any()
    assert (record["torque_asked"] >= np.abs(record["torque"]) - 1e-9).all()


def test_a_row_tells_status_reason_and_what_was_said(record):
    half = STEPS // 2
    assert set(record["status"][:half]) == {"hold"}
    assert set(record["reason"][half:]) == {"out_of_reach"}
    assert record["details"][record["detail"]][[0, -1]].tolist() == ["no chunk yet", "targets moved"]
    assert record["rate"][-1] == 0.9
    assert record["planning_time"][-1] == 0.03


def test_nothing_is_asked_before_the_first_chunk_and_then_it_is_told(record):
    half, errors = STEPS // 2, record.palm_errors()
    assert np.isnan(errors[:half]).all()
    assert np.abs(record.palm_errors("asked", "commanded")[half:] - 0.1).max() < 1e-9
    # Nothing holds the arms up but the gains.
    assert record.palm_errors("commanded", "measured").max() < 0.01
    assert np.abs(errors[half:] - 0.1).max() < 0.01


def test_a_recorder_begins_anew_with_every_run(episode):
    recorder = Recorder(SPEC)
    assert recorder.arrays() == {}
    assert set(episode[0].arrays()) == set(COLUMNS)


def test_the_asked_palms_are_those_that_the_errors_of_the_episode_are_measured_against(episode):
    recorder, result = episode
    record = recorder.record()
    time, asked = record["time"], np.isfinite(record.palm_errors()[:, 0])
    # The first step is due between the last period before the chunk and the first one with it.
    scored = result.times >= time[asked][0]
    assert scored.sum() >= 20

    def at_steps(columns):
        return np.array([np.interp(result.times[scored], time[asked], columns[asked, hand]) for hand in (0, 1)]).T

    assert np.abs(at_steps(record.palm_errors()) - result.errors[scored]).max() < 1e-4
    assert np.abs(at_steps(record.palm_turns()) - result.turns[scored]).max() < 1e-3
    # Commanded palms were compared with those asked for a control period later: 0.4 mm at 0.2 m/s.
    assert np.abs(at_steps(record.palm_errors("asked", "commanded")) - result.palms.moved[scored]).max() < 1e-4


def test_the_margin_is_that_of_the_verdict(episode):
    recorder, result = episode
    assert np.nanmin(recorder.record()["pressure_margin"][1:]) == pytest.approx(result.margin, abs=1e-3)


def test_the_time_that_plans_took_and_the_speed_are_told(episode):
    record = episode[0].record()
    assert record["planning_time"][0] == 0.0
    assert 0.0 < record["planning_time"][-1] < 120.0
    assert record["rate"].max() <= 1.0 + 1e-9
