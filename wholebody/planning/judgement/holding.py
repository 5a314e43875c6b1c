"""How a robot holds what its hands carry before a chunk: steps that stay, and the torque that its motors spend."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from policy.chunk import ActionChunk
from wholebody.planning.effort import Effort
from wholebody.planning.judgement.limits import Limit, Margin
from wholebody.trajopt.layout import UPPER
from wholebody.trajopt.robot_tables import BETWEEN_SHARE, RobotTables

HOLD_SPEC_ID, HOLD_STEPS = "held", 31
"""Spec id of chunks that the supervisor makes to hold its position, and their steps within a second; chosen: as
usual chunks have them."""


def staying(T: Sequence[np.ndarray], fingers: Sequence[np.ndarray], now: float) -> ActionChunk:
    """Steps of a second from now on [s] at which both wrists stay at poses (4, 4), and fingers as they are [rad]."""
    poses, hands = (np.repeat(np.array(x)[:, None], HOLD_STEPS, axis=1) for x in (T, fingers))
    return ActionChunk(HOLD_SPEC_ID, -1, now, HOLD_STEPS - 1.0, *poses, *hands)


def torque_at_rest(body: RobotTables, effort: Effort, q: np.ndarray) -> Margin:
    """Room of the motor of waist and arms that spends most on standing still in a configuration (nq,).

    A share of -1 is all that the motor has.
    """
    still = np.zeros((1, len(q) - 1))
    torques = np.abs(effort.torques(q[None], still, still)[0])
    joint = int((torques / body.effort_max).argmax())
    value, most = float(torques[joint]), float(body.effort_max[joint])
    room = BETWEEN_SHARE * most - value
    return Margin(
        code=Limit.JOINT_TORQUE, subject=body.model.names[len(body.model.names) - UPPER + joint], time=0.0, step=0,
        value=value, bound=BETWEEN_SHARE * most, unit=Limit.JOINT_TORQUE.unit, margin=room,
        share=room / ((1.0 - BETWEEN_SHARE) * most),
    )  # fmt: skip
