"""Strategy: every command of the README is typed as it stands there, one after the other in one folder, but shorter.

Those that draw, serve or start several processes take long and have short tests elsewhere: here with the long studies.
"""

import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from policy import builtin, convert
from tests.support import tiny_policies as tiny
from tests.support.dataset_cases import write_v30
from wholebody.cli.main import app

ROOT = Path(__file__).resolve().parents[2]
SHORT = {name: ["--duration", "0.4", "--hold", "0"] for name in ("run", "check")}
SHORT["live"] = ["wave", "--headless", "--duration", "1"]
SERVE, COMPLETE, WARM_UP = "serve-policy CHECKPOINT", "--install-completion", "warmup"
LONG = ("live", "--video", "--sheet", "-j 4", "--worlds", SERVE, "ws://")
CODE = "from wholebody.cli.main import main; main()"


def commands():
    """What the README has after `wholebody`, in its code blocks and in its lines, comments left out."""
    text = (ROOT / "README.md").read_text()
    lines = [line for block in text.split("```sh\n")[1:] for line in block.partition("```")[0].splitlines()]
    lines += text.split("`")[1::2]
    typed = [line.partition("#")[0].strip() for line in lines if line.startswith("wholebody ")]
    lines = dict.fromkeys(line.removeprefix("wholebody ") for line in typed)
    marks = [pytest.mark.regression if any(part in line for part in LONG) else () for line in lines]
    return [pytest.param(line, marks=mark) for line, mark in zip(lines, marks, strict=True)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where there is what the README names: chunk.npz, motion.csv, DIR, DATASET, CHECKPOINT, docs."""
    folder = tmp_path_factory.mktemp("readme")
    for name in ("DIR", "docs"):
        (folder / name).mkdir()
    for chunk in (folder / "chunk.npz", folder / "DIR" / "chunk.npz"):
        CliRunner().invoke(app, ["layouts", "wbc32", "--write", str(chunk)])
    for motion in (folder / "motion.csv", folder / "DIR" / "motion.csv"):
        convert(folder / "chunk.npz", motion)
    np.save(folder / "x.npy", np.load(folder / "chunk.npz")["actions"])
    write_v30(folder / "DATASET", cameras=False)
    tiny.write_checkpoint("act", folder / "CHECKPOINT", spec=builtin("wbc32"))
    return folder


@pytest.fixture(scope="module")
def address(folder):
    """Of the policy that the README serves."""
    call = [sys.executable, "-c", CODE, *SERVE.split(), "--port", "0"]
    with subprocess.Popen(call, cwd=folder, text=True, stdout=subprocess.PIPE) as server:
        yield server.stdout.readline().split()[-1]
        server.kill()


@pytest.mark.parametrize("line", commands())
def test_every_command_of_the_readme_runs(line, folder, monkeypatch, request):
    monkeypatch.chdir(folder)
    if line == SERVE:
        assert request.getfixturevalue("address").startswith("ws://127.0.0.1:")
    elif line == COMPLETE:
        typed = f'"{sys.executable}" -c "{CODE}" {COMPLETE}; exit $?'
        home = {"HOME": str(folder), "PATH": os.environ["PATH"], "PYTHONPATH": str(ROOT)}
        done = subprocess.run(["bash", "-c", typed], env=home, capture_output=True, text=True, check=False)
        assert "completion installed" in done.stdout, done.stderr
    elif line == WARM_UP:
        assert "warm_up()" in (ROOT / "tests/wholebody/episode/test_warm_up.py").read_text()
    else:
        name, *rest = shlex.split(line)
        given = [path for word in rest for path in (sorted(map(str, Path().glob(word))) if "*" in word else [word])]
        # A walk that is cut short came nowhere, and its verdict says so.
        short = [] if "walk_reach" in given else SHORT.get(name, [])
        if "ws://HOST:8000" in given:
            given[given.index("ws://HOST:8000")] = request.getfixturevalue("address")
            short = ["--duration", "4", "--hold", "0"]  # this policy takes its own time to answer
        with tiny.tiny_backbones():
            done = CliRunner().invoke(app, [name, *given, *short], catch_exceptions=False)
        # That an input is infeasible is an answer, too, and so is that this computer is slow.
        answers = name in ("check", "audit") or (name == "doctor" and "warning latency" in done.output)
        assert done.exit_code in ((0, 1) if answers else (0,)), done.output
        assert name != "doctor" or "warning" not in done.output.replace("warning latency", "")
