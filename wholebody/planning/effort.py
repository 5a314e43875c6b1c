"""Whether motors give the torques of waist and arms on the whole curve of a plan: the optimiser looks at its knots.

At its knots it can relieve a joint by accelerating it to and fro; between the knots the joint carries the full torque.
"""

from __future__ import annotations

import numpy as np

from wholebody.jit.entry import Entry
from wholebody.planning.kernels.effort import effort
from wholebody.planning.trajectory import COARSE, GRID, CentroidalTrack
from wholebody.trajopt.layout import N_JOINTS, UPPER
from wholebody.trajopt.robot_tables import RobotTables

_effort = Entry(effort)


class Effort:
    """Torques of waist and arms along plans.

    Args:
        body: The robot that is planned, with what it carries and the reserve for that.
    """

    def __init__(self, body: RobotTables) -> None:
        self._body, n = body, 1 + N_JOINTS
        self._scratch = (
            np.zeros((n, 3, 3)), np.zeros((n, 3)), *(np.zeros((n, 6)) for _ in range(4)), np.zeros((3, 10)),
        )  # fmt: skip

    def torques(self, q: np.ndarray, v: np.ndarray, a: np.ndarray, pushes: np.ndarray | None = None) -> np.ndarray:
        """Torques of waist and arms in motion, shape (n, UPPER), [N m].

        Args:
            q: Configurations, shape (n, nq).
            v: Velocities, shape (n, nv).
            a: Their derivatives, shape (n, nv).
            pushes: Forces on both palms, world axes, shape (n, 2, 3), [N]; none if not given.
        """
        body, torque = self._body, np.zeros((len(q), UPPER))
        pushes = np.zeros((0, 2, 3)) if pushes is None else np.ascontiguousarray(pushes)
        _effort(body.tables, body.body_of(q), body.rates_of(v), body.rates_of(a), pushes, torque, *self._scratch)
        return torque

    def strain(self, track: CentroidalTrack, slowdown: float, begun: float) -> float:
        """Largest torque along a plan as a share of its motor's limit; inf if not finite.

        Args:
            track: Where the plan goes.
            slowdown: How much slower than its parameter it is followed.
            begun: Parameter since its start from which it counts: before, torques are those of the start [s].
        """
        first = round(begun / (COARSE * GRID))
        if len(track.v) <= first + 1:
            return 0.0
        a = np.gradient(track.v, COARSE * GRID, axis=0)[first:]
        rows = np.minimum(COARSE * np.arange(first, len(track.q)), track.com.shape[1] - 1)
        pushes = None if track.pushes is None else track.pushes[rows]
        torques = self.torques(track.q[first:], track.v[first:] / slowdown, a / slowdown**2, pushes)
        return float(np.nan_to_num((np.abs(torques) / self._body.effort_max).max(), nan=np.inf))
