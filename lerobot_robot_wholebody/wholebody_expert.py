"""A scripted expert who does the robot's task, never twice in the same way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from lerobot_robot_wholebody.config_teleoperators import WholebodyExpertConfig
from lerobot_robot_wholebody.hands_teleoperator import Hands, HandsTeleoperator

if TYPE_CHECKING:
    import numpy as np

    from lerobot_robot_wholebody.wholebody_g1 import WholebodyG1
    from policy.scripted.policy import ScriptedPolicy

BEGIN, TAKES = (0.0, 0.4), (1.4, 2.2)
"""Delay after which a hand sets off in a phase, and time that it takes [s]; chosen: as people do in front of a
table."""
MISSES, CORRECTS = 0.04, 0.35
"""Share of the way by which the first movement misses, standard deviation, and the share of its time at which it is
corrected [no unit]; chosen after the two movements of Woodworth's model."""
BULGE = 0.03
"""Bulge of a way out to the side, standard deviation [m]; chosen."""
PACE, APPROACH = (0.9, 1.15), 2.5
"""Times the speed of a script at which it is done [no unit], and until when it goes to the thing, without touching it
yet [s]; chosen: faster, hands that close have not closed yet; and as all scripts have it."""
LETS_GO = 0.8
"""How long fingers take to open on the way back [s]; chosen: they are open before the hand is far."""


@dataclass(frozen=True)
class _Way:
    """From a point to another one, with a miss that is corrected and a bulge.

    Attributes:
        begin, takes: When it sets off and how long it takes [s].
        start, end, miss, bulge: Points and displacements, shape (3,), [m].
    """

    begin: float
    takes: float
    start: np.ndarray
    end: np.ndarray
    miss: np.ndarray
    bulge: np.ndarray

    @classmethod
    def drawn(cls, rng: np.random.Generator, start: np.ndarray, end: np.ndarray) -> _Way:
        """One of the ways."""
        far = float(((end - start) ** 2).sum() ** 0.5)
        miss = rng.normal(0.0, MISSES * far, 3)
        share = min(far / 0.2, 1.0)
        return cls(rng.uniform(*BEGIN), rng.uniform(*TAKES), start, end, miss, rng.normal(0.0, BULGE * share, 3))

    def at(self, time: float) -> np.ndarray:
        """Point (3,) at a time since the phase began [s]."""
        from policy.scripted.policy import minimum_jerk

        first = float(minimum_jerk((time - self.begin) / self.takes))
        second = float(
            minimum_jerk((time - self.begin - (1.0 - CORRECTS) * self.takes) / (2.0 * CORRECTS * self.takes))
        )
        way = self.start + first * (self.end + self.miss - self.start) - second * self.miss
        return way + 16.0 * (first * (1.0 - first)) ** 2 * self.bulge


class _Points:
    """Both palms on their ways, turned and with fingers from here to there.

    Args:
        rng: Of the variations.
        start, end: What hands do at first and at last.
    """

    def __init__(self, rng: np.random.Generator, start: Hands, end: Hands) -> None:
        import numpy as np

        from policy.geometry.rotations import matrix_to_rotvec

        self._start, self._end = start, end
        self._ways = [_Way.drawn(rng, *points) for points in zip(start.palms, end.palms, strict=True)]
        self._turns = matrix_to_rotvec(end.R @ np.swapaxes(start.R, 1, 2))

    def at(self, time: float) -> Hands:
        """What hands do at a time since the phase began [s]; fingers come first, so that they let go."""
        import numpy as np

        from policy.geometry.rotations import rotvec_to_matrix
        from policy.scripted.policy import minimum_jerk

        start, end, turned = self._start, self._end, float(minimum_jerk(time / TAKES[0]))
        let_go = float(minimum_jerk(time / LETS_GO))
        fingers = [a + let_go * (b - a) for a, b in zip(start.fingers, end.fingers, strict=True)]
        palms = np.array([way.at(time) for way in self._ways])
        return Hands(palms, rotvec_to_matrix(turned * self._turns) @ start.R, (fingers[0], fingers[1]))


class _Script:
    """A scripted motion at somebody's pace, which bulges out on the way to the thing.

    Args:
        rng: Of the variations.
        script: The motion, from the stance on.
    """

    def __init__(self, rng: np.random.Generator, script: ScriptedPolicy) -> None:
        import numpy as np

        self._script, self._begin, self._pace = script, rng.uniform(*BEGIN), rng.uniform(*PACE)
        self._bulge = rng.normal(0.0, BULGE, (2, 3))
        # Out to the side, never in: there the thing is.
        self._bulge[:, 1] = np.abs(self._bulge[:, 1]) * (1.0, -1.0)

    def at(self, time: float) -> Hands:
        """What hands do at a time since the phase began [s]."""
        import numpy as np

        from policy.scripted.policy import minimum_jerk

        t = max(time - self._begin, 0.0) * self._pace
        motion, share = self._script.script(np.array([t])), float(minimum_jerk(t / APPROACH))
        palms = np.array([motion.p_world_lpalm.reshape(-1, 3)[0], motion.p_world_rpalm.reshape(-1, 3)[0]])
        R = np.array([motion.R_world_lhand.reshape(-1, 3, 3)[0], motion.R_world_rhand.reshape(-1, 3, 3)[0]])
        fingers = [np.reshape(q, (-1, np.shape(q)[-1]))[0] for q in (motion.q_lhand, motion.q_rhand)]
        forces = np.array([np.reshape(f, (-1, 3))[0] for f in (motion.f_world_lpalm, motion.f_world_rpalm)])
        return Hands(palms + 16.0 * (share * (1.0 - share)) ** 2 * self._bulge, R, (fingers[0], fingers[1]), forces)


class WholebodyExpert(HandsTeleoperator):
    """Does the robot's task in an episode, goes back in a reset.

    Args:
        config: Settings.
    """

    config_class = WholebodyExpertConfig
    name = "wholebody_expert"

    def connect(self, calibrate: bool = True) -> None:
        """Come; the robot may come later, as in `lerobot-record`."""
        import numpy as np

        super().connect(calibrate)
        self._rng = np.random.default_rng(self.config.seed)

    def _begin(self, robot: WholebodyG1) -> None:
        """Begin the motion of this phase.

        Raises:
            ValueError: If the robot has no task.
        """
        if robot.task is None:
            raise ValueError("the expert needs a task: --robot.task=reach, or another one")
        if robot.phase == "reset":
            self._way = _Points(self._rng, self.last, self._rest)
        elif hasattr(robot.task, "script"):
            self._way = _Script(self._rng, robot.task.script())
        else:
            self._way = _Points(self._rng, self.last, replace(self._rest, palms=robot.task.goals))

    def _at(self, time: float) -> Hands:
        return self._way.at(time)
