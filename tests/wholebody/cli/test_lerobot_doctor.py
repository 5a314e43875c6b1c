"""``wholebody doctor``: one line a check, exit code 0, 1 or 2, JSON, and a cure with everything that is wrong."""

import json
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

from policy.dataset.stats import WIDTH_MIN
from policy.lerobot.weights import WEIGHTS_FILE
from tests.support import tiny_policies as tiny
from wholebody.cli import diagnosis
from wholebody.cli.diagnosis import Diagnosis, examine
from wholebody.cli.main import app


def diagnose(*arguments):
    with tiny.tiny_backbones():
        done = CliRunner().invoke(app, ["doctor", *map(str, arguments)])
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done


@pytest.mark.parametrize("kind", ["act", "diffusion"])
def test_a_sound_checkpoint_is_one_ok_a_check(kind, tmp_path_factory):
    done = diagnose(tiny.saved(kind, tmp_path_factory))
    lines = done.stdout.splitlines()
    checks = [
        "config",
        "spec",
        "processors",
        "features",
        "statistics",
        "relative",
        "prompt",
        "weights",
        "chunk",
        "latency",
    ]
    assert [line.split()[1] for line in lines] == checks
    levels = {line.split()[1]: line.split()[0] for line in lines}
    # Diffusion's dry run has no observation before the first one, and says so.
    assert levels.pop("chunk") == ("ok" if kind == "act" else "warning")
    assert set(levels.values()) == {"ok"}
    assert done.exit_code == (0 if kind == "act" else 1)


def test_an_untrained_network_is_a_warning(tmp_path_factory):
    done = diagnose(tiny.saved("pi05", tmp_path_factory))
    assert done.exit_code == 1
    (line,) = (line for line in done.stdout.splitlines() if not line.startswith("ok"))
    assert line.startswith("warning chunk       50 finite steps, the first ")
    assert "% of the numbers are beyond 1.2 (normalised)" in line


def test_everything_that_is_wrong_is_said_at_once(tmp_path, tmp_path_factory):
    statistics = tiny.stats()
    statistics["action"]["q99"][2] = statistics["action"]["q01"][2] + 0.1 * WIDTH_MIN
    folder = tiny.write_checkpoint("pi05", tmp_path / "pi05", statistics=statistics, with_spec=True)
    (folder / WEIGHTS_FILE).unlink()
    done = diagnose(folder, "--task", "x" * 100)
    assert done.exit_code == 2
    wrong = [line for line in done.stdout.splitlines() if line.startswith("error")]
    assert [line.split()[1] for line in wrong] == ["statistics", "prompt", "weights"]
    assert all("; " in line for line in wrong)


def test_a_folder_that_is_no_checkpoint_is_an_error(tmp_path):
    done = diagnose(tmp_path / "nothing")
    assert done.exit_code == 2
    assert "config.json is missing; give the folder of a checkpoint" in done.stdout


def test_without_lerobot_the_package_that_brings_it_is_named(tmp_path_factory, monkeypatch):
    folder = tiny.saved("act", tmp_path_factory)
    monkeypatch.setitem(sys.modules, "lerobot.policies", None)
    done = diagnose(folder)
    assert done.exit_code == 2
    assert "pip install 'g1-wholebody[lerobot]'" in done.stdout


def test_a_layout_that_nobody_named_is_an_error_and_vouching_helps(tmp_path):
    folder = tiny.write_checkpoint("act", tmp_path / "act", with_spec=False)
    assert "--assume-spec wbc32" in diagnose(folder).stdout
    done = diagnose(folder, "--assume-spec", "wbc32-v1")
    assert done.exit_code == 0
    assert "vouched for by the user" in done.stdout


def test_a_layout_that_is_asked_for_must_be_the_checkpoints(tmp_path_factory):
    folder = tiny.saved("act", tmp_path_factory)
    assert diagnose(folder, "--spec", "wbc32-v1").exit_code == 0
    done = diagnose(folder, "--spec", "wbc27")
    assert done.exit_code == 2
    assert "error   spec" in done.stdout


