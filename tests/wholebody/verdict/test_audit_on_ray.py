"""Strategy: a local Ray cluster of several workers does the same as processes do, row by row, though one is killed."""

import pyarrow.parquet
import pytest

from tests.support.audited import judging
from tests.support.commands import wholebody
from tests.support.pages import chunk_file
from wholebody.verdict.audit.on_ray import LOCAL, outcomes

pytestmark = pytest.mark.regression


def test_a_worker_that_is_killed_is_replaced_and_its_input_done(tmp_path):
    names = ["a", f"die_once:{tmp_path / 'died'}", "die:", "sleep:600", *"bcdef"]
    found = {one.name: one for one in outcomes(names, judging, jobs=3, limit=5.0, address=LOCAL, loading=60.0)}
    endings = {name: one.ending for name, one in found.items()}
    assert endings == dict.fromkeys(names, "judged") | {"die:": "crashed", "sleep:600": "timed_out"}
    assert len({one.verdict["process"] for one in found.values() if one.verdict}) > 1


def test_ray_equals_local(tmp_path):
    for name in ("fine", "too_fast", "too_far"):
        chunk_file(tmp_path, name)
    tables = []
    for options in (["-j", "2"], ["-j", "2", "--ray", LOCAL]):
        to = tmp_path / f"to_{len(options)}"
        done = wholebody("audit", str(tmp_path), "--to", str(to), *options)
        assert done.returncode == 1, done.stderr
        tables.append([pyarrow.parquet.read_table(path).to_pylist() for path in sorted(to.glob("*.parquet"))])
    assert tables[0] == tables[1]
