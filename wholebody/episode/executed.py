"""What the robot did, in the numbers of an action layout, beside what it was asked: rows for a dataset.

LeRobot records the action that was asked for, also where a robot's ``send_action`` returns another one. A policy that
is trained on it learns to ask for what did not happen. Both are here, row by row and in the same slots.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import as_spec
from policy.action_spec.codec import encode_valid
from policy.action_spec.spec import ActionSpec
from policy.action_spec.state import aligned_state, state_numbers
from policy.chunk import ActionChunk
from policy.geometry.rotations import nearest_rotation, quaternion_to_matrix
from policy.geometry.se3 import make_transform, translated
from policy.observation import Observation
from wholebody.errors import InputError
from wholebody.sim.record import Record


@dataclass(frozen=True)
class ExecutedActions:
    """Actions of a run.

    Attributes:
        layout: What the numbers are: absolute in every slot, in the pelvis of their own row.
        times: Of each row, shape (n,), [s].
        requested: What was asked for: palms of the chunk that was followed, fingers as commanded, shape (n, A).
        executed: What was measured at the same times, shape (n, A).
    """

    layout: ActionSpec
    times: np.ndarray
    requested: np.ndarray
    executed: np.ndarray


def record_executed(
    record: Record, layout: str | ActionSpec = "wbc32", *, robot: RobotSpec | None = None
) -> ExecutedActions:
    """Requested and executed actions of a recorded run, at the layout's rate.

    Args:
        record: As `wholebody.sim.record.read_record` gives it, or a recorder's.
        layout: What the numbers are to be: wrists, by its built-in name or as a spec.
        robot: The robot that was recorded; the G1 with Dex3 hands if None.

    Raises:
        InputError: If nothing was ever asked for, or the run is of another robot.
        SpecError: If there is no such layout.
    """
    robot = robot or g1()
    spec = aligned_state(as_spec(layout, robot))
    missing = [name for name in robot.joint_names if name not in record["joint_names"]]
    if missing:
        raise InputError(f"the recording has no joint '{missing[0]}': it is not of the robot {robot.name}")
    asked = np.flatnonzero(np.isfinite(record["T_world_palms_asked"]).all(axis=(1, 2, 3)))
    if not len(asked):
        raise InputError("the recording has no step that was asked for")
    times = record["time"]
    wanted = np.arange(times[asked[0]], times[asked[-1]] + 1e-9, 1.0 / spec.fps)
    rows = np.minimum(np.searchsorted(times, wanted - 1e-9), asked[-1])
    pairs = [_row(record, int(row), spec, robot) for row in rows]
    return ExecutedActions(spec, times[rows], *(np.array(values) for values in zip(*pairs, strict=True)))


def _row(record: Record, row: int, spec: ActionSpec, robot: RobotSpec) -> tuple[np.ndarray, np.ndarray]:
    """Requested and executed numbers (A,) of a control period."""
    names, q, command = list(record["joint_names"]), record["q"][row], record["q_command"][row]
    joints = q[7:][[names.index(name) for name in robot.joint_names]]
    T = make_transform(quaternion_to_matrix(q[3:7], "xyzw"), q[:3])
    fingers = [joints[robot.indices(tool.finger_joints)] for tool in robot.tools]
    seen = Observation(float(record["time"][row]), joints[: len(robot.body_joints)], fingers[0], fingers[1], T)
    anchor = Anchor.measured(seen, robot)
    motors = list(record["motor_names"])
    hands = []
    for tool, palm in zip(robot.tools, record["T_world_palms_asked"][row], strict=True):
        R = make_transform(nearest_rotation(palm[:3, :3]), palm[:3, 3])
        closed = command[[motors.index(name) for name in tool.finger_joints]][None].astype(float)
        hands.append((translated(R, -np.asarray(tool.palm_offset))[None], closed))
    (T_l, q_l), (T_r, q_r) = hands
    chunk = ActionChunk(spec.id, 0, seen.time, spec.fps, T_l, T_r, q_l, q_r)
    return encode_valid(spec, chunk, anchor)[0], state_numbers(spec, seen, anchor)
