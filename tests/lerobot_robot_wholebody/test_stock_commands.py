"""Strategy: the commands at the top of `docs/lerobot.md`, as they stand there but shorter, in LeRobot's own processes:
record, replay, train, evaluate, roll out until Ctrl-C; and a recording that is killed, which is started as it is typed.
After each the robot must crouch, not fallen.

Simulated time passes in lockstep, and whatever is waited for is an event: nothing depends on how fast the computer is.
"""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from models import g1
from tests.support.stock_command import StockCommand
from wholebody.errors import RenderError
from wholebody.sim.cameras import DrawingProcess

ROOT = Path(__file__).parents[2]
BIN = Path(sys.executable).parent
SHORT = {
    "lerobot-record": "--robot.id=g1 --dataset.num_episodes=2 --dataset.episode_time_s=1 --dataset.reset_time_s=0.5 "
    '--play_sounds=false "--robot.cameras={head: {width: 64, height: 64}}"',
    "lerobot-train": "--steps=2 --batch_size=2 --num_workers=0 --policy.pretrained_backbone_weights=null "
    "--policy.dim_model=64 --policy.n_heads=2 --policy.dim_feedforward=64 --policy.n_encoder_layers=1 "
    "--policy.n_vae_encoder_layers=1 --policy.chunk_size=10 --policy.n_action_steps=10",
    "lerobot-rollout": '--robot.id=g1 --duration=0 "--robot.cameras={head: {width: 64, height: 64}}"',
    "lerobot-eval": "--eval.n_episodes=2 --eval.batch_size=2 --env.steps=10 "
    '"--env.cameras={head: {width: 64, height: 64}}"',
    "lerobot-replay": "--robot.id=g1 --play_sounds=false",
}
LONG = 600.0
"""Time that is waited at most [s]."""


def documented():
    """Words of each command of the page, by its name."""
    block = (ROOT / "docs" / "lerobot.md").read_text().partition("```sh\n")[2].partition("```")[0]
    lines = [line for line in block.splitlines() if line.startswith("lerobot-")]
    return {line.split()[0]: shlex.split(line)[1:] for line in lines}


def typed(words, folder, environment, said):
    """A command as a shell starts it."""
    with said.open("w") as file:
        environment = {**os.environ, **environment}
        return subprocess.Popen(words, cwd=folder, env=environment, stdout=file, stderr=subprocess.STDOUT)


def start(name, folder, *more, leave_out=(), how=StockCommand):
    """A command of the page in a folder, with a report of the robot; what it says is in a file there."""
    given = [word for word in documented()[name] if not word.startswith(tuple(leave_out))]
    words = [BIN / name, *given, *shlex.split(SHORT[name]), *more]
    words = [word for word in words if not str(word).startswith(tuple(leave_out))]
    if name == "lerobot-eval":
        words += ["--env.discover_packages_path=lerobot_robot_wholebody"]
    elif name != "lerobot-train":
        words += ["--robot.discover_packages_path=lerobot_robot_wholebody", f"--robot.report={folder / name}.json"]
    return how(words, folder, {"PYTHONPATH": str(ROOT)}, folder / f"{name}.log")


def said(name, folder):
    return (folder / f"{name}.log").read_text()


def ended(name, folder, *more, **options):
    """Run a command of the page to its end."""
    command = start(name, folder, *more, **options)
    code = command.wait(LONG)
    command.kill()
    assert code == 0, said(name, folder)[-3000:]


def wait_for(what, command, seconds=LONG):
    """Wait until something is so, or the command has ended."""
    end = time.monotonic() + seconds
    while not what() and command.poll() is None and time.monotonic() < end:
        time.sleep(0.2)
    assert what()


def crouches(name, folder):
    """The report of a robot that was lowered, not dropped."""
    report = json.loads((folder / f"{name}.json").read_text())
    assert not report["fell"]
    assert report["lowered"]
    assert report["targets_refused"] == {}
    return report


@pytest.fixture(scope="module")
def sees():
    """Whether there is OpenGL, without which there are no pictures to train on."""
    try:
        DrawingProcess(g1().joint_names, "floor", {"head": (64, 64)}).close()
    except RenderError:
        return False
    return True


