"""A scripted expert who does the robot's task, never twice in the same way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from lerobot.teleoperators import Teleoperator

from lerobot_robot_wholebody import stage
from lerobot_robot_wholebody.config_wholebody_expert import WholebodyExpertConfig

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
class Hands:
    """What both hands do at an instant, in the stance.

    Attributes:
        palms: Palm points, left first, shape (2, 3), [m].
        R: Rotations, shape (2, 3, 3).
        fingers: Of the left and right hand, motor order, shape (7,) each, [rad].
    """

    palms: np.ndarray
    R: np.ndarray
    fingers: tuple[np.ndarray, np.ndarray]


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
        self._script, self._begin, self._pace = script, rng.uniform(*BEGIN), rng.uniform(*PACE)
        self._bulge = rng.normal(0.0, BULGE, (2, 3))

    def at(self, time: float) -> Hands:
        """What hands do at a time since the phase began [s]."""
        import numpy as np

        from policy.scripted.policy import minimum_jerk

        t = max(time - self._begin, 0.0) * self._pace
        motion, share = self._script.script(np.array([t])), float(minimum_jerk(t / APPROACH))
        palms = np.array([motion.p_world_lpalm.reshape(-1, 3)[0], motion.p_world_rpalm.reshape(-1, 3)[0]])
        R = np.array([motion.R_world_lhand.reshape(-1, 3, 3)[0], motion.R_world_rhand.reshape(-1, 3, 3)[0]])
        fingers = [np.reshape(q, (-1, np.shape(q)[-1]))[0] for q in (motion.q_lhand, motion.q_rhand)]
        return Hands(palms + 16.0 * (share * (1.0 - share)) ** 2 * self._bulge, R, (fingers[0], fingers[1]))


class WholebodyExpert(Teleoperator):
    """Drives a connected `wholebody_g1` of the same process: does its task in an episode, goes back in a reset.

    Args:
        config: Settings.

    Attributes:
        last: What the hands were told last.
    """

    config_class = WholebodyExpertConfig
    name = "wholebody_expert"

    def __init__(self, config: WholebodyExpertConfig) -> None:
        super().__init__(config)
        self.config, self._there = config, False

    @property
    def action_features(self) -> dict[str, type]:
        """Numbers of wrists and fingers."""
        from lerobot_robot_wholebody.target import Numbers

        return dict.fromkeys(Numbers().action_names, float)

    @property
    def feedback_features(self) -> dict[str, type]:
        """It sees the robot for itself."""
        return {}

    @property
    def is_connected(self) -> bool:
        """Whether it was asked to come."""
        return self._there

    @property
    def is_calibrated(self) -> bool:
        """Nothing is calibrated."""
        return True

    def connect(self, calibrate: bool = True) -> None:
        """Come; the robot may come later, as in `lerobot-record`."""
        import numpy as np

        self._rng, self._phase, self._robot = np.random.default_rng(self.config.seed), None, None
        self._there = True

    def calibrate(self) -> None:
        """Nothing is."""

    def configure(self) -> None:
        """Nothing is."""

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """It sees the robot for itself."""

    def disconnect(self) -> None:
        """Leave."""
        self._there, self._robot = False, None

    def get_action(self) -> dict[str, Any]:
        """Where wrists and fingers are to be now.

        Raises:
            ConnectionError: If it was not asked to come, or there is no robot.
            ValueError: If the robot has no task.
        """
        if not self._there:
            raise ConnectionError(f"{self} is not connected; call connect first")
        robot = stage.find(self.config.robot_id)
        if robot.task is None:
            raise ValueError("the expert needs a task: --robot.task=reach, or another one")
        if robot is not self._robot:
            self._meet(robot)
        if robot.phases != self._phase:
            self._set_off(robot)
        time = robot.now() - self._began
        return self._action(self._way.at(time))

    def _meet(self, robot: WholebodyG1) -> None:
        """Take note of how the robot stands."""
        import numpy as np

        from policy.action_spec.anchor import Anchor
        from policy.geometry.se3 import inverse

        seen, numbers = robot.seen.observation, robot.numbers
        anchor = numbers.anchor(seen)
        T_stance_base = inverse(anchor.T_world_stance) @ anchor.T_world_base
        R = np.array([(T_stance_base @ anchor.poses[hand])[:3, :3] for hand in ("lhand", "rhand")])
        self._robot, self._anchor, self._phase = robot, Anchor.nominal(robot=numbers.spec.robot), None
        self._rest = self.last = Hands(numbers.palms(seen), R, (seen.q_lhand.copy(), seen.q_rhand.copy()))

    def _set_off(self, robot: WholebodyG1) -> None:
        """Begin the motion of this phase."""
        self._phase, self._began = robot.phases, robot.now()
        if robot.phase == "reset":
            self._way = _Points(self._rng, self.last, self._rest)
        elif hasattr(robot.task, "script"):
            self._way = _Script(self._rng, robot.task.script())
        else:
            self._way = _Points(self._rng, self.last, replace(self._rest, palms=robot.task.goals))

    def _action(self, hands: Hands) -> dict[str, float]:
        from lerobot_robot_wholebody.target import wrist_at
        from policy.action_spec.codec import encode_valid
        from policy.chunk import ActionChunk

        self.last, numbers = hands, self._robot.numbers
        poses = [
            self._anchor.T_world_stance @ wrist_at(palm, R, side, numbers)
            for palm, R, side in zip(hands.palms, hands.R, ("left", "right"), strict=True)
        ]
        rows = [part[None] for part in (*poses, *hands.fingers)]
        chunk = ActionChunk(numbers.spec.id, 0, 0.0, numbers.spec.fps, *rows)
        values = encode_valid(numbers.spec, chunk, self._anchor)[0]
        return dict(zip(numbers.action_names, values.tolist(), strict=True))
