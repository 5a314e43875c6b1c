"""Where a robot that stands still holds what it carries: the places nearest to those wanted.

A load in the hands spends the torque of the waist long before an arm is stretched. Which posture holds it nearest to a
place is another one for each load, and mostly one with the trunk over the feet and bent knees, far from the stance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from wholebody.config import TrajectoryConfig
from wholebody.planning.still_postures import Round, StillPostures
from wholebody.trajopt.budget import Budget
from wholebody.trajopt.layout import LOWER, WAIST
from wholebody.trajopt.robot_tables import RobotTables

LOADED_PALM_SCALES = {"position": 0.01, "position_give": 0.3, "orientation": 0.3, "orientation_give": 0.5}
"""Scales of the palms and the errors past which they pull no harder [m, rad]; chosen: hands that hold a load may turn,
and one that is far off is not given up for the other."""
SOFT_SCALES, FIRM_SCALES = (3.0,), (1.0, 0.5, 0.25, 0.1)
"""Factors on the scales of the bounds, on the way to a place and at its end [no unit]; measured: firm bounds on the way
keep the trunk bent where a squat would hold more."""
POSTURE_TIME = 1.0
"""Time in which the search goes over from the start to postures that hold a load [s]; chosen: a squat takes as long."""
STAGES, STEPS, STEPS_NEXT = 8, 12, 5
"""Places between where a search begins and its target, most steps at each, and from one knot's place to the next."""
SQUAT = 0.3
"""Height of the palms from which the second search begins [m]; chosen: there only a squat holds them."""
NEARER_MIN = 0.005
"""Distance by which that one has to be nearer to be taken [m]; chosen: below it, no posture is worth another way."""
EXCESS_MAX = 0.5
"""Excess over a bound, in terms of its tolerance, of a posture that is taken; chosen: half of what a plan may."""


@dataclass(frozen=True)
class HoldablePath:
    """Where palms are held, K knots.

    Attributes:
        T_palms: Palm poses, turned as wanted, shape (K, 2, 4, 4).
        q: Configurations of the body there, shape (K, 36).
        off: Distance of the furthest palm from where it is wanted [m].
    """

    T_palms: np.ndarray
    q: np.ndarray
    off: float

    def blended(self, body: RobotTables, q: np.ndarray, dt: float) -> np.ndarray:
        """Configurations from one (nq,) of the robot over to these, from the second knot on, ``dt`` [s] apart."""
        time = dt * np.arange(1, len(self.q))
        rows = np.tile(q, (len(time), 1))
        for row, still, share in zip(rows, self.q[1:], np.minimum(time / POSTURE_TIME, 1.0), strict=True):
            body.put(row, pin.interpolate(body.model, body.body_of(q), still, share))
        return rows


class HoldablePlaces:
    """Finds them for a robot with what it carries, on its feet.

    Args:
        body: The robot, whose loads may change.
        config: Weights, limits and margins of plans.
    """

    def __init__(self, body: RobotTables, config: TrajectoryConfig) -> None:
        self._still, self._weights = StillPostures(body, config, 2), replace(config, **LOADED_PALM_SCALES)

    def near(self, T_palms: np.ndarray, q_fingers: np.ndarray, start: np.ndarray, budget: Budget) -> HoldablePath:
        """The places nearest to the palms wanted at each of K knots, and postures there.

        The last knot's is searched for from the start and from a squat, the others' from the next one's back.

        Args:
            T_palms: Palm poses wanted, shape (K, 2, 4, 4).
            q_fingers: Finger joints, shape (K, n_fingers), hand by hand.
            start: Configuration of the body, shape (36,).
            budget: In which the work is counted.
        """
        held, q = T_palms.copy(), np.tile(start, (len(T_palms), 1))
        goal, fingers = T_palms[-1], q_fingers[-1]
        low = goal.copy()
        low[:, 2, 3] = np.minimum(low[:, 2, 3], SQUAT)
        found = [self._nearest(goal, fingers, start, budget)]
        found.append(self._nearest(goal, fingers, self._nearest(low, fingers, start, budget)[2], budget))
        _, held[-1, :, :3, 3], q[-1] = min(found, key=lambda one: one[0] + NEARER_MIN * (one is found[1]))
        for k in reversed(range(len(q) - 1)):
            self._search(T_palms[k], q_fingers[k], q[k + 1], FIRM_SCALES[-1:], STEPS_NEXT, budget)
            held[k, :, :3, 3], q[k] = self._still.T_palms[1, :, :3, 3], self._still.q[1]
        return HoldablePath(held, q, float(np.linalg.norm(held[:, :, :3, 3] - T_palms[:, :, :3, 3], axis=2).max()))

    def _nearest(
        self, goal: np.ndarray, q_fingers: np.ndarray, start: np.ndarray, budget: Budget
    ) -> tuple[float, np.ndarray, np.ndarray]:
        """How far the further palm stays from its goal [m], inf where bounds are exceeded; palms (2, 3), posture."""
        still = self._still
        self._search(goal, q_fingers, start, (), 0, budget)
        begin, T, q = still.T_palms[1, :, :3, 3].copy(), goal.copy(), start
        for stage in range(1, STAGES + 1):
            T[:, :3, 3] = begin + stage / STAGES * (goal[:, :3, 3] - begin)
            self._search(T, q_fingers, q, SOFT_SCALES, STEPS, budget)
            q = still.q[1].copy()
        self._search(goal, q_fingers, q, FIRM_SCALES, STEPS, budget)
        palms = still.T_palms[1, :, :3, 3].copy()
        off = float(np.linalg.norm(palms - goal[:, :3, 3], axis=1).max())
        return off if still.excess()[1] <= EXCESS_MAX else np.inf, palms, still.q[1].copy()

    def _search(
        self,
        T_palms: np.ndarray,
        q_fingers: np.ndarray,
        start: np.ndarray,
        softness: tuple[float, ...],
        steps: int,
        budget: Budget,
    ) -> None:
        """Leave the postures where rounds of such softness lead."""
        rounds = tuple(Round(self._weights, x, steps, oriented=False) for x in softness)
        self._still.search(T_palms, start, q_fingers, rounds)
        budget.count(self._still.K * max(len(rounds) * steps, 1))


def arms_spent(body: RobotTables, q: np.ndarray) -> float:
    """Largest torque of the loaded arms at rest, as a share of its bound, at configurations of the body (k, 36).

    A motion that shakes a heavy hand keeps the bound at each of its knots, and no robot holds that.
    """
    torques = np.array([pin.computeGeneralizedGravity(body.model, body.data, one)[LOWER + WAIST :] for one in q])
    return float((np.abs(torques) / body.tables.tau_max[WAIST:]).max())
