"""Strategy: chunk files at the command line, judged by their plans and repaired; what is written is judged again."""

import json

import jsonschema
import numpy as np

from policy.action_spec.codec import encode
from policy.recorded.chunk_file import ChunkFile, read_chunk_file, write_chunk_file
from tests.support.commands import wholebody
from tests.support.planted_causes import planted
from tests.support.sent_chunks import FPS, SPEC, STANCE, sent
from wholebody.cli import console
from wholebody.resources import verdict_schema


def file_of(chunk, path):
    write_chunk_file(path, ChunkFile(SPEC, encode(SPEC, chunk, STANCE), FPS))
    return path


def chunk_file(path, *, ahead):
    """Both hands stay that far ahead of the stance [m]."""
    return file_of(sent(to=(0.0, 0.0, 0.0), jump=(ahead, 0.0, 0.0)), path)


def test_a_chunk_file_is_judged_from_its_first_step_or_from_the_stance(inside, tmp_path):
    file = chunk_file(tmp_path / "chunk.npz", ahead=0.1)
    for arguments, start in (((), 0.0), (("--start", "stance"), 0.1)):
        done = inside("check", "--fast", *arguments, file, "--json", "-")
        (verdict,) = found = json.loads(done.stdout)
        jsonschema.validate(found, json.loads(verdict_schema().read_text()))
        assert (done.returncode, verdict["verdict"], verdict["method"]) == (0, "feasible", "fast")
        assert abs(verdict["start_m"] - start) < 1e-3


def test_a_hand_that_flicks_before_the_first_plan_could_be_there_is_seen_by_both_checks(inside, tmp_path):
    """It was "done as given" once: steps before the first plan, and until hands had caught up, did not count."""
    chunk = sent(to=(0.0, 0.0, 0.0))
    chunk.T_world_rhand[1:10, 2, 3] += 0.29
    for arguments in (("--fast",), ("--hold", "0.1")):
        done = inside("check", *arguments, file_of(chunk, tmp_path / "flick.npz"), "--json", "-")
        (verdict,) = json.loads(done.stdout)
        assert (done.returncode, verdict["verdict"]) == (1, "infeasible")
        assert verdict["moved_max_m"] > 0.2
        assert verdict["violations"][0]["step"] < 15


def test_a_chunk_that_cannot_be_done_ends_with_1_and_says_why(inside, tmp_path):
    done = inside("check", "--fast", chunk_file(tmp_path / "far.npz", ahead=1.5))
    assert (done.returncode, done.stdout.split()[0]) == (1, "INFEASIBLE")


def test_what_only_a_simulation_has_is_refused(inside, tmp_path):
    done = inside("check", "--fast", "--realistic", chunk_file(tmp_path / "chunk.npz", ahead=0.0))
    assert done.returncode == 2
    assert "--realistic" in done.stderr


def test_the_command_writes_a_feasible_chunk_unchanged_and_repairs_another(inside, tmp_path):
    given, out = file_of(sent(), tmp_path / "plain.npz"), tmp_path / "out.npz"
    done = inside("repair", given, out)
    assert (done.returncode, "unchanged" in done.stdout) == (0, True)
    np.testing.assert_allclose(read_chunk_file(out).actions, read_chunk_file(given).actions, atol=1e-9)
    chunk = sent()
    chunk.q_lhand[:, 0] = 1.5
    done = inside("repair", file_of(chunk, tmp_path / "finger.npz"), out)
    assert (done.returncode, "checked again" in done.stdout) == (0, True)
    assert inside("check", "--fast", out).stdout.startswith("FEASIBLE  ")
    assert inside("repair", file_of(sent(to=(2.0, 0.0, 0.0)), tmp_path / "far.npz"), out).returncode == 1


def test_beside_furniture_a_chunk_is_no_longer_feasible_as_it_is(inside, tmp_path):
    given, out = file_of(planted("scene", 0).chunk, tmp_path / "into.npz"), tmp_path / "out.npz"
    done = inside("repair", given, out)
    assert (done.returncode, "unchanged" in done.stdout, out.exists()) == (0, True, True)
    out.unlink()
    done = inside("repair", given, out, "--scene", "table")
    assert (done.returncode, "nothing written" in done.stdout, out.exists()) == (1, True, False)


def test_a_simulated_check_begins_at_the_first_step_too_and_tells_what_its_plans_had_said(inside, tmp_path):
    file = chunk_file(tmp_path / "chunk.npz", ahead=0.1)
    for arguments, start in (((), 0.0), (("--start", "stance"), 0.1)):
        done = inside("check", *arguments, file, "--hold", "0", "--duration", "0.5", "--json", "-")
        (verdict,) = found = json.loads(done.stdout)
        jsonschema.validate(found, json.loads(verdict_schema().read_text()))
        assert (verdict["verdict"], verdict["method"], verdict["fast"]) == ("feasible", "simulated", "feasible")
        assert verdict["margins"]
        assert abs(verdict["start_m"] - start) < 2e-3


def test_a_check_as_given_follows_no_plan(inside, tmp_path):
    file = file_of(sent(to=(0.7, 0.0, 0.0)), tmp_path / "far.npz")
    done = inside("check", "--as-given", file, "--hold", "0", "--json", "-")
    (verdict,) = json.loads(done.stdout)
    assert (done.returncode, verdict["follow"], verdict["moved_max_m"] < 1e-4) == (1, "as_given", True)
    assert verdict["violations"][0]["code"] in ("palm_missed", "fall")


def test_many_files_say_how_many_are_judged(inside, tmp_path, monkeypatch):
    files = [file_of(sent(to=(0.001 * k, 0.0, 0.0)), tmp_path / f"{k}.npz") for k in range(20)]
    monkeypatch.setattr(console, "FIRST_BEAT", 0.0)
    monkeypatch.setattr(console, "HEARTBEAT", 0.02)
    done = inside("check", "--fast", *files)
    assert done.returncode == 0
    assert "of 20 (" in done.stderr
    assert done.stdout.count("FEASIBLE  ") == 20


def test_an_input_in_realistic_worlds_tells_the_share_that_held(tmp_path):
    file_of(sent(), tmp_path / "chunk.npz")
    options = ("--worlds", "2", "--robot-seed", "5", "--hold", "0", "--duration", "0.3", "--json", "v.json")
    done = wholebody("check", "chunk.npz", *options, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "2 of 2 realistic worlds held, seeds 5 to 6" in done.stdout
    (verdict,) = found = json.loads((tmp_path / "v.json").read_text())
    jsonschema.validate(found, json.loads(verdict_schema().read_text()))
    worlds = verdict["worlds"]
    assert (worlds["seeds"], worlds["held"], worlds["fell"], worlds["share"]) == ([5, 6], 2, [], 1.0)


def test_what_simulates_is_refused_where_nothing_is_simulated(inside):
    for option in (("--worlds", "3"), ("--as-given",)):
        done = inside("check", "--fast", *option, "wave")
        assert (done.returncode, "leave one out" in done.stderr) == (2, True)
    assert inside("check", "--worlds", "-1", "wave").returncode == 2
