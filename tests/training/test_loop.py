"""Strategy: LeRobot's commands are read by its own parsers, and leave what they would; our own are run in this process.
The real loop, as small as it goes, is a long study: each of its seven processes imports LeRobot.
"""

import json
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from lerobot.configs import parser
from lerobot.configs.eval import EvalPipelineConfig
from lerobot.configs.train import TrainPipelineConfig
from lerobot.datasets import LeRobotDataset
from lerobot.scripts.lerobot_record import RecordConfig

from lerobot_robot_wholebody import WholebodyG1
from lerobot_robot_wholebody.target import Numbers
from lerobot_robot_wholebody.tasks import task_of
from policy.learned.place import SPOT
from training import loop, replay, shown
from training.measure import done

ROOT = Path(__file__).parents[2]
SMALL = ["--episodes", "2", "--seconds", "1", "--steps", "2", "--batch", "2", "--tries", "1"]
EVALUATED = {False: 40.0, True: 60.0}
"""Success that is said of a policy, by whether a gate is before it [percent]."""


def recorded(asked):
    """Leaves a dataset of hands that stay, and a report."""
    robot, features = WholebodyG1(asked.robot), {}
    numbers = [name for name, kind in robot.observation_features.items() if kind is float]
    for key, names in (("action", list(robot.action_features)), ("observation.state", numbers)):
        features[key] = {"dtype": "float32", "shape": (len(names),), "names": names}
    made = LeRobotDataset.create(asked.dataset.repo_id, asked.dataset.fps, features, root=asked.dataset.root)
    frame = {key: np.zeros(one["shape"], np.float32) for key, one in features.items()}
    for _ in range(asked.dataset.num_episodes):
        for _ in range(round(asked.dataset.episode_time_s * asked.dataset.fps)):
            made.add_frame(frame | {"task": asked.dataset.single_task})
        made.save_episode()
    made.finalize()
    Path(asked.robot.report).write_text(json.dumps({"fell_at": None, "lowering_from": 1.0}))


def trained(asked):
    """Leaves the policy's settings."""
    asked.validate()
    folder = Path(asked.output_dir) / "checkpoints" / "last" / "pretrained_model"
    folder.mkdir(parents=True)
    asked.policy.save_pretrained(folder)


def evaluated(asked):
    """Leaves success and falls."""
    Path(asked.output_dir).mkdir()
    told = {"overall": {"pc_success": EVALUATED[asked.env.gate]}}
    (Path(asked.output_dir) / "eval_info.json").write_text(json.dumps(told))
    Path(asked.env.report).write_text(json.dumps({"falls": 0}))


COMMANDS = {
    "lerobot-record": (RecordConfig, recorded),
    "lerobot-train": (TrainPipelineConfig, trained),
    "lerobot-eval": (EvalPipelineConfig, evaluated),
    "training.replay": (None, lambda _: replay.main()),
    "training.shown": (None, lambda _: shown.add_shown(*map(Path, sys.argv[1:]))),
}


@pytest.fixture
def looped(monkeypatch, capsys):
    """What a loop says whose commands are run in this process, and their names."""

    def run(words, **_):
        words = words[2:] if words[1] == "-m" else words
        name = Path(words[0]).name
        kind, command = COMMANDS[name]
        asked.append(name)
        with one_at_a_time, monkeypatch.context() as patch:
            patch.setattr(sys, "argv", [name, *words[1:]])

            def read(given: kind):
                return given

            command(kind and parser.wrap()(read)())
        return SimpleNamespace(returncode=0)

    def call(folder):
        asked.clear()
        monkeypatch.setattr(sys, "argv", ["training.loop", "--out", str(folder), *SMALL])
        loop.main()
        return capsys.readouterr().out, tuple(asked)

    asked, one_at_a_time = [], threading.Lock()  # a process has one command line
    monkeypatch.setattr(loop, "subprocess", SimpleNamespace(run=run, STDOUT=subprocess.STDOUT))
    return call


