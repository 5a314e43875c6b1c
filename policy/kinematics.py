"""Wrists and torso of the G1 from joint angles, relative to the pelvis. Pinocchio loads at the first use."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from models.g1 import g1
from policy.errors import PolicyError
from policy.joints import BODY_JOINTS


class Kinematics:
    """Forward kinematics of the G1 with its pelvis at the origin.

    Use `kinematics()`, which shares one instance: making one parses the URDF (about 0.1 s).
    """

    def __init__(self) -> None:
        import pinocchio as pin  # noqa: PLC0415 - the policy package imports numpy only

        from models.pinocchio_model import frame_id, load_pinocchio  # noqa: PLC0415

        spec = g1()
        self._pin = pin
        self.model = load_pinocchio(spec)
        self.data = self.model.createData()
        self.frames = {
            "lhand": frame_id(self.model, spec.tool("left").wrist_frame),
            "rhand": frame_id(self.model, spec.tool("right").wrist_frame),
            "torso": frame_id(self.model, spec.torso_body),
        }
        self._neutral = pin.neutral(self.model)
        self.idx_q = np.array([self.model.joints[self.model.getJointId(name)].idx_q for name in BODY_JOINTS])
        """Entry of each body joint (motor order) in Pinocchio's configuration."""
        self.idx_v = np.array([self.model.joints[self.model.getJointId(name)].idx_v for name in BODY_JOINTS])
        """Entry of each body joint (motor order) in Pinocchio's velocity."""

    def poses(self, q_body: np.ndarray) -> dict[str, np.ndarray]:
        """``T_base_lhand``, ``T_base_rhand`` and ``T_base_torso`` under the keys lhand, rhand, torso.

        Args:
            q_body: Body joints in motor order, shape (29,) or (n, 29), [rad].

        Returns:
            Arrays of shape (4, 4) or (n, 4, 4).

        Raises:
            PolicyError: If the last axis is not 29.
        """
        q_body = np.asarray(q_body, dtype=float)
        if q_body.shape[-1:] != (29,):
            raise PolicyError(f"q_body has shape {q_body.shape}; its last axis must be the 29 body joints")
        rows = q_body.reshape(-1, 29)
        found = {name: np.empty((len(rows), 4, 4)) for name in self.frames}
        for i, row in enumerate(rows):
            self._forward(row)
            for name, frame in self.frames.items():
                found[name][i] = self._pin.updateFramePlacement(self.model, self.data, frame).homogeneous
        return {name: T.reshape(*q_body.shape[:-1], 4, 4) for name, T in found.items()}

    def _forward(self, q_body: np.ndarray) -> None:
        q = self._neutral.copy()
        q[self.idx_q] = q_body
        self._pin.forwardKinematics(self.model, self.data, q)


@lru_cache(maxsize=1)
def kinematics() -> Kinematics:
    """The shared instance."""
    return Kinematics()
