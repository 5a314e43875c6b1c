"""A motion looked at before it is played: what its root and joints may be instead of what they are called."""

from __future__ import annotations

import numpy as np

from policy.dataset.inspection import refused_values
from policy.dataset.joint_layout import JointLayout
from policy.findings import Finding
from policy.recorded.motion_csv import Motion
from policy.suspicion.joint_table import joint_findings
from policy.suspicion.poses import root_findings
from policy.suspicion.rows import row_findings


def motion_findings(motion: Motion, quaternion: np.ndarray) -> list[Finding]:
    """Hypotheses about a motion, with its root's quaternions (n, 4) as the file has them."""
    names, robot = motion.robot.body_joints, motion.robot
    found = root_findings(motion.T_world_base, quaternion)
    found += joint_findings(names, motion.q_body, robot)
    found += row_findings(motion.q_body)
    if not any(one.level == "error" for one in found):
        found += refused_values(JointLayout(names, names, robot=robot), motion.q_body)
    return sorted(found, key=lambda one: one.level != "error")