@pytest.fixture(scope="module", autouse=True)
def home(tmp_path_factory):
    """Where LeRobot keeps what it keeps; known before it is loaded."""
    folder = str(tmp_path_factory.mktemp("home"))
    given = {"HF_HOME": folder, "HF_LEROBOT_HOME": folder, "HF_HUB_OFFLINE": "1", "OMP_NUM_THREADS": "1"}
    with pytest.MonkeyPatch.context() as patched:
        for name, value in given.items():
            patched.setenv(name, value)
        yield


def test_the_page_has_the_commands():
    assert list(documented()) == list(SHORT)


def test_what_is_recorded_trains_rolls_out_and_is_replayed(sees, tmp_path, request):
    blind = () if sees else ("--robot.cameras",)
    ended("lerobot-record", tmp_path, leave_out=blind)
    # A chunk is made where a target says something new, and at least every 0.13 s of the 2.5 s.
    assert crouches("lerobot-record", tmp_path)["chunks"]["accepted"] > 2.5 / 0.13
    _all_features_are_there(tmp_path / "data" / "reach", sees)

    ended("lerobot-replay", tmp_path)
    assert crouches("lerobot-replay", tmp_path)["chunks"]["accepted"] > 1.0 / 0.13
    if not sees:
        pytest.skip("no OpenGL here: ACT needs pictures")

    ended("lerobot-train", tmp_path)
    ended("lerobot-eval", tmp_path)
    told = json.loads((tmp_path / "out" / "eval" / "eval_info.json").read_text())
    assert told["overall"]["n_episodes"] == 2
    assert len(told["overall"]["video_paths"]) == 2

    rollout = start("lerobot-rollout", tmp_path)
    request.addfinalizer(rollout.kill)
    wait_for(lambda: "control loop started" in said("lerobot-rollout", tmp_path), rollout)
    time.sleep(2.0)  # the middle of it
    rollout.send_signal(signal.SIGINT)
    assert rollout.wait(LONG) == 0, said("lerobot-rollout", tmp_path)[-3000:]
    assert "Returning robot to initial position" in said("lerobot-rollout", tmp_path)
    assert "Could not return" not in said("lerobot-rollout", tmp_path)
    assert crouches("lerobot-rollout", tmp_path)["chunks"]["accepted"] > 20


def _all_features_are_there(folder, sees):
    """Every number of action and state, every frame of simulated time, pictures that show something."""
    import pyarrow.parquet as parquet

    info = json.loads((folder / "meta" / "info.json").read_text())
    assert len(info["features"]["action"]["names"]) == 32
    assert len(info["features"]["observation.state"]["names"]) == 29
    assert info["total_frames"] == 2 * 30
    (table,) = [parquet.read_table(path) for path in (folder / "data").rglob("*.parquet")]
    action, state = (np.array(table[name].to_pylist()) for name in ("action", "observation.state"))
    assert np.isfinite(action).all()
    assert np.isfinite(state).all()
    assert np.ptp(action[:30, :3], axis=0).max() > 0.02  # the expert set off, and the wrist after it
    assert np.ptp(state[:30, :3], axis=0).max() > 0.02
    assert np.abs(state[1:30, :18] - action[:29, :18]).max() < 0.1
    assert ("observation.images.head" in info["features"]) == sees


def test_a_recording_that_is_killed_leaves_a_robot_that_crouches(tmp_path):
    command = start(
        "lerobot-record", tmp_path, "--dataset.episode_time_s=1000", leave_out=["--robot.cameras"], how=typed
    )
    wait_for(lambda: "Recording episode 0" in said("lerobot-record", tmp_path), command)
    time.sleep(2.0)  # the middle of it
    command.send_signal(signal.SIGKILL)
    command.wait()
    report, end = tmp_path / "lerobot-record.json", time.monotonic() + LONG
    while not report.exists() and time.monotonic() < end:
        time.sleep(0.2)
    assert crouches("lerobot-record", tmp_path)["seconds"] > 1.0
