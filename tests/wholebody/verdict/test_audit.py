"""Strategy: processes and journal with inputs that sleep and die; then the command itself on real chunks, killed in the
middle and gone on with, against the same that was left alone."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet
import pytest

from tests.support.audited import judging
from tests.support.commands import wholebody
from tests.support.pages import chunk_file
from wholebody.cli.commands.audit import _summary
from wholebody.errors import InputError
from wholebody.verdict.audit.audit import audit
from wholebody.verdict.audit.journal import NAME, Journal
from wholebody.verdict.audit.lists import delete_settings, slow_down, to_delete
from wholebody.verdict.audit.outcome import AuditOutcome
from wholebody.verdict.audit.tables import episode_row
from wholebody.verdict.audit.workers import outcomes

TABLES = ("episodes.parquet", "violations.parquet")
ASKED = {"fps": 30.0}


def outcome(name, answer="feasible", **more):
    verdict = {"verdict": answer, "fell": False, "moved_max_m": 0.0, "moved_turn_max_rad": 0.0, "violations": []}
    return AuditOutcome(name=name, ending="judged", verdict=verdict, motion_s=2.0, **more)


def test_a_process_that_dies_is_replaced_and_its_input_done(tmp_path):
    names = ["a", f"die_once:{tmp_path / 'died'}", "b", "c"]
    found = {one.name: one for one in outcomes(names, judging, jobs=2, limit=60.0)}
    assert found.keys() == set(names)
    assert {one.ending for one in found.values()} == {"judged"}


def test_an_input_that_kills_its_process_and_one_that_takes_too_long_are_told():
    names = ["die:", "sleep:600", "a"]
    found = {one.name: one for one in outcomes(names, judging, jobs=3, limit=1.0, loading=2.0)}
    endings = {name: one.ending for name, one in found.items()}
    assert endings == {"die:": "crashed", "sleep:600": "timed_out", "a": "judged"}
    assert "within 1 s" in found["sleep:600"].message


def test_wrong_options_end_an_audit():
    with pytest.raises(InputError, match="these options are wrong"):
        list(outcomes(["a", "wrong:"], judging, jobs=1, limit=60.0))


def test_a_journal_forgets_half_a_line_and_nothing_else(tmp_path):
    journal = Journal(tmp_path, ASKED)
    for name in "ab":
        journal.add(outcome(name))
    journal.close()
    path = tmp_path / NAME
    path.write_bytes(path.read_bytes()[:-9])
    again = Journal(tmp_path, ASKED)
    assert list(again.done) == ["a"]
    again.add(outcome("b"))
    again.close()
    assert Journal(tmp_path, ASKED).done == {name: outcome(name) for name in "ab"}


def test_a_journal_of_other_settings_is_not_gone_on_with(tmp_path):
    Journal(tmp_path, ASKED).close()
    with pytest.raises(InputError, match=r"other settings \(fps\).*--to"):
        Journal(tmp_path, {"fps": 60.0})
    with pytest.raises(InputError, match=r"other settings \(.*fps.*\)"):
        Journal(tmp_path, {})  # of a version that did not ask for it


def test_a_journal_that_an_audit_is_writing_is_left_to_it(tmp_path):
    first = Journal(tmp_path, ASKED)
    with pytest.raises(InputError, match="another audit"):
        Journal(tmp_path, ASKED)
    first.add(outcome("a"))
    first.close()
    last = Journal(tmp_path, ASKED)
    last.close()
    assert list(last.done) == ["a"]


def test_an_input_that_changed_and_one_that_was_not_judged_are_judged_again(tmp_path):
    (tmp_path / "a.npz").write_text("1")
    data = tmp_path / "set" / "data"
    data.mkdir(parents=True)
    (data / "0.parquet").write_text("1")
    names, judged = [*(str(tmp_path / name) for name in ("a.npz", "b.npz", "late.npz")), f"{tmp_path / 'set'}#0"], []

    def judge(left):
        judged.append(sorted(Path(name).name for name in left))
        return (AuditOutcome(name=n, ending="timed_out") if "late" in n else outcome(n) for n in left)

    audit(names, tmp_path / "to", judge, asked=ASKED)
    (tmp_path / "a.npz").write_text("12")
    audit(names, tmp_path / "to", judge, asked=ASKED)
    (data / "0.parquet").write_text("12")
    audit(names, tmp_path / "to", judge, asked=ASKED)
    assert judged == [["a.npz", "b.npz", "late.npz", "set#0"], ["a.npz", "late.npz"], ["late.npz", "set#0"]]


def test_names_that_are_not_utf8_and_datasets_that_are_not_there_are_written(tmp_path):
    names = [os.fsdecode(b"bad\xff.npz"), "nosuch#3"]

    def judge(left):
        return (AuditOutcome(name=name, ending="malformed", message=f"no {name}") for name in left)

    audit(names, tmp_path, judge, asked=ASKED)
    table = pyarrow.parquet.read_table(tmp_path / "episodes.parquet")
    assert table["name"].to_pylist() == ["bad\\udcff.npz", "nosuch#3"]
    assert "bad\\udcff.npz" in (tmp_path / "index.html").read_text()
    assert not list(tmp_path.glob("delete_*.json"))


def test_what_is_audited_into_a_folder_later_is_added_to_its_answers_and_what_is_gone_is_not(tmp_path):
    a, b, c = (tmp_path / name for name in ("a.npz", "b.npz", "c.npz"))

    def audited(file):
        file.write_text("1")
        found = audit([str(file)], tmp_path / "to", lambda left: map(outcome, left), asked=ASKED)
        assert [one.name for one in found] == [str(file)]
        table = pyarrow.parquet.read_table(tmp_path / "to" / "episodes.parquet")
        return [Path(name).name for name in table["source"].to_pylist()]

    assert audited(a) == ["a.npz"]
    assert audited(b) == ["b.npz", "a.npz"]
    a.unlink()
    assert audited(c) == ["c.npz", "b.npz"]


def test_a_row_has_the_first_line_and_why_the_worst_is_so():
    """`palm_missed` alone does not say whether a hand was lost, late or waiting."""
    late = {"code": "palm_missed", "cause": "late", "time": 0.3}
    found = outcome("a.npz", "infeasible")
    found.verdict.update(headline="left hand off", violations=[late])
    row = episode_row(found)
    assert (row["worst"], row["worst_cause"], row["headline"]) == ("palm_missed", "late", "left hand off")


def test_lists_have_what_no_speed_makes_feasible_and_what_one_does():
    found = [
        outcome("set#0"),
        outcome("set#1", "infeasible"),
        outcome("set#2", "infeasible", slower=1.6),
        outcome("set#3", "feasible_after_repair"),
        AuditOutcome(name="set#4", ending="malformed"),
        outcome("motion.csv", "infeasible"),
    ]
    assert to_delete(found) == {"set": [1, 4]}
    assert slow_down(found) == [{"source": "set", "episode": 2, "slower": 1.6}]
    assert delete_settings("a/set", [1, 4])["operation"] == {"type": "delete_episodes", "episode_indices": [1, 4]}


@pytest.fixture(scope="module")
def chunks(tmp_path_factory):
    """A folder with chunks that are fine, too fast and too far, and one that is none."""
    folder = tmp_path_factory.mktemp("chunks")
    for name in ("fine", "too_fast", "too_far"):
        chunk_file(folder, name)
    (folder / "broken.npz").write_bytes(b"no archive")
    return folder


def rows(folder):
    return [pyarrow.parquet.read_table(folder / name).to_pylist() for name in TABLES]


def test_an_audit_that_is_killed_and_gone_on_with_equals_one_that_is_not(chunks, tmp_path):
    whole = wholebody("audit", str(chunks), "--to", str(tmp_path / "whole"), "-j", "2")
    assert whole.returncode == 2, whole.stderr
    killed = tmp_path / "killed"
    code = "from wholebody.cli.main import main; main()"
    arguments = [sys.executable, "-c", code, "audit", str(chunks), "--to", str(killed), "-j", "1"]
    process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    journal = killed / NAME
    while not (journal.exists() and journal.read_bytes().count(b"\n") >= 3) and process.poll() is None:
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    before = journal.read_bytes()
    assert not (killed / TABLES[0]).exists()
    done = wholebody("audit", str(chunks), "--to", str(killed), "-j", "2")
    assert done.returncode == 2, done.stderr
    assert rows(killed) == rows(tmp_path / "whole")
    # Nothing is done twice, and what was done is as it was.
    assert journal.read_bytes().startswith(before[: before.rfind(b"\n") + 1])
    names = [json.loads(line)["name"] for line in journal.read_bytes().splitlines()[1:]]
    assert sorted(names) == sorted(str(path) for path in chunks.iterdir())
    episodes, violations = rows(killed)
    answers = {row["name"].rpartition("/")[2]: (row["answer"], row["slower"]) for row in episodes}
    assert answers == {
        "broken.npz": ("malformed", None),
        "fine.npz": ("feasible", None),
        "too_far.npz": ("infeasible", None),
        "too_fast.npz": ("infeasible", 2.0),
    }
    assert {row["code"] for row in violations} >= {"out_of_reach"}
    assert "too_far.npz" in (killed / "index.html").read_text()


def test_what_could_not_be_judged_is_named_up_to_five():
    found = [AuditOutcome(name=f"{k}.npz", ending="malformed") for k in range(7)]
    lines = list(_summary([outcome("fine"), *found, AuditOutcome(name="slow.npz", ending="timed_out")], Path("audit")))
    assert "malformed: 0.npz, 1.npz, 2.npz, 3.npz, 4.npz and 2 more" in lines
    assert "timed out: slow.npz" in lines
    assert not any(line.startswith("malformed") for line in _summary([outcome("fine")], Path("audit")))
