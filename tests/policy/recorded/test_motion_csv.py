"""Motion files. Strategy: a motion with a wandering pelvis is written here, and must come back without its pelvis."""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from policy import Anchor, FileFormatError, motion_chunk, read_motion_csv, write_motion_csv
from policy.geometry.rotations import angle_between
from policy.kinematics.forward import kinematics
from policy.recorded.convert import convert
from policy.recorded.motion_csv import ROOT_COLUMNS, named_rate
from policy.recorded.replay import open_recording
from tests.support.policy_cases import made_up_motion


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "swing.csv"
    write_motion_csv(path, made_up_motion())
    return path


def test_a_motion_comes_back_to_its_six_digits(file):
    motion, expected = read_motion_csv(file), made_up_motion()
    assert len(motion) == 121
    assert motion.duration == pytest.approx(2.0)
    assert np.abs(motion.q_body - expected.q_body).max() < 1e-6
    assert np.abs(motion.T_world_base - expected.T_world_base).max() < 5e-6


def test_wrists_are_relative_to_each_frames_own_pelvis(file):
    motion = read_motion_csv(file)
    chunk = motion_chunk(motion)
    assert len(chunk) == 61
    poses = kinematics().poses(motion.q_body[::2])
    anchor = Anchor.nominal().T_world_base
    # 60 Hz to 30 Hz: every other frame, untouched.
    assert np.abs(chunk.T_world_lhand - anchor @ poses["lhand"]).max() < 1e-12
    assert np.abs(chunk.T_world_rhand - anchor @ poses["rhand"]).max() < 1e-12


def test_fingers_are_neutral(file):
    chunk = motion_chunk(read_motion_csv(file))
    assert (chunk.q_lhand == Anchor.nominal().q_lhand).all()


def test_another_rate_is_interpolated_on_se3(tmp_path):
    fine, coarse = made_up_motion(501, 250.0), made_up_motion(101, 50.0)
    expected = motion_chunk(fine, fps=30.0)
    found = motion_chunk(coarse, fps=30.0)
    steps = min(len(found), len(expected))
    error = found.T_world_rhand[:steps] - expected.T_world_rhand[:steps]
    # A chord of a 20 ms interval at 10 m/s^2 is half a millimetre off at most.
    assert np.linalg.norm(error[:, :3, 3], axis=1).max() < 5e-4
    turn = angle_between(found.T_world_rhand[:steps, :3, :3], expected.T_world_rhand[:steps, :3, :3])
    assert np.rad2deg(turn).max() < 0.1


def test_the_frame_rate_scales_time(file):
    assert motion_chunk(read_motion_csv(file, fps=120.0)).times[-1] == pytest.approx(1.0)
    assert motion_chunk(read_motion_csv(file, fps=30.0)).times[-1] == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("count", "rate"), [(70, 50.0), (72, 50.0), (120, 60.0), (2, 50.0), (100, 29.97), (301, 120.0)]
)
def test_the_last_frame_is_the_last_step(count, rate):
    motion = made_up_motion(count, rate)
    chunk = motion_chunk(motion)
    last = Anchor.nominal().T_world_base @ kinematics().poses(motion.q_body)["rhand"][-1]
    assert chunk.times[-1] == pytest.approx(motion.duration, abs=1e-12)
    assert np.abs(chunk.T_world_rhand[-1] - last).max() < 1e-12
    assert len(chunk) - 1 == np.ceil(round(30.0 * motion.duration, 9))


def test_rows_that_jump_between_steps_are_said():
    motion = made_up_motion()
    assert len(motion_chunk(motion).notes) == 1  # of the feet
    motion.q_body[61, motion.robot.body_joints.index("right_elbow_joint")] += 1.0
    note = motion_chunk(motion).notes[-1]
    assert note.startswith("what happens in 1 of 121 rows, between steps of 30 Hz, is not followed: right hand ")
    assert " at row 61 (1.02 s)" in note


def test_a_chunk_that_becomes_a_motion_keeps_its_last_step(file, tmp_path):
    convert(file, tmp_path / "a.npz")
    convert(tmp_path / "a.npz", tmp_path / "b.csv", csv_fps=47.0)
    last = motion_chunk(read_motion_csv(tmp_path / "b.csv", fps=47.0)).T_world_rhand[-1, :3, 3]
    assert np.abs(last - motion_chunk(made_up_motion()).T_world_rhand[-1, :3, 3]).max() < 1e-3


def test_a_single_frame_is_one_step(tmp_path):
    path = tmp_path / "still.csv"
    write_motion_csv(path, made_up_motion(1))
    assert len(motion_chunk(read_motion_csv(path))) == 1


def test_blank_lines_and_windows_line_ends_are_fine(file):
    text = file.read_text()
    file.write_bytes(("\n" + text.replace("\n", "\r\n") + "\r\n").encode())
    assert len(read_motion_csv(file)) == 121


