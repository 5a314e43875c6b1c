"""Strategy: a short run is drawn where OpenGL is, and what a person would look for is looked for in the pixels; where
there is none, the message must say what to install. Words and legend are drawn without OpenGL.
"""

from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest

from policy.errors import FileFormatError
from tests.support.recordings import made_record, plant_recording, save
from wholebody.errors import InputError, RenderError
from wholebody.sim.pictures import render as rendering
from wholebody.sim.pictures.caption import CAPTION, captioned, legend
from wholebody.sim.pictures.drawing import DISTANCE, FURTHEST, GIF_WIDTH, HEIGHT, LOOK_AT, WIDTH, camera_way, view
from wholebody.sim.pictures.render import render
from wholebody.sim.pictures.scene import scene_at

TILE = HEIGHT + CAPTION


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return plant_recording(tmp_path_factory.mktemp("recording") / "run.npz")


def drawn(recording, output, progress=None):
    """Whether it could be drawn here; if not, the message must say what to install."""
    problem = ""
    try:
        render(recording, output, progress=progress)
    except RenderError as error:
        problem = str(error)
    assert not problem or ("libegl1" in problem and "libosmesa6" in problem)
    return not problem


def red(image):
    """How many pixels have the colour of the error lines."""
    r, g, b = np.moveaxis(image[..., :3].astype(int), -1, 0)
    return int(((r > 150) & (g < 110) & (b < 110)).sum())


def test_a_sheet_is_drawn_or_the_missing_libraries_are_named(recording, tmp_path):
    output, frames = tmp_path / "sheet.png", []
    if not drawn(recording, output, lambda done, total: frames.append((done, total))):
        pytest.skip("no OpenGL here to draw with")
    image = iio.imread(output)
    assert image.shape == (2 * TILE + legend(3 * WIDTH).shape[0], 3 * WIDTH, 3)
    assert image.std() > 20.0  # not one colour
    assert frames == [(k + 1, 6) for k in range(6)]
    # Asked 10 cm higher from the middle on: the last picture shows it, the first one does not.
    first, last = image[CAPTION:TILE, :WIDTH], image[TILE + CAPTION : 2 * TILE, 2 * WIDTH :]
    assert red(last) > red(first) + 60


def test_the_camera_goes_up_and_back_for_raised_hands_and_stays_otherwise():
    T = np.tile(np.eye(4), (2, 2, 1, 1))
    T[:, :, :3, 3] = (0.3, 0.2, 0.9)
    calm = {f"T_world_palms_{which}": T for which in ("measured", "commanded")}
    calm |= {"soles": np.zeros((2, 8, 2)), "time": np.arange(2.0)}
    look_at, distance = view(calm, 45.0)
    assert look_at == pytest.approx(LOOK_AT)
    assert distance == DISTANCE
    raised = T.copy()
    raised[1, 0, :3, 3] = (0.1, 0.2, 1.7)
    look_at, distance = view({**calm, "T_world_palms_measured": raised}, 45.0)
    assert LOOK_AT[2] < look_at[2] < 1.0
    assert DISTANCE < distance < FURTHEST
    assert view({**calm, "T_world_palms_commanded": 9.0 * raised}, 45.0)[1] == FURTHEST


def test_the_camera_goes_along_with_a_robot_that_walks_and_stays_before_one_that_steps():
    """It stayed, and a robot that came nearer for 12 s had its legs out of the picture."""
    time = np.linspace(0.0, 12.0, 601)
    T = np.tile(np.eye(4), (601, 2, 1, 1))
    ahead = np.minimum(0.3 * time, 3.0)
    T[:, :, 0, 3], T[:, :, 2, 3] = 0.3 + ahead[:, None], 0.9
    soles = np.zeros((601, 8, 2))
    assert not camera_way({"soles": soles + 0.1, "time": time}).any()
    soles[..., 0] = ahead[:, None]
    walk = {"soles": soles, "time": time} | {f"T_world_palms_{which}": T for which in ("measured", "commanded")}
    way = camera_way(walk)
    assert way[0] == pytest.approx(0.0, abs=1e-9)
    assert way[-1] == pytest.approx([2.5, 0.0, 0.0])
    assert np.abs(way[:, 0] - np.maximum(ahead - 0.5, 0.0)).max() < 0.1
    assert view(walk, 45.0)[1] == DISTANCE


