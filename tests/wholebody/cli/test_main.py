"""Strategy: exit codes, first lines and files, through the entry point; what simulates in a process of its own."""

import json
import subprocess
import sys
from types import SimpleNamespace

import jsonschema
import numpy as np
import pytest

from models.scenes import SCENES
from policy.learned import NAMES as LEARNED
from policy.scripted.library import SCRIPTS
from tests.support.commands import wholebody
from tests.support.hostile_files import write_scene
from wholebody.cli.commands import run as run_command
from wholebody.cli.main import TASKS
from wholebody.cli.simulated import SCENE_OF
from wholebody.cli.sources import NO_END
from wholebody.episode.run import EpisodeConfig
from wholebody.episode.timing import Timing
from wholebody.errors import InputError
from wholebody.resources import verdict_schema
from wholebody.verdict.verdict import Verdict

SHORT = ("--duration", "0.2", "--hold", "0.2")


def test_the_version_is_printed(inside):
    answer = inside("--version")
    assert answer.returncode == 0
    assert answer.stdout.strip()


def test_python_m_is_the_command():
    answer = subprocess.run(
        [sys.executable, "-m", "wholebody", "--version"], capture_output=True, text=True, check=True
    )
    assert answer.stdout.strip()


def test_the_help_names_every_script_and_leaves_no_unit_out(inside):
    text = " ".join(inside("run", "--help").stdout.split())
    assert all(name in text for name in SCRIPTS)
    assert "in ms" in text
    assert "in kg" in text


