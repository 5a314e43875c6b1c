"""Strategy: a device that is always full, and a writer that fails half-way."""

import os

import numpy as np
import pytest

from policy.recorded.motion_csv import Motion, write_motion_csv
from policy.writing import OutputError, whole, write_text


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
def test_a_full_disk_is_said_with_the_name_of_the_file():
    with pytest.raises(OutputError, match=r"^cannot write '/dev/full': No space left on device$"):
        write_text("/dev/full", "x" * 100_000)


def test_where_writing_fails_what_was_there_stays_and_nothing_else_is_left(tmp_path):
    file = tmp_path / "a.txt"
    write_text(file, "before")
    with pytest.raises(OutputError, match=r"cannot write '.*a\.txt'"):
        half(file)
    with pytest.raises(ValueError, match="another"), whole(tmp_path / "b.txt"):
        raise ValueError("another fault")
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]
    assert file.read_text() == "before"


def half(file):
    with whole(file) as place:
        place.write_text("half")
        raise OSError(28, "No space left on device")


def test_a_motion_leaves_no_empty_file(tmp_path):
    motion = Motion(60.0, np.tile(np.eye(4), (3, 1, 1)), np.zeros((3, 29)))
    with pytest.raises(OutputError):
        write_motion_csv(tmp_path / "none" / "a.csv", motion)
    write_motion_csv(tmp_path / "a.csv", motion)
    assert (tmp_path / "a.csv").stat().st_size > 0
    assert (tmp_path / "a.csv").stat().st_mode & 0o400