def test_a_video_is_drawn_or_the_missing_libraries_are_named(recording, tmp_path):
    output = tmp_path / "run.mp4"
    if drawn(recording, output):
        assert output.stat().st_size > 1000
        frame = iio.imread(output, index=0, plugin="FFMPEG")
        assert frame.shape[:2] == (TILE + legend(WIDTH).shape[0], WIDTH)
        assert frame.shape[0] % 16 == 0


def test_an_animation_is_small(recording, tmp_path):
    output = tmp_path / "run.gif"
    if drawn(recording, output):
        pictures = iio.imread(output, index=None)
        assert pictures.shape[2] == GIF_WIDTH
        assert output.stat().st_size < 60_000 * len(pictures)
        assert pictures[0].std() > 20.0  # not one colour


def test_a_caption_says_when_what_and_why_above_the_picture():
    image, scene = np.full((HEIGHT, WIDTH, 3), 128, dtype=np.uint8), scene_at(made_record(3), 0)
    plain, chosen = captioned(image, scene), captioned(image, scene, "end; " + 20 * "smallest balance margin: 3 mm; ")
    assert (plain[CAPTION:] == image).all()
    assert plain.shape == chosen.shape == (TILE, WIDTH, 3)
    assert (plain[: CAPTION // 3] < 100).sum() < (chosen[: CAPTION // 3] < 100).sum()


def test_without_any_opengl_the_packages_to_install_are_named(recording, tmp_path, monkeypatch):
    monkeypatch.setattr(rendering, "LIBRARIES", {"nothing": "libnothing1"})
    with pytest.raises(RenderError, match="libnothing1"):
        render(recording, tmp_path / "sheet.png")


def test_a_child_that_takes_too_long_for_a_frame_is_given_up(recording, tmp_path):
    with pytest.raises(RenderError, match="took longer than"):
        render(recording, tmp_path / "sheet.png", timeout=0.01)


@pytest.mark.parametrize("name", ["run.mp4", "sheet.png"])
def test_c6_ctrl_c_in_mid_video_leaves_the_whole_file_from_before_or_none(recording, tmp_path, monkeypatch, name):
    def broken_off(backend, recording, output, *_):
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


def test_ctrl_c_ends_the_process_that_draws(recording, tmp_path, monkeypatch):
    children = []

    class Child(rendering.subprocess.Popen):
        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            children.append(self)

    class Waiting(rendering.SimpleQueue):
        def get(self, *_, **__):
            raise KeyboardInterrupt

    monkeypatch.setattr(rendering.subprocess, "Popen", Child)
    monkeypatch.setattr(rendering, "SimpleQueue", Waiting)
    with pytest.raises(KeyboardInterrupt):
        render(recording, tmp_path / "run.mp4")
    assert [child.poll() is None for child in children] == [False]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["run.avi", "run"])
def test_an_unknown_ending_is_refused_with_those_that_work(recording, tmp_path, name):
    with pytest.raises(InputError, match=r"\.mp4"):
        render(recording, tmp_path / name)


def test_a_damaged_recording_is_not_taken_for_a_lack_of_opengl(tmp_path):
    damaged = save(made_record(3, q=np.full((3, 50), np.nan)), tmp_path / "run.npz")
    with pytest.raises(FileFormatError, match="'q' that is not finite"):
        render(damaged, tmp_path / "sheet.png")


def test_a_missing_recording_is_named(tmp_path):
    with pytest.raises(InputError, match="no recording"):
        render(tmp_path / "none.npz", tmp_path / "sheet.png")
