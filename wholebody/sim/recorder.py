"""A run as arrays: what was true, commanded and asked for, at every control period."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from wholebody.types import JointCommand, RobotState


@dataclass
class Recorder:
    """Collects rows; `save` writes them as one ``.npz`` that needs no pickle.

    Attributes:
        joint_names: Joints of ``q`` and ``v`` after the base, Pinocchio order.
        motor_names: Joints of the command, motor order.
        scene: Scene of the run.
    """

    joint_names: tuple[str, ...]
    motor_names: tuple[str, ...]
    scene: str = "floor"
    _rows: dict[str, list] = field(default_factory=dict)

    def add(
        self, state: RobotState, command: JointCommand, palms: dict[str, np.ndarray], status: str, reason: str
    ) -> None:
        """One control period: true state, command, commanded palm poses (4, 4) by side, status and its reason."""
        row = {
            "time": state.time,
            "q": state.q,
            "v": state.v,
            "q_command": command.q,
            "dq_command": command.dq,
            "tau_command": command.tau,
            "T_world_palms": np.stack([palms["left"], palms["right"]]),
            "status": status,
            "reason": reason,
        }
        for name, value in row.items():
            self._rows.setdefault(name, []).append(value)

    def arrays(self) -> dict[str, np.ndarray]:
        """Columns by name: ``time`` (n,), ``q`` (n, nq), ``T_world_palms`` (n, 2, 4, 4), ... in SI units."""
        return {name: np.array(rows) for name, rows in self._rows.items()}

    def save(self, path: str | Path) -> None:
        """Write the columns, the joint names and the scene."""
        names = {"joint_names": np.array(self.joint_names), "motor_names": np.array(self.motor_names)}
        np.savez_compressed(path, scene=np.array(self.scene), **names, **self.arrays())
