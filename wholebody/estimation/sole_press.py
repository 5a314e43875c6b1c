"""How hard the floor presses on each sole, from the motion of the robot and the torques of its legs.

What a leg's torques do not account for is the floor's: ``J' f = tau_needed - tau``, six rows for six numbers, where the
torques that are needed are those of the motion as measured. That of a foot in the air is 0 within a newton where the
state is true, however fast it swings: the leg's own acceleration is in it, which the estimator's forces leave out.
"""

from __future__ import annotations

from math import exp, inf

import numpy as np
import pinocchio as pin

from models.pinocchio_model import frame_id
from models.spec import RobotSpec
from wholebody.types import RobotState

TIME_CONSTANT = 0.01
"""Of the filter of the torques [s]; chosen: five readings, as the estimator's forces have."""
GAP_MAX = 0.02
"""Longest time between two states from which an acceleration is taken [s]; chosen: ten periods."""
DAMPING = 1e-6 * np.eye(6)
"""Of the least squares for a force [m^2, no unit]; chosen: 1 mm beside a bent leg's levers, squared."""


class SolePress:
    """Vertical forces of the floor on both soles.

    Args:
        spec: The robot.
        model: Of it, in Pinocchio.
    """

    def __init__(self, spec: RobotSpec, model: pin.Model) -> None:
        self._model, self._data, self._legs = model, model.createData(), []
        for foot in spec.feet:
            leg = [model.getJointId(spec.joint_names[i]) for i in spec.limbs[f"{foot.side}_leg"]]
            self._legs.append((frame_id(model, foot.frame), [model.idx_vs[joint] for joint in leg]))
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._time, self._v, self._residual, self._forces = -inf, None, np.zeros(self._model.nv), None

    def look(self, state: RobotState) -> tuple[float, float] | None:
        """Take in a state; the forces [N], left first, or None where torques or the state before are not known."""
        if state.tau is None:
            self.reset()
            return None
        if state.time == self._time:
            return self._forces
        dt, before = state.time - self._time, self._v
        self._time, self._v = state.time, state.v.copy()
        if not 0.0 < dt <= GAP_MAX:
            self._residual[:], self._forces = 0.0, None
            return None
        model, data = self._model, self._data
        residual = pin.rnea(model, data, state.q, state.v, (self._v - before) / dt)
        residual[6:] -= state.tau
        keep = exp(-dt / TIME_CONSTANT)
        self._residual = keep * self._residual + (1.0 - keep) * residual
        pin.computeJointJacobians(model, data, state.q)
        self._forces = tuple(self._force(frame, leg) for frame, leg in self._legs)
        return self._forces

    def _force(self, frame: int, leg: list[int]) -> float:
        """Vertical force on a foot [N]."""
        pin.updateFramePlacement(self._model, self._data, frame)
        J = pin.getFrameJacobian(self._model, self._data, frame, pin.LOCAL_WORLD_ALIGNED)[:, leg]
        return float(np.linalg.solve(J @ J.T + DAMPING, J @ self._residual[leg])[2])