def test_no_command_is_cut_off_in_the_list_of_commands(inside, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    text = inside("--help").stdout
    assert "..." not in text.partition("Check:")[2]
    tasks = [text.index(f"\n{task}:\n") for task in (*TASKS, "Measure")]
    assert tasks == sorted(tasks)


def test_a_run_looks_for_no_drawing_library(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "nonsense")  # with which MuJoCo cannot even be imported
    assert wholebody("run", "wave", *SHORT).stdout.startswith("FEASIBLE")


def test_c5_the_robot_without_hands_runs_in_a_scene_from_a_file(inside, tmp_path):
    write_scene(tmp_path)
    scene = str(tmp_path / "scene.xml")
    answer = inside("run", "wave", "--robot", "g1", "--scene", scene, *SHORT, "--json", str(tmp_path / "v.json"))
    assert (answer.returncode, answer.stdout.partition(":")[0]) == (0, "FEASIBLE  wave")
    assert f"{scene}: the planner sees the robot and the floor alone" in answer.stderr
    (verdict,) = json.loads((tmp_path / "v.json").read_text())
    assert verdict["config"]["robot"]["model"] == "g1"
    assert "the robot has no fingers" in answer.stdout


def test_c5_a_scene_that_is_refused_ends_with_code_2_and_a_sentence(inside, tmp_path):
    (tmp_path / "s.xml").write_text('<mujoco><worldbody><include file="/etc/passwd"/></worldbody></mujoco>')
    answer = inside("run", "wave", "--scene", str(tmp_path / "s.xml"), *SHORT)
    assert (answer.returncode, answer.stdout) == (2, "")
    assert "has <include>; bodies and geoms" in answer.stderr.splitlines()[-1]


def test_scripts_that_need_a_scene_get_it():
    assert set(SCENE_OF) <= {*SCRIPTS, *LEARNED}
    assert set(SCENE_OF.values()) <= set(SCENES)


@pytest.mark.parametrize("script", SCENE_OF)
def test_scripts_that_touch_something_run_in_their_scene(inside, script):
    answer = inside("run", script, *SHORT)
    assert (answer.returncode, answer.stdout.partition(":")[0]) == (0, f"FEASIBLE  {script}")


@pytest.mark.parametrize("content", ["1,2,3\n", ""])
def test_a_malformed_motion_ends_with_one_sentence_and_code_2(inside, tmp_path, content):
    path = tmp_path / "motion.csv"
    path.write_text(content)
    answer = inside("check", str(path))
    assert answer.returncode == 2
    assert answer.stderr.startswith(f"wholebody: {path}: ")
    assert answer.stderr.count(str(path)) == 1
    assert len(answer.stderr.splitlines()) == 1


def test_an_unknown_policy_is_refused_with_those_that_exist(inside):
    answer = inside("run", "lissajus")
    assert answer.returncode == 2
    assert "did you mean 'lissajous'" in answer.stderr
    assert "two_hand_lift" in answer.stderr


def test_a_chunk_with_nan_is_malformed_and_its_place_is_named(inside, tmp_path):
    path, actions = tmp_path / "chunk.npz", np.zeros((50, 32))
    actions[7, 2] = np.nan
    np.savez(path, actions=actions, fps=30.0, spec="wbc32")
    answer = inside("check", str(path))
    assert answer.returncode == 2
    assert "actions[7, 2] is nan" in answer.stderr
    assert answer.stdout == ""


def test_a_wave_is_feasible_and_json_stands_alone_on_standard_output():
    answer = wholebody("check", "wave", "--duration", "0.5", "--hold", "0.2", "--json", "-")
    assert answer.returncode == 0, answer.stderr
    assert answer.stderr == ""
    verdicts = json.loads(answer.stdout)
    jsonschema.validate(verdicts, json.loads(verdict_schema().read_text()))
    assert verdicts[0]["verdict"] == "feasible"
    assert verdicts[0]["fell"] is False


def test_of_several_inputs_the_largest_exit_code_counts_and_the_others_are_judged(inside, tmp_path):
    path, output = tmp_path / "far.npz", tmp_path / "verdicts.json"
    # Both wrists 3 m ahead of the soles, at the height of the pelvis: rotations by their first two columns.
    wrist = [3.0, 0.2, 0.779, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    np.savez(path, actions=np.tile([*wrist, *wrist, *np.zeros(14)], (10, 1)), fps=30.0, spec="wbc32")
    broken = tmp_path / "broken.npz"
    broken.write_bytes(b"PK")
    answer = inside("check", str(broken), str(path), *SHORT, "--json", str(output))
    assert answer.returncode == 2
    assert answer.stderr.startswith(f"wholebody: {broken}: ")
    assert answer.stdout.startswith("INFEASIBLE  ")
    assert "far_start: first step " in answer.stdout
    assert "\n  palm_moved (position): " in answer.stdout
    (verdict,) = json.loads(output.read_text())
    assert verdict["verdict"] == "infeasible"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("run", "wave", "--video", "x.avi"), "must end in .mp4 or .gif"),
        (("run", "wave", "--sheet", "none/x.png"), "there is no folder"),
        (("run", "wave", "--duration", "-1"), "--duration"),
        (("run", "--motions", "."), "no .csv files"),
        (("run", "wave", "--scene", "tabel"), "no scene 'tabel'; did you mean"),
        (("check", "chunk.npz", "--config", "none.yaml"), "wholebody: the settings file 'none.yaml' cannot be"),
        (("check", "none.npz", "wave", "-j", "2", "--config", "broken.yaml"), "wholebody: broken.yaml:1: unknown"),
        (("run", "none.npz", "--config", "none.yaml"), "wholebody: the settings file 'none.yaml'"),
        (("audit", "none.npz", "--config", "broken.yaml"), "wholebody: broken.yaml:1: unknown"),
        (("repair", "chunk.npz", "none/out.npz", "--assume-spec", "wbc32"), "there is no folder 'none'"),
        (("check", "chunk.npz", "--assume-spec", "wbc33"), "wbc32"),
    ],
)
def test_misuse_is_told_before_anything_is_simulated(inside, tmp_path, monkeypatch, arguments, says):
    monkeypatch.chdir(tmp_path)
    np.savez(tmp_path / "chunk.npz", actions=np.zeros((10, 32)), fps=30.0)
    (tmp_path / "broken.yaml").write_text("solvr: quadprog\n")
    answer = inside(*arguments)
    assert answer.returncode == 2
    assert says in answer.stderr
    assert len(answer.stderr.splitlines()) == 1
    assert answer.stdout == ""


def test_a_run_writes_its_recording_and_a_picture_or_says_why_not(inside, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "c.yaml").write_text("verdict:\n  palm_repair: 0.06\n")
    options = ("--record", "run.npz", "--sheet", "run.png", "--config", "c.yaml", "--json", "run.json")
    more = ("--sensors", "realistic", "--delay-ms", "4", "--payload-kg", "0.5", "0.5")
    answer = inside("run", "wave", *SHORT, *options, *more)
    assert answer.returncode == 0, answer.stderr
    with np.load(tmp_path / "run.npz", allow_pickle=False) as data:
        assert len(data["time"]) == round(1.4 / 0.002)
    (verdict,) = json.loads((tmp_path / "run.json").read_text())
    assert verdict["config"]["verdict"]["palm_repair"] == 0.06
    assert (tmp_path / "run.png").exists() or "libegl1" in answer.stderr


