"""A run as arrays: what was true, commanded and asked for, at every control period."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from wholebody.sim.plant import MujocoPlant
from wholebody.types import JointCommand, RobotState, StatusReport


@dataclass
class Recorder:
    """Collects rows; `save` writes them as one ``.npz`` that needs no pickle.

    Columns, n control periods, motors in motor order, SI units:

    - ``time`` (n,); ``q`` (n, nq) and ``v`` (n, nv), true state in Pinocchio's convention
    - ``q_command``, ``dq_command``, ``tau_command`` (n, n_joints)
    - ``torque`` (n, n_joints): what the motors gave at the end of the period before
    - ``T_world_palms`` (n, 2, 4, 4): commanded palm poses, left first
    - ``foot_force`` (n,) and ``pressure`` (n, 2): load of the floor on the feet and its centre
    - ``status``, ``reason``, ``contacts`` (n,): text; contacts as ``first-second`` joined by blanks
    - ``objects`` (n, k, 7): position and quaternion wxyz of the scene's free bodies

    Attributes:
        joint_names: Joints of ``q`` and ``v`` after the base, Pinocchio order.
        motor_names: Joints of the command, motor order.
        scene: Scene of the run.
    """

    joint_names: tuple[str, ...]
    motor_names: tuple[str, ...]
    scene: str = "floor"
    _rows: dict[str, list] = field(default_factory=dict)

    def clear(self) -> None:
        """Forget everything: the next run begins."""
        self._rows.clear()

    def add(
        self,
        state: RobotState,
        command: JointCommand,
        palms: dict[str, np.ndarray],
        status: StatusReport,
        plant: MujocoPlant,
    ) -> None:
        """One control period.

        Args:
            state: True state at its beginning.
            command: Answer of the controller.
            palms: Commanded palm poses (4, 4) by side.
            status: Of the supervisor.
            plant: Before it is stepped.
        """
        force, pressure = plant.foot_load()
        row = {
            "time": state.time,
            "q": state.q,
            "v": state.v,
            "q_command": command.q,
            "dq_command": command.dq,
            "tau_command": command.tau,
            "torque": plant.torque.copy(),
            "T_world_palms": np.stack([palms["left"], palms["right"]]),
            "foot_force": force,
            "pressure": pressure,
            "status": status.status.value,
            "reason": str(status.reason or ""),
            "contacts": " ".join("-".join(pair) for pair in plant.contacts()),
            "objects": plant.objects(),
        }
        for name, value in row.items():
            self._rows.setdefault(name, []).append(value)

    def arrays(self) -> dict[str, np.ndarray]:
        """The columns by name."""
        return {name: np.array(rows) for name, rows in self._rows.items()}

    def save(self, path: str | Path) -> None:
        """Write the columns, the joint names and the scene."""
        names = {"joint_names": np.array(self.joint_names), "motor_names": np.array(self.motor_names)}
        with Path(path).open("wb") as file:
            np.savez_compressed(file, scene=np.array(self.scene), **names, **self.arrays())