def edited(file, edit):
    rows = [line.split(",") for line in file.read_text().splitlines()]
    edit(rows)
    file.write_text("\n".join(",".join(row) for row in rows) + "\n")
    return file


@pytest.mark.parametrize(
    ("edit", "complaint"),
    [
        (lambda rows: rows[4].pop(), "line 5 has 35 columns; 36 are expected"),
        (lambda rows: rows[0].append("0"), "line 1 has 37 columns"),
        (lambda rows: rows[7].__setitem__(10, "nan"), r"line 8, column 11 \(left_knee_joint\) is nan"),
        (lambda rows: rows[7].__setitem__(0, "-inf"), r"line 8, column 1 \(x\) is -inf"),
        (lambda rows: rows[9].__setitem__(35, "2e9"), r"line 10, column 36 \(right_wrist_yaw_joint\) is 2e\+09"),
        (lambda rows: rows[9].__setitem__(3, "abc"), r"line 10, column 4 \(qx\) is 'abc', no number"),
        (lambda rows: rows[9].__setitem__(3, ""), "line 10, column 4"),
        (lambda rows: rows[3].__setitem__(slice(3, 7), ["0", "0", "0", "2"]), "line 4: columns 4 to 7 have norm 2"),
        (lambda rows: rows[3].__setitem__(slice(3, 7), ["0"] * 4), "must be the root quaternion in the order x y z w"),
        (lambda rows: rows.insert(0, [*ROOT_COLUMNS, *g1().body_joints]), "a file without a header is expected"),
        (lambda rows: rows.clear(), "is empty"),
    ],
)
def test_a_malformed_file_is_refused_with_row_and_column(file, edit, complaint):
    with pytest.raises(FileFormatError, match=complaint) as refusal:
        read_motion_csv(edited(file, edit))
    assert str(file) in str(refusal.value)


@pytest.mark.parametrize(
    ("edit", "hint"),
    [
        (lambda line: line.replace(",", " "), "a comma is expected between numbers"),
        (lambda line: f"0.1,{line}", "cut -d, -f2-"),
        (lambda line: ",".join(line.split(",")[:30]), "a G1 with 23 joints write a .npz"),
    ],
)
def test_a_table_of_another_form_is_answered_with_what_makes_it_one_that_is_read(file, edit, hint):
    file.write_text("".join(edit(line) + "\n" for line in file.read_text().splitlines()))
    with pytest.raises(FileFormatError, match=hint):
        read_motion_csv(file)


@pytest.mark.parametrize("fps", [0.0, -60.0, np.nan, np.inf])
def test_an_impossible_frame_rate_is_refused(file, fps):
    with pytest.raises(FileFormatError, match="positive rate"):
        read_motion_csv(file, fps)


def test_a_missing_file_and_a_binary_file_are_refused(tmp_path):
    with pytest.raises(FileFormatError, match="cannot be read"):
        read_motion_csv(tmp_path / "absent.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(FileFormatError, match="is no text"):
        read_motion_csv(tmp_path / "binary.csv")


@pytest.mark.parametrize(
    ("name", "rate"),
    [
        ("walk_30hz", 30.0),
        ("50FPS-dance", 50.0),
        ("take.fps120", 120.0),
        ("dance_30hz_60fps", None),
        ("a100 fpsx", None),
    ],
)
def test_a_name_that_says_a_rate_is_believed(name, rate):
    assert named_rate(f"{name}.csv") == rate


def test_a_rate_that_nobody_said_is_told_with_the_others_that_fit(tmp_path, file):
    """A recording of 30 Hz was taken for one of 60 Hz, and done twice as fast without a word."""
    *others, note = open_recording(file).episode.notes
    assert note.startswith("60 Hz assumed, the file does not say its frame rate (say --fps): 2.0 s in all")
    assert "30, 50, 100 or 120 Hz would fit too" in note
    assert list(open_recording(file, fps=60.0).episode.notes) == others
    assert convert(file, tmp_path / "swing.npz").notes[-1] == note
    named = file.rename(file.with_name("swing_30hz.csv"))
    episode = open_recording(named).episode
    assert episode.times[-1] == pytest.approx(4.0)
    assert episode.notes[-1] == "frame rate by the file's name: 30 Hz; if that is another, say --fps"


def test_a_rate_at_which_joints_would_be_too_fast_does_not_fit(tmp_path):
    motion = made_up_motion()
    q = motion.q_body.copy()
    q[::2, 15] += 0.3  # 18 rad/s at 60 Hz
    write_motion_csv(tmp_path / "fast.csv", replace(motion, q_body=q))
    note = open_recording(tmp_path / "fast.csv", read_as=("as_named",)).episode.notes[-1]
    assert "30 or 50 Hz would fit too" in note
