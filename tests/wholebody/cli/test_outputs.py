"""Strategy: readers that leave, disks that are full, and what a run ends with."""

import os
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from policy.writing import OutputError
from wholebody.cli.commands.run import _failed
from wholebody.cli.console import JsonVerdicts
from wholebody.cli.crash import ours
from wholebody.cli.main import OUTPUT_CLOSED
from wholebody.verdict.audit.outcome import AuditOutcome
from wholebody.verdict.audit.summary import PAGE, write_summary


def test_a_reader_that_leaves_is_no_answer():
    """`check a b | head -1` ended with 1, as if something was infeasible."""
    program = "import wholebody.cli.main as m, sys; sys.argv = ['wholebody', 'layouts']; m.main()"
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    process.stdout.close()
    said = process.stderr.read()
    assert process.wait() == OUTPUT_CLOSED == 128 + 13
    assert said == ""


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
def test_a_full_disk_names_the_file_and_is_not_the_inputs_fault(inside):
    answer = inside("layouts", "wbc32", "--json", "/dev/full")
    assert answer.returncode == 2
    assert "cannot write '/dev/full': No space left on device" in answer.stderr
    assert "malformed" not in answer.stderr


def test_verdicts_that_cannot_be_written_leave_no_empty_file(tmp_path, monkeypatch):
    file = tmp_path / "a.json"
    written = JsonVerdicts(str(file)).__enter__()
    monkeypatch.setattr(written, "_file", SimpleNamespace(write=full, close=written._file.close))
    with pytest.raises(OutputError, match=r"a\.json"):
        written._write("x")
    assert not file.exists()


def full(_):
    raise OSError(28, "No space left on device")


def test_a_file_that_cannot_be_written_is_no_fault_of_ours():
    with pytest.raises(OutputError), ours():
        raise OutputError(28, "cannot write 'a': No space left on device")


def test_a_run_that_is_infeasible_does_not_end_as_one_that_is_not():
    verdict = SimpleNamespace(verdict="infeasible", fell=False, timing=SimpleNamespace(chunks=3), violations=[])
    assert _failed(verdict, strict=False)
    verdict.verdict = "feasible_after_repair"
    assert not _failed(verdict, strict=False)


def test_an_audit_shows_notes_and_links_its_inputs(tmp_path):
    file = tmp_path / "a b.npz"
    np.savez(file)
    note = {"code": "assumed", "severity": "note", "subject": "hands may be <swapped>", "time": None}
    verdict = {
        "verdict": "feasible",
        "fell": False,
        "moved_max_m": 0.0,
        "moved_turn_max_rad": 0.0,
        "violations": [note],
    }
    judged = [AuditOutcome(name=name, ending="judged", verdict=verdict) for name in (str(file), f"{file}#3", "wave")]
    write_summary(tmp_path, judged)
    text = (tmp_path / PAGE).read_text()
    assert text.count("<i>hands may be &lt;swapped&gt;</i>") == 3
    assert text.count(f'<a href="{file.as_uri()}">') == 2