def test_json_says_the_same_as_the_lines(tmp_path, tmp_path_factory):
    folder = tiny.saved("act", tmp_path_factory)
    printed = json.loads(diagnose(folder, "--json", "-").stdout)
    assert printed["verdict"] == "ok"
    assert printed["exit_code"] == 0
    assert {tuple(check) for check in printed["checks"]} == {("check", "level", "text", "cure")}
    done = diagnose(folder, "--json", tmp_path / "out.json")
    stored = json.loads((tmp_path / "out.json").read_text())
    assert [check["check"] for check in stored["checks"]] == [line.split()[1] for line in done.stdout.splitlines()]


def test_a_dataset_that_does_not_exist_is_an_error(tmp_path, tmp_path_factory):
    done = diagnose(tiny.saved("act", tmp_path_factory), "--dataset", tmp_path)
    assert done.exit_code == 2
    assert "give the folder of a LeRobot dataset" in done.stdout
    assert "not compared: the checkpoint could not be loaded" in diagnose(tmp_path, "--dataset", tmp_path).stdout


def test_random_weights_can_be_timed(tmp_path, tmp_path_factory):
    folder = tiny.copied("act", tmp_path_factory, tmp_path)
    (folder / WEIGHTS_FILE).unlink()
    done = diagnose(folder, "--allow-random-weights")
    assert done.exit_code == 1
    assert "random weights, as allowed" in done.stdout
    assert "latency" in done.stdout


def test_a_first_step_far_away_is_a_warning(tmp_path):
    statistics = tiny.stats()
    for name in ("mean", "q01", "q99", "min", "max"):
        statistics["action"][name][0] += 0.4
    done = diagnose(tiny.write_checkpoint("act", tmp_path / "act", statistics=statistics))
    assert done.exit_code == 1
    assert "is not followed at once: begin where demonstrations began" in done.stdout


def test_a_stance_far_outside_training_is_a_warning(tmp_path):
    statistics = tiny.stats()
    for name in ("mean", "q01", "q99", "min", "max"):
        statistics["observation.state"][name][0] += 0.5
    done = diagnose(tiny.write_checkpoint("act", tmp_path / "act", statistics=statistics))
    assert done.exit_code == 1
    assert "none from the nominal stance: left_wrist_x.pos of the state is" in done.stdout


def test_a_network_that_fails_in_the_dry_run_is_an_error(tmp_path_factory, monkeypatch):
    from lerobot.policies.act.modeling_act import ACTPolicy

    monkeypatch.setattr(
        ACTPolicy, "predict_action_chunk", lambda self, batch: (_ for _ in ()).throw(RuntimeError("oh"))
    )
    finding = examine(tiny.saved("act", tmp_path_factory)).findings[-1]
    assert (finding.check, finding.level) == ("chunk", "error")
    assert finding.text == "RuntimeError in a dry run: oh"


def test_a_policy_slower_than_its_chunks_is_a_warning(tmp_path_factory, monkeypatch):
    times = iter(np.arange(0.0, 100.0, 10.0))
    monkeypatch.setattr(diagnosis, "perf_counter", lambda: next(times))
    finding = examine(tiny.saved("act", tmp_path_factory)).findings[-1]
    assert finding.level == "warning"
    assert finding.text == "10000 ms a chunk on cpu; it lasts 1.67 s"


def test_the_exit_code_is_the_worst_level():
    from policy.findings import Finding

    ok, warning, error = (Finding("x", level, "y") for level in diagnosis.LEVELS)
    assert [Diagnosis("", found).exit_code for found in ((ok,), (ok, warning), (error, warning))] == [0, 1, 2]


def test_help_names_the_exit_codes():
    done = CliRunner().invoke(app, ["doctor", "--help"])
    assert "1 with warnings, 2 not fit to be run" in " ".join(done.stdout.replace("│", " ").split())
