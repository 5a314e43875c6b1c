"""Strategy: exit codes and first lines, through the real entry point in a process of its own."""

import json
import subprocess
import sys

import numpy as np
import pytest


def wholebody(*arguments):
    code = "from wholebody.cli import main; main()"
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=250, check=False
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
    answer = wholebody("check", "wave", "--duration", "1", "--json", "-")
    assert answer.returncode == 0, answer.stderr
    (verdict,) = json.loads(answer.stdout)
    assert verdict["verdict"] == "feasible"
    assert verdict["fell"] is False