def test_a_loop_ends_with_a_table_and_one_that_is_done_is_not_done_again(looped, tmp_path):
    said, asked = looped(tmp_path)
    assert sorted(asked[:3]) == ["lerobot-record", "lerobot-record", "training.replay"]
    assert asked[3:] == ("training.shown", "lerobot-train", "lerobot-eval", "lerobot-eval")
    rows = table(tmp_path, said)
    assert (rows["policy"]["success"], rows["policy, gate"]["success"]) == (EVALUATED[False], EVALUATED[True])
    again, asked = looped(tmp_path)
    assert asked == ()
    assert "| policy, gate |" in again


@pytest.mark.regression
@pytest.mark.parametrize("task", ["reach", "pick", "lift"])
def test_a_loop_of_real_processes_ends_with_a_table(tmp_path, task):
    words = [sys.executable, "-m", "training.loop", "--task", task, "--out", str(tmp_path), *SMALL]
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr
    table(tmp_path, done.stdout, task)
    config = json.loads((tmp_path / "policy/checkpoints/last/pretrained_model/config.json").read_text())
    assert config["input_features"].keys() == {"observation.state", "observation.environment_state"}
    again = subprocess.run(words, capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert "its words are in" not in again
    assert "| policy, gate |" in again


def table(folder, said, task="reach"):
    """Rows of a loop's table, which is what it said."""
    rows = json.loads((folder / "loop.json").read_text())["rows"]
    tries = {"expert": 1 if loop.RECORDINGS[task].disturb else 2} | ({"replay": 1} if task == "reach" else {})
    assert {name: row["episodes"] for name, row in rows.items()} == tries | {"policy": 1, "policy, gate": 1}
    assert all(row["falls"] == 0 for row in rows.values())
    for name, row in rows.items():
        assert f"| {name} | {row['success']:.0f} %" in said
    features = json.loads((folder / "data/meta/info.json").read_text())["features"]
    assert len(features["observation.environment_state"]["names"]) == len(task_of(task, 0).names)
    return rows


def test_a_reach_is_done_where_both_palms_are_at_their_goals():
    names = [f"to_goal_{side}_{axis}.pos" for side in ("left", "right") for axis in "xyz"]
    states = np.array([[off, 0.0, 0.0, 0.0, -0.01, 0.0] for off in (0.1, 0.029)])
    assert done(states, names, "reach")
    assert not done(states[::-1], names, "reach")


def test_a_thing_is_done_where_it_was_moved_far_enough():
    assert done(*told([0.4, 0.1, 0.83], [0.4, 0.1, 0.90], 0.06), "pick")
    assert not done(*told([0.4, 0.1, 0.83], [0.5, 0.1, 0.88], 0.06), "pick")


def told(first, last, away):
    """States in which a thing goes from one place to another, and the palms are beside it; and their names."""
    ways = [f"to_object_{side}_{axis}.pos" for side in ("left", "right") for axis in "xyz"]
    names = [*(f"object_{axis}.pos" for axis in "xyz"), *ways]
    return np.array([[*at, 0.0, -away, 0.0, 0.0, 0.3, 0.0] for at in (first, last)]), names


def test_a_thing_is_put_down_where_it_stands_on_the_spot_and_no_hand_is_at_it():
    first, spot = [0.42, 0.15, 0.83], [*SPOT, 0.83]
    assert done(*told(first, spot, 0.15), "place")
    assert not done(*told(first, spot, 0.06), "place")  # in the hand
    assert not done(*told(first, [spot[0], spot[1], 0.90], 0.15), "place")
    assert not done(*told(first, [spot[0] + 0.05, spot[1], 0.83], 0.15), "place")
    assert not done(*told(first, first, 0.15), "place")


def test_what_is_shown_of_a_task_is_what_the_robot_does_not_tell_of_itself():
    own = Numbers().state_names
    for task in ("reach", "lift"):
        names = task_of(task, 0).names
        assert shown.shown_columns([*own, *names]) == list(range(len(own), len(own) + len(names)))
