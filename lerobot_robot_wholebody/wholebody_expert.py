"""A scripted expert who reaches for the goals of the robot's task, never twice in the same way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from lerobot.teleoperators import Teleoperator

from lerobot_robot_wholebody import stage
from lerobot_robot_wholebody.config_wholebody_expert import WholebodyExpertConfig

if TYPE_CHECKING:
    import numpy as np

    from lerobot_robot_wholebody.wholebody_g1 import WholebodyG1

BEGIN, TAKES = (0.0, 0.4), (1.4, 2.2)
"""When a hand sets off after the phase began, and how long it takes [s]; chosen: as people do in front of a table."""
MISSES, CORRECTS = 0.04, 0.35
"""Share of the way by which the first movement misses, standard deviation, and the share of its time at which it is
corrected [no unit]; chosen after the two movements of Woodworth's model."""
BULGE = 0.03
"""By how much a way bulges out to the side, standard deviation [m]; chosen."""


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


class WholebodyExpert(Teleoperator):
    """Drives a connected `wholebody_g1` of the same process: to its goals in an episode, back in a reset.

    Args:
        config: Settings.
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
            raise ValueError("the expert needs a task: --robot.task=reach")
        if robot is not self._robot:
            self._meet(robot)
        if robot.phases != self._phase:
            self._set_off(robot)
        time = robot.now() - self._began
        return self._action([way.at(time) for way in self._ways])

    def _meet(self, robot: WholebodyG1) -> None:
        """Take note of how the robot stands."""
        from lerobot_robot_wholebody.target import palm_of
        from policy.action_spec.anchor import Anchor
        from policy.geometry.se3 import inverse

        seen = robot.seen.observation
        anchor = Anchor.measured(seen, robot.numbers.spec.robot)
        T_stance_base = inverse(anchor.T_world_stance) @ anchor.T_world_base
        self._robot, self._anchor, self._phase = robot, Anchor.nominal(robot=robot.numbers.spec.robot), None
        self._turned = [(T_stance_base @ anchor.poses[hand])[:3, :3] for hand in ("lhand", "rhand")]
        self._fingers = seen.q_lhand.copy(), seen.q_rhand.copy()
        self._rest = [
            palm_of(T_stance_base @ anchor.poses[hand], side, robot.numbers)
            for hand, side in (("lhand", "left"), ("rhand", "right"))
        ]
        self._last = self._rest

    def _set_off(self, robot: WholebodyG1) -> None:
        self._phase, self._began = robot.phases, robot.now()
        ends = self._rest if robot.phase == "reset" else robot.task.goals
        self._ways = [_Way.drawn(self._rng, *points) for points in zip(self._last, ends, strict=True)]

    def _action(self, palms: list[np.ndarray]) -> dict[str, float]:
        from lerobot_robot_wholebody.target import wrist_at
        from policy.action_spec.codec import encode_valid
        from policy.chunk import ActionChunk

        self._last, numbers = palms, self._robot.numbers
        poses = [
            self._anchor.T_world_stance @ wrist_at(palm, R, side, numbers)
            for palm, R, side in zip(palms, self._turned, ("left", "right"), strict=True)
        ]
        rows = [part[None] for part in (*poses, *self._fingers)]
        chunk = ActionChunk(numbers.spec.id, 0, 0.0, numbers.spec.fps, *rows)
        values = encode_valid(numbers.spec, chunk, self._anchor)[0]
        return dict(zip(numbers.action_names, values.tolist(), strict=True))
