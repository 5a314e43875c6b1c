"""Collects a run as arrays: what was true, asked for, commanded and measured at every control period."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio, palm_frame_ids
from models.spec import RobotSpec
from policy.errors import printable
from policy.writing import whole
from wholebody.config import ControllerConfig
from wholebody.robot.kernels.pendulum import natural_frequency
from wholebody.robot.plant import Plant
from wholebody.robot.support_polygon import SupportPolygon, convex_polygon
from wholebody.sim.limit_monitor import carrying
from wholebody.sim.record import PERIODS, TEXT_MAX, VERSION, Record
from wholebody.types import JointCommand, RobotState, StatusReport

STEPPED = 0.01
"""Distance of a sole from where it was first from which the soles that touch are looked for [m]; chosen: no sole that
stands slides or is bent as far."""

SOLE_DIGITS = 5
"""Digits of metres that are recorded of soles: what trembles below would take more room than all that moves."""


@dataclass(frozen=True)
class Followed:
    """What a supervisor followed in a control period.

    Attributes:
        asked: Palm poses that the chunk asks for now, left first, shape (2, 4, 4); None before the first chunk.
        commanded: Palm poses that the controller is given, likewise.
        status: What the supervisor says.
        rate: Speed along the plan, 1 at the chunk's own.
        planning_time: CPU time that the last plan took [s].
    """

    asked: np.ndarray | None
    commanded: np.ndarray
    status: StatusReport
    rate: float = 1.0
    planning_time: float = 0.0


class Recorder:
    """Collects a row a control period; `save` writes them as one ``.npz`` that needs no pickle.

    `wholebody.sim.record.COLUMNS` says what it holds.

    Args:
        spec: The robot.
        scene: Scene of the run.
        config: Settings of the run, for the bounds in them; the defaults if not given.
    """

    def __init__(self, spec: RobotSpec, scene: str = "floor", config: ControllerConfig | None = None) -> None:
        self._model = load_pinocchio(spec)
        self._data, self._palms = self._model.createData(), palm_frame_ids(spec, self._model)
        self._rows: dict[str, list] = {}
        self._texts: dict[str, dict[str, int]] = {}
        self._support: SupportPolygon | None = None
        config = config or ControllerConfig()
        verdict = config.verdict
        self._constants = {
            "version": np.array(VERSION),
            "scene": np.array(scene),
            "joint_names": np.array(list(self._model.names[2:])),
            "motor_names": np.array(spec.joint_names),
            "effort_max": np.array(spec.effort_max, dtype=float),
            "palm_bounds": np.array([verdict.palm_feasible, verdict.palm_repair]),
            "turn_bounds": np.array([verdict.turn_feasible, verdict.turn_repair]),
            "balance_margin": np.array(float(config.safety.balance_margin)),
            "lead": np.array(float(config.planning.lead)),
        }
        self.begin()

    def begin(self, orientation_free: tuple[bool, bool] = (False, False)) -> None:
        """Forget everything: the next run begins.

        Args:
            orientation_free: Whether the orientation of the left and of the right palm is free in it.
        """
        self._constants["orientation_free"] = np.array(orientation_free, dtype=int)
        self._rows, self._support = {name: [] for name in PERIODS}, None
        self._texts = {"details": {"": 0}, "contact_sets": {"": 0}}

    def add(self, state: RobotState, command: JointCommand, followed: Followed, plant: Plant) -> None:
        """One control period.

        Args:
            state: True state at its beginning.
            command: Answer of the controller.
            followed: What it is the answer to.
            plant: Before it is stepped.
        """
        for name, value in self._row(state, command, followed, plant).items():
            self._rows[name].append(value)

    def _row(
        self, state: RobotState, command: JointCommand, followed: Followed, plant: Plant
    ) -> dict[str, np.ndarray | float | str]:
        """Values by column."""
        status = followed.status
        return {
            "time": state.time,
            "q": state.q,
            "v": state.v,
            "q_command": command.q,
            "dq_command": command.dq,
            "tau_command": command.tau,
            "torque": plant.torque.copy(),
            "torque_asked": plant.torque_asked.copy(),
            "T_world_palms_asked": np.full((2, 4, 4), np.nan) if followed.asked is None else followed.asked,
            "T_world_palms_commanded": followed.commanded,
            "rate": followed.rate,
            "planning_time": followed.planning_time,
            "status": status.status.value,
            "reason": str(status.reason or ""),
            "detail": self._number("details", printable(status.detail, TEXT_MAX)),
            "contacts": self._number("contact_sets", " ".join("-".join(pair) for pair in plant.contacts())),
            "objects": plant.objects(),
            **self._palms_of(state),
            **self._balance(state, plant),
        }

    def _palms_of(self, state: RobotState) -> dict[str, np.ndarray]:
        pin.framesForwardKinematics(self._model, self._data, state.q)
        return {"T_world_palms_measured": np.stack([self._data.oMf[palm].homogeneous for palm in self._palms])}

    def _balance(self, state: RobotState, plant: Plant) -> dict[str, np.ndarray | float]:
        """Soles, centre of mass, capture point, pressure, and their distances from the edge of the support."""
        corners = plant.contact_points()[:, :2].copy()
        if self._support is None:
            self._support, self._soles = convex_polygon(corners), plant.soles().copy()
        moved = np.linalg.norm(plant.soles() - self._soles, axis=1).max() > STEPPED
        carries = carrying(plant) if moved else np.ones(len(corners), dtype=bool)
        support = convex_polygon(corners[carries]) if moved else self._support
        pin.centerOfMass(self._model, self._data, state.q, state.v)
        com = self._data.com[0].copy()
        capture = com[:2] + self._data.vcom[0][:2] / natural_frequency(com[2])
        force, pressure = plant.foot_load()
        if force <= 0.0:
            pressure = np.full(2, np.nan)
        return {
            "com": com,
            "capture_point": capture,
            "foot_force": force,
            "pressure": pressure,
            "soles": np.round(corners, SOLE_DIGITS),
            "carries": carries.astype(int),
            "pressure_margin": support.margin(pressure),
            "capture_margin": support.margin(capture),
        }

    def _number(self, table: str, text: str) -> int:
        """Number of a text in its table, where each is written once."""
        known = self._texts[table]
        return known.setdefault(text, len(known))

    def arrays(self) -> dict[str, np.ndarray]:
        """The columns by name, those that are the same all along included; empty before the first row."""
        if self._support is None:
            return {}
        texts = {table: np.array(list(known)) for table, known in self._texts.items()}
        rows = {name: np.array(values) for name, values in self._rows.items()}
        return {**rows, **self._constants, **texts}

    def record(self) -> Record:
        """Columns collected so far."""
        return Record(self.arrays())

    def save(self, path: str | Path) -> None:
        """Write the columns."""
        with whole(path) as place, place.open("wb") as file:
            np.savez_compressed(file, **self.arrays())
