"""An audit says how measured joints follow commanded ones, and what each dataset was read as.

Strategy: a set is written whose states are its actions three rows later with one elbow off by a tenth of a radian; the
command is run as users run it, and its tables are held against what was put in.
"""

import json

import numpy as np
import pyarrow.parquet
import pytest

from policy.suspicion.gaps import joint_gaps
from tests.support.other_forms import JOINT28, rows
from tests.support.written_datasets import write_dataset

ROWS, LATE, OFF = 60, 3, 0.1
ELBOW = JOINT28.index("left_elbow_joint")


def episode():
    action = rows(JOINT28, ROWS)
    state = np.vstack([*[action[:1]] * LATE, action[:-LATE]])
    state[:, ELBOW] += OFF
    return {"action": action, "observation.state": state}


def test_each_joint_has_its_offset_and_delay(inside, tmp_path):
    folder = write_dataset(
        tmp_path / "set", [episode()] * 2, {"action": JOINT28, "observation.state": JOINT28}, precision="float64"
    )
    done = inside("audit", str(folder), "-j", "1", "--no-slower", "--to", str(tmp_path / "audit"))
    assert done.returncode == 0, done.stderr
    assert "states beside actions in 2 of 2: 100 ms later in the median joint, left_elbow_joint off by +0.100" in (
        done.stdout
    )
    table = pyarrow.parquet.read_table(tmp_path / "audit" / "joints.parquet").to_pylist()
    assert len(table) == 2 * len(JOINT28)
    of = {(row["episode"], row["joint"]): row for row in table}
    for number in (0, 1):
        for joint in JOINT28[:14]:
            row = of[number, joint]
            assert row["offset"] == pytest.approx(OFF if joint == "left_elbow_joint" else 0.0, abs=1e-9)
            assert row["delay"] == pytest.approx(LATE / 30.0)
        assert of[number, JOINT28[20]]["delay"] is None  # a finger that stands still shows none
    said = json.loads((tmp_path / "audit" / "datasets.json").read_text())[str(folder)]
    assert said["features"]["action"]["joints"] == JOINT28
    assert said["features"]["observation.state"]["left_out"] == {}
    assert said["episodes"] == 2


def test_noise_does_not_move_the_delay():
    rng = np.random.default_rng(0)
    data = episode()
    noisy = data["observation.state"] + rng.normal(0.0, 2e-3, (ROWS, len(JOINT28)))
    for gap in joint_gaps(noisy, data["action"], JOINT28, 30.0)[:14]:
        if np.ptp(data["action"][:, JOINT28.index(gap.joint)]) > 0.1:
            assert gap.delay == pytest.approx(LATE / 30.0, abs=1.01 / 30.0)


def test_few_rows_say_nothing():
    data = episode()
    assert joint_gaps(data["observation.state"][:5], data["action"][:5], JOINT28, 30.0) == []
