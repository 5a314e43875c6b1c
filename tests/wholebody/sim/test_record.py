"""Strategy: a recording made of numbers is read back; broken in one place at a time, it is refused in one sentence."""

import re
from pathlib import Path

import numpy as np
import pytest

from policy.errors import FileFormatError
from tests.support.recordings import made_record, save, stepped_record
from wholebody.sim.pictures.plot import PLOT_COLUMNS
from wholebody.sim.pictures.scene import SCENE_COLUMNS
from wholebody.sim.record import COLUMNS, CONSTANTS, PERIODS, read_record

ROOT = Path(__file__).resolve().parents[3]


def test_what_was_written_is_read(tmp_path):
    record = made_record(5)
    read = read_record(save(record, tmp_path / "run.npz"))
    assert set(read.arrays) == set(COLUMNS)
    for name in COLUMNS:
        assert (read[name] == record[name]).all(), name


@pytest.mark.parametrize("wanted", [PLOT_COLUMNS, SCENE_COLUMNS])
def test_what_draws_and_plots_reads_no_more_than_it_needs(tmp_path, wanted):
    assert set(wanted) <= set(COLUMNS)
    read = read_record(save(made_record(5), tmp_path / "run.npz"), wanted)
    assert set(read.arrays) == {*wanted, "version", "time"}


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"q": np.zeros((5, 50), dtype=object)}, "objects"),
        ({"q": np.zeros((5, 50), dtype=np.float32)}, "'q' of type float32; a number of 64 bits is expected"),
        ({"v": np.zeros((4, 49))}, r"'v' of shape \(4, 49\); \(n, nv\) is expected, where n is 5"),
        ({"time": np.zeros(5)}, "times that do not increase"),
        ({"time": np.array([0.0, 1.0, np.nan, 3.0, 4.0])}, "'time' that is not finite"),
        ({"rate": np.array([0.0, 1.0, 1e300, 3.0, 4.0])}, "'rate' that is not finite, or beyond 1e"),
        ({"lead": np.array(np.inf)}, "'lead' that is not finite"),
        ({"status": np.full(5, "\x1b[2Jfine")}, "unknown status"),
        ({"reason": np.full(5, "bored")}, "unknown reason 'bored'"),
        ({"detail": np.full(5, 2)}, "'detail' 2, and 2 of 'details'"),
        ({"contacts": np.full(5, -1)}, "'contacts'"),
        ({"scene": np.array("x" * 10_001)}, "'scene' of 10001 characters; at most 10000 are read"),
        ({"time": np.zeros(2_000_001)}, "has 2000001 control periods"),
        ({"version": np.array(7)}, "format 7; 2 is read"),
        ({"extra": np.zeros(3)}, "unknown array 'extra'"),
    ],
)
def test_a_broken_recording_is_refused_with_what_is_wrong(tmp_path, changed, says):
    path = save(made_record(5, **changed), tmp_path / "run.npz")
    with pytest.raises(FileFormatError, match=says) as refused:
        read_record(path)
    assert str(refused.value).isprintable()
    assert str(refused.value).startswith(str(path))


def test_a_chunk_file_is_no_recording(tmp_path):
    np.savez(tmp_path / "chunk.npz", actions=np.zeros((3, 32)))
    with pytest.raises(FileFormatError, match=r"chunk\.npz: is a chunk file, .*--record"):
        read_record(tmp_path / "chunk.npz")
    np.savez(tmp_path / "part.npz", time=np.arange(3.0))
    with pytest.raises(FileFormatError, match=r"no column 'T_world_palms_asked'.*--record"):
        read_record(tmp_path / "part.npz")


def test_a_recording_of_nothing_is_refused(tmp_path):
    with pytest.raises(FileFormatError, match="has 0 control periods; 1 to 2000000 are read"):
        read_record(save(made_record(0), tmp_path / "run.npz"))


def test_more_than_is_unpacked_is_refused_by_name(tmp_path, monkeypatch):
    path = save(made_record(50), tmp_path / "run.npz")
    monkeypatch.setattr("wholebody.sim.record.TOTAL_MAX", 100_000)
    with pytest.raises(FileFormatError, match=r"claims \d+ bytes in all; at most 100000 are unpacked"):
        read_record(path)
    assert len(read_record(path, ("rate",))) == 50
    monkeypatch.setattr("wholebody.sim.record.ARRAY_MAX", 10_000)
    with pytest.raises(FileFormatError, match="at most 10000 are unpacked"):
        read_record(path, ("q",))


def test_c7_the_document_has_the_columns_of_the_format():
    text = (ROOT / "docs" / "pictures.md").read_text()
    for heading, columns in (("A row a control period", PERIODS), ("The same all along", CONSTANTS)):
        table = text.partition(f"**{heading}**")[2].partition("\n\n**")[0].partition("\n## ")[0]
        rows = re.findall(r"^\| `(\w+)` \| (.*?) \| (.*?) \| (.*?) \|$", table, re.MULTILINE)
        wanted = [
            (name, f"({', '.join(str(length) for length in column.shape)})", column.unit or "–", column.meaning)
            for name, column in columns.items()
        ]
        assert rows == wanted


def test_footprints_are_where_feet_stood_one_after_the_other():
    left, right, ahead = stepped_record().footprints()
    assert [(one.side, one.begin, one.end) for one in (left, right, ahead)] == [
        ("left", 0, 10), ("right", 0, 30), ("left", 20, 30),
    ]  # fmt: skip
    np.testing.assert_allclose(ahead.corners - left.corners, [[0.2, 0.0]] * 4)
    assert len(made_record(5).footprints()) == 2
