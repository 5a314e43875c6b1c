"""Strategy: chunk files at the command line, judged by their plans and repaired; what is written is judged again."""

import json

import jsonschema
import numpy as np

from policy.action_spec.codec import encode
from policy.recorded.chunk_file import ChunkFile, read_chunk_file, write_chunk_file
from tests.support.sent_chunks import FPS, SPEC, STANCE, sent
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
