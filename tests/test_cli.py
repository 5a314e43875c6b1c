"""Strategy: exit codes and first lines, through the real entry point in a process of its own."""

import json
import subprocess
import sys

import jsonschema
import numpy as np
import pytest

from wholebody.resources import verdict_schema

SHORT = ("--duration", "0.2", "--hold", "0.2")


def wholebody(*arguments, cwd=None):
    code = "from wholebody.cli import main; main()"
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=250, check=False, cwd=cwd
    )


def test_the_version_is_printed():
    answer = wholebody("--version")
    assert answer.returncode == 0
    assert answer.stdout.strip()


@pytest.mark.parametrize("content", ["1,2,3\n", ""])
def test_a_malformed_motion_ends_with_one_sentence_and_code_2(tmp_path, content):
    path = tmp_path / "motion.csv"
    path.write_text(content)
    answer = wholebody("check", str(path))
    assert answer.returncode == 2
    assert answer.stderr.startswith("wholebody: ")
    assert "Traceback" not in answer.stderr


def test_an_unknown_policy_is_refused_with_those_that_exist():
    answer = wholebody("run", "lissajus")
    assert answer.returncode == 2
    assert "lissajous" in answer.stderr


def test_a_chunk_with_nan_is_malformed(tmp_path):
    path = tmp_path / "chunk.npz"
    np.savez(path, actions=np.full((50, 32), np.nan), fps=30.0, spec="wbc32")
    answer = wholebody("check", str(path))
    assert answer.returncode == 2
    assert "Traceback" not in answer.stderr


def test_a_wave_is_feasible_and_json_stands_alone_on_standard_output():
    answer = wholebody("check", "wave", "--duration", "0.5", "--hold", "0.2", "--json", "-")
    assert answer.returncode == 0, answer.stderr
    assert answer.stderr == ""
    verdicts = json.loads(answer.stdout)
    jsonschema.validate(verdicts, json.loads(verdict_schema().read_text()))
    assert verdicts[0]["verdict"] == "feasible"
    assert verdicts[0]["fell"] is False


def test_of_several_inputs_the_largest_exit_code_counts_and_the_others_are_judged(tmp_path):
    path, output = tmp_path / "far.npz", tmp_path / "verdicts.json"
    # Both wrists 3 m ahead of the pelvis, level: rotations by their first two columns.
    wrist = [3.0, 0.2, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    np.savez(path, actions=np.tile([*wrist, *wrist, *np.zeros(14)], (10, 1)), fps=30.0, spec="wbc32")
    broken = tmp_path / "broken.npz"
    broken.write_bytes(b"PK")
    answer = wholebody("check", str(broken), str(path), *SHORT, "--json", str(output))
    assert answer.returncode == 2
    assert answer.stderr.startswith(f"wholebody: {broken}: ")
    assert answer.stdout.startswith("INFEASIBLE  ")
    assert "out_of_reach: " in answer.stdout
    (verdict,) = json.loads(output.read_text())
    assert verdict["verdict"] == "infeasible"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("run", "wave", "--video", "x.gif"), "must end in .mp4"),
        (("run", "wave", "--sheet", "none/x.png"), "there is no folder"),
        (("run", "wave", "--duration", "-1"), "--duration"),
        (("run", "--motions", "."), "no .csv files"),
        (("run", "wave", "--scene", "tabel"), "no scene 'tabel'; did you mean"),
        (("check", "wave", "--config", "none.yaml"), "none.yaml"),
        (("check", "chunk.npz", "--assume-spec", "wbc33"), "wbc32"),
    ],
)
def test_misuse_is_told_before_anything_is_simulated(tmp_path, arguments, says):
    np.savez(tmp_path / "chunk.npz", actions=np.zeros((10, 32)), fps=30.0)
    answer = wholebody(*arguments, cwd=tmp_path)
    assert answer.returncode == 2
    assert says in answer.stderr
    assert "Traceback" not in answer.stderr


def test_a_run_writes_its_recording_and_a_picture_or_says_why_not(tmp_path):
    (tmp_path / "c.yaml").write_text("solver: quadprog\n")
    options = ("--record", "run.npz", "--sheet", "run.png", "--config", "c.yaml", "--json", "run.json")
    more = ("--realistic", "--delay-ms", "4", "--payload-kg", "0.5", "0.5")
    answer = wholebody("run", "wave", *SHORT, *options, *more, cwd=tmp_path)
    assert answer.returncode == 0, answer.stderr
    with np.load(tmp_path / "run.npz", allow_pickle=False) as data:
        assert len(data["time"]) == round(1.4 / 0.002)
    (verdict,) = json.loads((tmp_path / "run.json").read_text())
    assert verdict["config"]["solver"] == "quadprog"
    assert (tmp_path / "run.png").exists() or "libegl1" in answer.stderr


def test_a_folder_of_motions_becomes_a_table(tmp_path):
    rows = np.zeros((20, 36))
    rows[:, 2], rows[:, 6] = 0.79, 1.0
    np.savetxt(tmp_path / "still.csv", rows, delimiter=",")
    answer = wholebody("run", "--motions", str(tmp_path), *SHORT)
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.splitlines()[0].split()[:3] == ["motion", "fell", "demandable"]
    assert answer.stdout.splitlines()[1].split()[:2] == ["still", "no"]
    assert "1 motions, 0 falls" in answer.stdout
