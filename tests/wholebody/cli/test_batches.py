"""Many inputs at the command line: side by side, verdicts as they come, strict exit codes, completion by the shell."""

import json
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from types import SimpleNamespace

import jsonschema
import numpy as np
import pytest

from policy.action_spec.builtin import LAYOUTS, builtin
from policy.action_spec.describe import stance_numbers
from policy.scripted.library import SCRIPTS
from tests.support.commands import wholebody
from wholebody.cli import judging
from wholebody.cli.console import JsonVerdicts
from wholebody.cli.options import Input, Judging, Sampling, Simulation
from wholebody.episode.timing import Timing
from wholebody.resources import verdict_schema
from wholebody.types import Reason
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.violations import Severity, Violation

FEASIBLE = Verdict(name="wave", verdict="feasible", fell=False, timing=Timing(chunks=3))


@pytest.fixture
def completed(inside, monkeypatch):
    """What a shell gets for a line that ends in the last word."""

    def call(words):
        monkeypatch.setenv("COMP_WORDS", words)
        monkeypatch.setenv("COMP_CWORD", str(len(words.split(" ")) - 1))
        monkeypatch.setenv("_WHOLEBODY_COMPLETE", "complete_bash")
        said = inside().stdout.split()
        monkeypatch.delenv("_WHOLEBODY_COMPLETE")
        return said

    return call


def test_c8_the_shell_completes_commands_options_scripts_and_layouts(completed, inside, monkeypatch):
    assert {"run", "check", "layouts", "spec", "serve-policy"} <= set(completed("wholebody "))
    assert set(completed("wholebody run ")) == {*SCRIPTS, "learned", "learned_place"}
    assert completed("wholebody layouts wbc") == [name for name in LAYOUTS if name.startswith("wbc")]
    assert "--strict" in completed("wholebody run --str")
    assert "--install-completion" in inside("--help").stdout
    monkeypatch.setenv("_WHOLEBODY_COMPLETE", "source_bash")
    assert "complete -o default" in inside().stdout


def test_c8_json_is_a_list_that_grows_by_a_line_a_verdict_as_they_come(tmp_path):
    target = tmp_path / "verdicts.json"
    with JsonVerdicts(str(target)) as written:
        written.add(FEASIBLE)
        (line,) = target.read_text().splitlines()[1:]
        assert json.loads(line)["name"] == "wave"
        written.add(FEASIBLE)
        assert len(target.read_text().splitlines()) == 3
    verdicts = json.loads(target.read_text())
    jsonschema.validate(verdicts, json.loads(verdict_schema().read_text()))
    assert len(verdicts) == 2


def test_json_that_is_broken_off_is_a_list_of_what_there_was(tmp_path):
    target = tmp_path / "verdicts.json"
    written = JsonVerdicts(str(target)).__enter__()
    written.add(FEASIBLE)
    written.__exit__(KeyboardInterrupt)
    assert len(json.loads(target.read_text())) == 1
    with JsonVerdicts(str(target)):
        pass
    assert json.loads(target.read_text()) == []


def test_json_in_a_file_of_lines_is_lines(tmp_path):
    target = tmp_path / "verdicts.jsonl"
    with JsonVerdicts(str(target)) as written:
        written.add(FEASIBLE)
        written.add(FEASIBLE)
    assert [json.loads(line)["name"] for line in target.read_text().splitlines()] == ["wave", "wave"]


def test_a_file_that_cannot_be_written_is_told_before_anything_is_simulated(inside, tmp_path, monkeypatch):
    monkeypatch.setattr("wholebody.cli.judging.make_checker", lambda *_: pytest.fail("simulated"))
    answer = inside("check", "wave", "--json", tmp_path)
    assert answer.returncode == 2
    assert str(tmp_path) in answer.stderr


@pytest.mark.parametrize(("reason", "code"), [(Reason.REFUSED, 1), (Reason.STARVED, 1), (Reason.SELF_CONTACT, 0)])
def test_c8_a_strict_run_ends_with_1_for_a_refused_or_starved_input(inside, monkeypatch, reason, code):
    found = Violation(code=reason, severity=Severity.REPAIR, subject="the first of them")
    verdict = replace(FEASIBLE, verdict="feasible_after_repair", violations=[found])
    made = SimpleNamespace(check=lambda *_, **__: (verdict, None))
    monkeypatch.setattr("wholebody.cli.commands.run.make_checker", lambda *_: made)
    assert inside("run", "wave").returncode == 0
    assert inside("run", "wave", "--strict").returncode == code


def test_c8_inputs_side_by_side_are_answered_in_their_order_with_the_largest_exit_code(tmp_path):
    """A long input first: its answer comes first all the same."""
    actions = np.tile(stance_numbers(builtin("wbc32")), (60, 1))
    np.savez(tmp_path / "long.npz", actions=actions, fps=30.0, spec="wbc32")
    np.savez(tmp_path / "short.npz", actions=actions[:6], fps=30.0, spec="wbc32")
    (tmp_path / "broken.npz").write_bytes(b"PK")
    names = ["long.npz", "broken.npz", "short.npz"]
    answer = wholebody("check", *names, "-j", "2", "--hold", "0.2", "--json", "v.jsonl", cwd=tmp_path)
    assert answer.returncode == 2, answer.stderr
    assert [line.split()[1] for line in answer.stdout.splitlines() if line.startswith("FEASIBLE")] == [
        "long.npz:",
        "short.npz:",
    ]
    (line,) = (x for x in answer.stderr.splitlines() if "judging" not in x and not x.startswith("wrote "))
    assert line.startswith("wholebody: broken.npz: ")
    said = [json.loads(line)["name"] for line in (tmp_path / "v.jsonl").read_text().splitlines()]
    assert said == ["long.npz", "short.npz"]


def test_options_that_are_wrong_for_every_input_are_told_once(inside, monkeypatch):
    answer = inside("check", "wave", "-j", "0")
    assert (answer.returncode, answer.stderr) == (2, "wholebody: -j is 0; 1 to 256 inputs can be judged side by side\n")
    judge = judging.InputJudge(Input(), Simulation(scene="tabel"), Sampling(), Judging(), quiet=True)
    monkeypatch.setattr(judging, "_judge", judge, raising=False)
    found = judging._judge_apart("wave")
    assert "no scene 'tabel'; did you mean" in found.misuse
    done = Future()
    done.set_result(found)
    with pytest.raises(ValueError, match="no scene 'tabel'"):
        judging._wait("wave", done, quiet=True)


def test_an_input_whose_process_was_killed_is_a_crash_and_not_a_hang(capsys):
    killed = Future()
    killed.set_exception(BrokenProcessPool())
    assert judging._wait("wave", killed, quiet=True).code == 3
    assert capsys.readouterr().err == f"wholebody: wave: {judging.BROKEN}\n"