def test_a_folder_of_motions_becomes_a_table(inside, tmp_path):
    """A row a motion, and in the JSON what the row was made of."""
    rows = np.zeros((20, 36))
    rows[:, 2], rows[:, 6] = 0.79, 1.0
    np.savetxt(tmp_path / "still.csv", rows, delimiter=",")
    answer = inside("run", "--motions", str(tmp_path), *SHORT, "--json", str(tmp_path / "study.json"))
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.splitlines()[0].split()[:3] == ["motion", "fell", "demandable"]
    assert answer.stdout.splitlines()[1].split()[:2] == ["still", "no"]
    assert "1 motion, 0 falls" in answer.stdout
    (verdict,) = json.loads((tmp_path / "study.json").read_text())
    assert verdict["seconds"]["hold"] + verdict["seconds"].get("slowed", 0.0) > 1.0


@pytest.mark.parametrize(
    ("answer", "chunks", "code"), [("feasible", 3, 0), ("feasible", 0, 1), ("infeasible", 3, 1)], ids=str
)
def test_a_run_in_which_the_policy_did_nothing_is_no_success(inside, monkeypatch, answer, chunks, code):
    """``lerobot-rollout`` of 0.6.1 sends no command and ends with code 0 when every call of the policy fails."""
    verdict = Verdict(name="wave", verdict=answer, fell=False, timing=Timing(chunks=chunks))
    monkeypatch.setattr(run_command, "make_checker", lambda *_: SimpleNamespace(check=lambda *_, **__: (verdict, None)))
    assert inside("run", "wave").returncode == code


class Breaking:
    """A checker with a fault of its own in the first input, as numpy and Python raise them; `made` counts them."""

    made, episode = 0, EpisodeConfig()

    def __init__(self, error):
        self.error = error
        Breaking.made += 1

    def check(self, policy, name, duration, **_):
        if policy.name == "reach":
            raise self.error
        return Verdict(name=name, verdict="feasible", fell=False, timing=Timing(chunks=3)), None


@pytest.mark.parametrize(
    "error", [KeyError("left"), ValueError("shapes (3,) (4,)"), np.linalg.LinAlgError("singular"), InputError("field")]
)
def test_7_a_crash_of_ours_has_code_3_and_one_sentence_and_the_other_inputs_are_judged(inside, monkeypatch, error):
    """It used to end with code 1, that of "infeasible", a traceback, and no verdict on what came after it."""
    planned = SimpleNamespace(check=lambda *_, **__: Verdict(name="", verdict="feasible", fell=False))
    monkeypatch.setattr("wholebody.cli.judging.make_fast_checker", lambda *_, **__: planned)
    monkeypatch.setattr("wholebody.cli.judging.make_checker", lambda *_: Breaking(error))
    Breaking.made = 0
    answer = inside("check", "reach", "wave")
    assert answer.returncode == 3
    (line,) = answer.stderr.splitlines()
    assert line.startswith(
        f"wholebody: reach: this is a fault of wholebody, not of the input: {type(error).__name__}: "
    )
    assert "(wholebody/cli/judging.py:" in line
    assert "report it on the project's issue tracker" in line
    assert answer.stdout.startswith("FEASIBLE  wave: ")
    assert Breaking.made == 2, "what was in the middle of something is not used again"


def test_7_a_crash_of_a_run_has_code_3_too(inside, monkeypatch):
    monkeypatch.setattr("wholebody.cli.commands.run.make_checker", lambda *_: Breaking(ValueError("a")))
    assert inside("run", "reach").returncode == 3
    monkeypatch.setattr("wholebody.cli.commands.run.make_checker", lambda *_: 1 / 0)
    answer = inside("run", "reach")
    assert answer.returncode == 3
    assert len(answer.stderr.splitlines()) == 1


def test_7_a_crash_is_worse_than_a_malformed_input(inside, monkeypatch, tmp_path):
    monkeypatch.setattr("wholebody.cli.judging.make_checker", lambda *_: Breaking(KeyError("left")))
    (tmp_path / "motion.csv").write_text("1,2\n")
    assert inside("check", "reach", str(tmp_path / "motion.csv")).returncode == 3


def test_7_ctrl_c_stays_130(inside, monkeypatch):
    monkeypatch.setattr("wholebody.cli.judging.make_checker", lambda *_: Breaking(KeyboardInterrupt()))
    answer = inside("check", "reach", "wave")
    assert (answer.returncode, answer.stdout) == (130, "")


def test_what_has_no_end_is_refused_before_it_is_loaded(inside, tmp_path):
    (tmp_path / "config.json").write_text("{}")
    answer = inside("run", str(tmp_path))
    assert (answer.returncode, answer.stderr) == (2, f"wholebody: {NO_END}\n")
