"""Strategy: chunk files at the command line, judged by their plans."""

import json

import jsonschema
import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.codec import encode
from policy.chunk import ActionChunk
from policy.recorded.chunk_file import ChunkFile, write_chunk_file
from wholebody.resources import verdict_schema

SPEC, STANCE, FPS = builtin("wbc32"), Anchor.nominal(), 30.0


def chunk_file(path, *, ahead):
    """Both hands stay that far ahead of the stance [m]."""
    T = [np.tile(STANCE.T_world_base @ STANCE.poses[hand], (40, 1, 1)) for hand in ("lhand", "rhand")]
    for poses in T:
        poses[:, 0, 3] += ahead
    fingers = [np.tile(q, (40, 1)) for q in (STANCE.q_lhand, STANCE.q_rhand)]
    chunk = ActionChunk(SPEC.id, 0, 0.0, FPS, *T, *fingers)
    write_chunk_file(path, ChunkFile(SPEC, encode(SPEC, chunk, STANCE), FPS))
    return path


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
