"""What a run did, beside what it was asked: rows in the slots of a layout."""

import numpy as np
import pytest

from models import g1
from policy import Anchor, builtin, decode
from policy.geometry.se3 import translated
from policy.kinematics.forward import kinematics
from tests.support.recordings import made_record
from wholebody import InputError, record_executed

AHEAD = np.array([0.01, 0.0, 0.0])
SOLES = 1e-7
"""How level and central the soles of the stance are, as its joints are rounded [m]."""


def run(n=1000, moved=AHEAD):
    """A stance whose elbows swing for 2 s, palms asked to be somewhere else by as much all the time."""
    spec, anchor = g1(), Anchor.nominal()
    record = made_record(n)
    body = np.tile(anchor.q_body, (n, 1))
    for side in ("left", "right"):
        body[:, spec.body_joints.index(f"{side}_elbow_joint")] += 0.3 * np.sin(np.linspace(0.0, 6.0, n))
    joints = np.hstack([body, np.tile(spec.hand_neutral, (n, 1))])
    record["q"][:, :3], record["q"][:, 3:7] = anchor.T_world_base[:3, 3], (0.0, 0.0, 0.0, 1.0)
    record["q"][:, 7:] = joints[:, [spec.joint_names.index(name) for name in record["joint_names"]]]
    record["q_command"][:] = joints
    T_base_world = anchor.T_world_base.copy()
    poses = kinematics().poses(body)
    for k, (hand, tool) in enumerate(zip(("lhand", "rhand"), spec.tools, strict=True)):
        palms = translated(T_base_world @ poses[hand], tool.palm_offset)
        palms[:, :3, 3] += moved
        record["T_world_palms_asked"][:, k] = palms
    record["T_world_palms_asked"][:100] = np.nan
    return record, poses


def test_requested_and_executed_are_rows_of_the_layout_at_its_rate():
    record, poses = run()
    rows = record_executed(record, "wbc32")
    assert rows.layout.dim == rows.requested.shape[1] == rows.executed.shape[1] == 32
    np.testing.assert_allclose(np.diff(rows.times), 1.0 / 30.0, atol=2.1e-3)
    assert rows.times[0] == record["time"][100]
    at = np.searchsorted(record["time"], rows.times)
    stance = Anchor.nominal().T_world_stance
    in_stance = np.linalg.inv(stance) @ Anchor.nominal().T_world_base @ poses["lhand"][at]
    np.testing.assert_allclose(rows.executed[:, :3], in_stance[:, :3, 3], atol=SOLES)
    np.testing.assert_allclose(rows.requested[:, :3] - rows.executed[:, :3], np.tile(AHEAD, (len(at), 1)), atol=1e-9)
    np.testing.assert_allclose(rows.requested[:, 18:], rows.executed[:, 18:], atol=1e-12)


def test_a_row_decodes_to_where_the_hand_was():
    record, poses = run(400)
    rows = record_executed(record)
    chunk = decode(builtin("wbc32"), rows.executed[:1], Anchor.nominal())
    was = Anchor.nominal().T_world_base @ poses["lhand"][100]
    np.testing.assert_allclose(chunk.T_world_lhand[0], was, atol=SOLES)
    exact = record_executed(record, "wbc32-v1")
    chunk = decode(builtin("wbc32-v1"), exact.executed[:1], Anchor.nominal())
    np.testing.assert_allclose(chunk.T_world_lhand[0], was, atol=1e-9)


def test_a_run_without_steps_or_of_another_robot_is_refused():
    record, _ = run(50)
    with pytest.raises(InputError, match="no step that was asked for"):
        record_executed(record)
    names = np.array([f"x{i}" for i in range(43)])
    with pytest.raises(InputError, match="is not of the robot g1_dex3"):
        record_executed(made_record(10, joint_names=names))
