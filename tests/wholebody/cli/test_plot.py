"""Strategy: the command writes the picture of a recording made of numbers, or says in one sentence why not."""

import imageio.v3 as iio
import numpy as np
import pytest

from tests.support.recordings import made_record, save


def test_the_picture_is_written_beside_the_recording_and_over_no_sheet(inside, tmp_path):
    save(made_record(50), tmp_path / "run.npz")
    (tmp_path / "run.png").write_bytes(b"a sheet")
    answer = inside("plot", str(tmp_path / "run.npz"))
    assert (answer.returncode, answer.stdout) == (0, "")
    assert answer.stderr == f"wrote {tmp_path / 'run-plot.png'}\n"
    assert iio.imread(tmp_path / "run-plot.png").shape[:2] == (1080, 990)
    assert (tmp_path / "run.png").read_bytes() == b"a sheet"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("none.npz",), "there is no recording 'none.npz': wholebody run SOURCE --record none.npz makes one"),
        ((".",), "say with --output where"),
        (("chunk.npz",), "chunk.npz: is a chunk file, and recordings are drawn: `wholebody run chunk.npz --rec"),
        (("run.npz", "-o", "run.gif"), "must end in .png"),
        (("run.npz", "-o", "none/run.png"), "there is no folder"),
        ((".", "-o", "run.png"), ".: is a folder, which cannot be read"),
    ],
)
def test_what_cannot_be_plotted_is_one_sentence_and_code_2(inside, tmp_path, monkeypatch, arguments, says):
    monkeypatch.chdir(tmp_path)
    save(made_record(5), tmp_path / "run.npz")
    np.savez(tmp_path / "chunk.npz", fps=30.0, actions=np.zeros((3, 32)), spec="wbc32")
    answer = inside("plot", *arguments)
    assert answer.returncode == 2
    assert says in answer.stderr
    assert len(answer.stderr.splitlines()) == 1
    assert not list(tmp_path.glob("*.png"))
