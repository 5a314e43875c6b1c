"""A flat foot on the floor: rigid contact with point forces in linearised friction cones."""

from __future__ import annotations

from math import atan, tan

import numpy as np
import pinocchio as pin

from wholebody.contacts.friction import PYRAMID_SIDES, pyramid_slope
from wholebody.robot.state import Robot


class FootContact:
    """One foot with its contact points.

    The foot must not accelerate (six equalities), and each point pushes inside its friction pyramid, so the centre of
    pressure stays inside the sole and the whole four-point cone is exact.

    Args:
        frame: Foot body frame.
        points: Contact points in that frame, shape (k, 3), [m].
        friction: Friction coefficient of the floor as the controller assumes it. The pyramid is inscribed in the cone.
        force_max: Largest normal force of one point [N].
        force_min: Least normal force of one point [N].
        kp, kd: How a foot that moved is pulled back: stiffness [1/s^2] and damping [1/s].

    Attributes:
        T_world_ref: Where it stands; None before it was set down.
        load: Share of the force bounds that it has, 0 to 1 [no unit]; with 0 it is up, see `Contacts`.
    """

    def __init__(
        self,
        frame: str,
        points: np.ndarray,
        *,
        friction: float,
        force_max: float,
        force_min: float = 0.0,
        kp: float = 0.0,
        kd: float = 20.0,
    ) -> None:
        self.frame, self.points = frame, np.asarray(points, dtype=float)
        self.n_forces = 3 * len(self.points)
        self._friction, self.force_min, self.force_max = friction, force_min, force_max
        self.kp, self.kd = kp, kd
        self.T_world_ref: pin.SE3 | None = None
        self.load = 1.0
        self.slope(0.0)

    @property
    def load_bounds(self) -> tuple[float, float]:
        """Least and largest normal force of one point now [N]."""
        return self.load * self.force_min, self.load * self.force_max

    def slope(self, angle: float) -> None:
        """The floor slopes by so much [rad]: the pyramid about the vertical is inside the cone about its normal."""
        self.friction = self._friction if angle == 0.0 else tan(max(atan(self._friction) - angle, 0.0))
        block = np.hstack([PYRAMID_SIDES, np.full((len(PYRAMID_SIDES), 1), -pyramid_slope(self.friction))])
        self.cone_rows = np.kron(np.eye(len(self.points)), block)
        """``cone_rows @ f <= 0``, shape (4 k, 3 k); forces in world axes."""

    def acceleration(self, robot: Robot) -> tuple[np.ndarray, np.ndarray]:
        """``J dv = target``: J (6, nv) and target (6,)."""
        target = -robot.drift(self.frame) - self.kd * robot.velocity(self.frame)
        if self.kp and self.T_world_ref is not None:
            T = robot.pose(self.frame)
            error = np.concatenate(
                [self.T_world_ref.translation - T.translation, pin.log3(self.T_world_ref.rotation @ T.rotation.T)]
            )
            target += self.kp * error
        return robot.jacobian(self.frame), target

    def force_jacobian(self, robot: Robot, J: np.ndarray) -> np.ndarray:
        """``J_points``, shape (3 k, nv): generalised force of the point forces is ``J_points' f``.

        Args:
            robot: Updated robot.
            J: The foot's Jacobian ``_lwa``, shape (6, nv).
        """
        offsets = self.points @ robot.pose(self.frame).rotation.T
        rows = [J[:3] - pin.skew(offset) @ J[3:] for offset in offsets]
        return np.vstack(rows)
