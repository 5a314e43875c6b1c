"""What teleoperators of the robot share: they find it in this process, and most say where both hands are to be."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from lerobot.teleoperators import Teleoperator

from lerobot_robot_wholebody import stage

if TYPE_CHECKING:
    import numpy as np

    from lerobot_robot_wholebody.config_teleoperators import HandsTeleoperatorConfig
    from lerobot_robot_wholebody.wholebody_g1 import WholebodyG1
    from policy.action_spec.anchor import Anchor


@dataclass(frozen=True)
class Hands:
    """What both hands do at an instant, in the stance.

    Attributes:
        palms: Palm points, left first, shape (2, 3), [m].
        R: Rotations, shape (2, 3, 3).
        fingers: Of the left and right hand, motor order, shape (7,) each, [rad].
        forces: That the palms are to meet, shape (2, 3), [N]; a robot to which none are told does without.
    """

    palms: np.ndarray
    R: np.ndarray
    fingers: tuple[np.ndarray, np.ndarray]
    forces: np.ndarray | None = None


class RobotTeleoperator(Teleoperator):
    """Drives a connected `wholebody_g1` of the same process.

    Args:
        config: Settings.
    """

    def __init__(self, config: HandsTeleoperatorConfig) -> None:
        super().__init__(config)
        self.config, self._there = config, False

    @property
    def action_features(self) -> dict[str, type]:
        """Numbers of wrists and fingers; of forces too, once it drives a robot to which they are told."""
        from lerobot_robot_wholebody.target import Numbers

        driven = self._robot if self._there else None
        return dict.fromkeys((driven.numbers if driven else Numbers()).action_names, float)

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
        self._phase, self._robot, self._there = None, None, True

    def calibrate(self) -> None:
        """Nothing is."""

    def configure(self) -> None:
        """Nothing is."""

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """It sees the robot for itself."""

    def disconnect(self) -> None:
        """Leave."""
        self._there, self._robot = False, None

    def _begin(self, robot: WholebodyG1) -> None:
        """A phase of a recording begins, or the robot is met."""

    def _driven(self) -> WholebodyG1:
        """The robot, met and in its present phase."""
        if not self._there:
            raise ConnectionError(f"{self} is not connected; call connect first")
        robot = stage.find(self.config.robot_id)
        if robot is not self._robot:
            self._meet(robot)
        if robot.phases != self._phase:
            self._phase, self._began = robot.phases, robot.now()
            self._begin(robot)
        return robot

    def _meet(self, robot: WholebodyG1) -> None:
        """Take note of a robot that was not driven before."""
        self._robot, self._phase = robot, None


class HandsTeleoperator(RobotTeleoperator):
    """Drives it by where its hands are to be at a time, which a subclass says.

    Args:
        config: Settings.

    Attributes:
        last: What the hands were told last; at first what they do.
    """

    def get_action(self) -> dict[str, Any]:
        """Where wrists and fingers are to be now.

        Raises:
            ConnectionError: If it was not asked to come, or there is no robot.
        """
        robot = self._driven()
        self.last = self._at(robot.now() - self._began)
        return self._action(self.last)

    @abstractmethod
    def _at(self, time: float) -> Hands:
        """What hands are to do at a time since the phase began [s]."""

    def _meet(self, robot: WholebodyG1) -> None:
        """Take note of how the robot stands."""
        import numpy as np

        from policy.action_spec.anchor import Anchor
        from policy.geometry.se3 import inverse

        super()._meet(robot)
        seen, numbers = robot.seen.observation, robot.numbers
        anchor = numbers.anchor(seen)
        T_stance_base = inverse(anchor.T_world_stance) @ anchor.T_world_base
        R = np.array([(T_stance_base @ anchor.poses[hand])[:3, :3] for hand in ("lhand", "rhand")])
        self._anchor: Anchor = Anchor.nominal(robot=numbers.spec.robot)
        self._rest = self.last = Hands(numbers.palms(seen), R, (seen.q_lhand.copy(), seen.q_rhand.copy()))

    def _action(self, hands: Hands) -> dict[str, float]:
        """Numbers of the action by name."""
        from lerobot_robot_wholebody.target import wrist_at
        from policy.action_spec.codec import encode_valid
        from policy.chunk import ActionChunk

        numbers = self._robot.numbers
        poses = [
            self._anchor.T_world_stance @ wrist_at(palm, R, side, numbers)
            for palm, R, side in zip(hands.palms, hands.R, ("left", "right"), strict=True)
        ]
        rows = [part[None] for part in (*poses, *hands.fingers)]
        told = {}
        if hands.forces is not None:
            forces = hands.forces @ self._anchor.T_world_stance[:3, :3].T
            told = {"f_world_lpalm": forces[:1], "f_world_rpalm": forces[1:]}
        chunk = ActionChunk(numbers.spec.id, 0, 0.0, numbers.spec.fps, *rows, **told)
        values = encode_valid(numbers.spec, chunk, self._anchor)[0]
        return dict(zip(numbers.action_names, values.tolist(), strict=True))
