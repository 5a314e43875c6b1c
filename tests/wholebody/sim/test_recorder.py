"""Strategy: a short run on hand-made commands is recorded, read back without pickle, and drawn where OpenGL is."""

from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest

from models.g1 import g1
from wholebody.errors import InputError, RenderError
from wholebody.sim import render as rendering
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.recorder import Recorder
from wholebody.sim.render import render
from wholebody.types import JointCommand, Status, StatusReport

SPEC = g1()
STEPS = 20


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    plant = MujocoPlant(SPEC, scene="table_cylinder")
    recorder = Recorder(tuple(sorted(SPEC.joint_names)), SPEC.joint_names, "table_cylinder")
    state, zero = plant.reset(), np.zeros(SPEC.n_joints)
    palms = {"left": np.eye(4), "right": np.eye(4)}
    for _ in range(STEPS):
        command = JointCommand(state.time, plant.joint_positions().copy(), zero, zero, SPEC.kp, SPEC.kd)
        recorder.add(state, command, palms, StatusReport(Status.HOLD, "no_chunk"), plant)
        state = plant.step(command)
    path = tmp_path_factory.mktemp("recording") / "run.npz"
    recorder.save(path)
    return path


def drawn(recording, output):
    """Whether it could be drawn here; if not, the message must say what to install."""
    problem = ""
    try:
        render(recording, output)
    except RenderError as error:
        problem = str(error)
    assert not problem or ("libegl1" in problem and "libosmesa6" in problem)
    return not problem


def test_every_column_has_a_row_a_control_period(recording):
    with np.load(recording, allow_pickle=False) as data:
        assert data["q"].shape == (STEPS, 50)
        assert data["torque"].shape == data["tau_command"].shape == (STEPS, 43)
        assert data["objects"].shape == (STEPS, 1, 7)
        assert np.allclose(np.diff(data["time"]), 0.002)
        assert set(data["status"]) == {"hold"}
        assert data["foot_force"][-1] > 0.0
        # A row tells what the motors gave at the end of the period before.
        assert not data["torque"][0].any()
        assert data["torque"][-1].any()
        assert str(data["scene"]) == "table_cylinder"


def test_a_cleared_recorder_begins_anew():
    recorder = Recorder((), ())
    recorder._rows["time"] = [0.0]
    recorder.clear()
    assert recorder.arrays() == {}


def test_a_sheet_is_drawn_or_the_missing_libraries_are_named(recording, tmp_path):
    output = tmp_path / "sheet.png"
    if drawn(recording, output):
        image = iio.imread(output)
        assert image.shape == (2 * rendering.HEIGHT, 3 * rendering.WIDTH, 3)
        assert image.std() > 20.0  # not one colour


def test_a_video_is_drawn_or_the_missing_libraries_are_named(recording, tmp_path):
    output = tmp_path / "run.mp4"
    if drawn(recording, output):
        assert output.stat().st_size > 1000


def test_without_any_opengl_the_packages_to_install_are_named(recording, tmp_path, monkeypatch):
    monkeypatch.setattr(rendering, "LIBRARIES", {"nothing": "libnothing1"})
    with pytest.raises(RenderError, match="libnothing1"):
        render(recording, tmp_path / "sheet.png")


def test_a_child_that_takes_too_long_is_given_up(recording, tmp_path):
    with pytest.raises(RenderError, match="took longer than"):
        render(recording, tmp_path / "sheet.png", timeout=0.01)


@pytest.mark.parametrize("name", ["run.mp4", "sheet.png"])
def test_ctrl_c_in_mid_video_leaves_the_whole_file_from_before_or_none(recording, tmp_path, monkeypatch, name):
    def broken_off(backend, recording, output, timeout):
        Path(output).write_bytes(b"half of it")
        raise KeyboardInterrupt

    monkeypatch.setattr(rendering, "_child", broken_off)
    output = tmp_path / "pictures" / name
    output.parent.mkdir()
    for before in (None, b"whole"):
        if before:
            output.write_bytes(before)
        with pytest.raises(KeyboardInterrupt):
            render(recording, output)
        assert [path.name for path in output.parent.iterdir()] == ([name] if before else [])
    assert output.read_bytes() == b"whole"


@pytest.mark.parametrize("name", ["run.gif", "run"])
def test_an_unknown_ending_is_refused_with_those_that_work(recording, tmp_path, name):
    with pytest.raises(InputError, match=r"\.mp4"):
        render(recording, tmp_path / name)


def test_a_missing_recording_is_named(tmp_path):
    with pytest.raises(InputError, match="no recording"):
        render(tmp_path / "none.npz", tmp_path / "sheet.png")
