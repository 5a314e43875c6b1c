"""`wholebody layouts`, and the chunk of a newcomer: from numpy to a verdict."""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from policy import LAYOUTS, ActionSpec, builtin, read_chunk_file
from wholebody.cli.main import app

ROOT = Path(__file__).resolve().parents[3]


def layouts(*arguments):
    done = CliRunner().invoke(app, ["layouts", *map(str, arguments)])
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done.stdout


def test_layouts_without_a_name_lists_them_one_a_line():
    said = layouts().splitlines()
    assert [line.split()[0] for line in said[: len(LAYOUTS)]] == list(LAYOUTS)


def test_c2_layouts_prints_every_slot_unit_frame_limit_and_stance_and_writes_an_example(tmp_path):
    said = layouts("wbc32", "--write", tmp_path / "example.npz")
    for words in (
        "left_wrist_position: position [m], left_wrist_yaw_link in the stance\n",
        "frame stance: between the soles, level",
        "version 1 has the wrists in the pelvis",
        "  2   left_wrist_z.pos                0.860\n",
        "  12  right_wrist_r6_0.pos R[0, 0]    1.000\n",
        "  25  right_hand_thumb_0.pos          0.000   -1.047    1.047\n",
    ):
        assert words in said
    file = read_chunk_file(tmp_path / "example.npz")
    assert (file.spec, file.actions.shape) == (builtin("wbc32"), (50, 32))


def test_layouts_takes_a_json_file_too(tmp_path):
    (tmp_path / "mine.json").write_text(builtin("wbc27").to_json())
    assert layouts(tmp_path / "mine.json") == layouts("wbc27")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("wbc33",), "did you mean 'wbc32'"),
        (("--write", "x.npz"), "name the layout"),
        (("wbc32", "--write", "x.txt"), r"must end in \.npz"),
    ],
)
def test_layouts_misused_says_what_would_work(arguments, says):
    with pytest.raises(ValueError, match=says):
        CliRunner().invoke(app, ["layouts", *arguments], catch_exceptions=False)


def test_c2_the_twelve_line_numpy_program_of_the_documents_makes_a_feasible_chunk(monkeypatch, tmp_path, capsys):
    program = ROOT / "examples" / "wbc32_chunk.py"
    body = program.read_text().split('"""', 2)[2].strip()
    assert body in (ROOT / "docs" / "policy_contract.md").read_text()
    assert len([line for line in body.splitlines() if line]) <= 12
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(program))
    assert capsys.readouterr().out == "feasible\n"


def test_layouts_from_a_chunk_names_what_fits_and_writes_it(tmp_path):
    layouts("openhlm34", "--write", tmp_path / "a.npz")
    said = layouts("--from", tmp_path / "a.npz", "--write", tmp_path / "mine.json")
    assert "openhlm34            fits" in said
    assert "both wrists are within reach in 100% of the rows" in said
    assert read_chunk_file(tmp_path / "a.npz").spec.hash in (tmp_path / "mine.json").read_text()


def test_layouts_from_a_source_in_doubt_asks_for_a_name(tmp_path):
    layouts("inspire26", "--write", tmp_path / "a.npz")
    with pytest.raises(ValueError, match="name the layout to write: inspire26"):
        CliRunner().invoke(
            app, ["layouts", "--from", str(tmp_path / "a.npz"), "--write", "x.json"], catch_exceptions=False
        )


def test_a_layout_is_said_for_programs_and_its_layout_is_a_layout():
    said = json.loads(layouts("wbc32", "--json", "-"))
    assert (said["id"], said["dim"], len(said["numbers"])) == (builtin("wbc32").id, 32, 32)
    assert ActionSpec.from_dict(said["layout"]) == builtin("wbc32")
    third, thumb = said["numbers"][2], said["numbers"][25]
    assert (third["name"], third["unit"], third["stance"]) == ("left_wrist_z.pos", "m", pytest.approx(0.86, abs=1e-3))
    assert (thumb["least"], thumb["largest"]) == (pytest.approx(-1.047, abs=1e-3), pytest.approx(1.047, abs=1e-3))


def test_an_array_is_checked_in_the_layout_and_at_the_rate_that_are_said(tmp_path):
    rows = read_chunk_file(written(tmp_path)).actions
    np.save(tmp_path / "mine.npy", rows)
    check = ["check", "--fast", str(tmp_path / "mine.npy"), "--layout", "wbc32", "--json", "-"]
    said = CliRunner().invoke(app, [*check, "--fps", "30"]).stdout
    assert json.loads(said)[0]["verdict"] == "feasible"
    assert "the array does not say its rate" not in said
    assert "30 Hz of the layout 'wbc32' assumed" in CliRunner().invoke(app, check).stdout


def written(folder):
    layouts("wbc32", "--write", folder / "example.npz")
    return folder / "example.npz"
